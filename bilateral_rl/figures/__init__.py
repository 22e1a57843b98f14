"""Figures of trials, trainings and studies, each a function that returns a matplotlib ``Figure`` of its own.

What happens in trials is in :mod:`~bilateral_rl.figures.trials` and :mod:`~bilateral_rl.figures.hemispheres`, how
networks learned in :mod:`~bilateral_rl.figures.curves`, what a study found in :mod:`~bilateral_rl.figures.models`,
:mod:`~bilateral_rl.figures.lesions`, :mod:`~bilateral_rl.figures.specialization` and
:mod:`~bilateral_rl.figures.posthoc`; :mod:`~bilateral_rl.figures.saving` makes files of them. No function touches
pyplot's figures or settings, so threads may draw. Trainings draw hand paths: only what those need is imported here.
"""

from bilateral_rl.figures.saving import as_array
from bilateral_rl.figures.trials import hand_paths

__all__ = ["as_array", "hand_paths"]
