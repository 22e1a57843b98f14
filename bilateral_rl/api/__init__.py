"""The toolkit in a dozen words, for notebooks and scripts; the commands are callers of the same functions.

::

    import bilateral_rl as brl

    run = brl.train(model="cc_s", algo="ppo", timesteps=200_000)
    run = brl.load("runs/random_reach/cc_s-ppo-1")
    run.evaluate(lesion="callosum", trials=512)  # a DataFrame, as all results are
    results = run.lesion(retrain="everything")
    policy = run.policy(lesion="callosum")  # of stable-baselines3

All names are there as ``bilateral_rl.<name>``, and are imported when they are first used. Their signatures are stable:
a test lists them. Arguments are called as the options of the commands are, with three exceptions: ``--set`` is
``settings``, a dictionary; ``--metric`` is ``metrics`` and, where there can be several, ``--lesion`` is ``lesions``.
In :func:`load`, :func:`train` and :meth:`Run.policy`, ``seed`` is that of a network, and in tests that of the trials.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bilateral_rl.analysis.recording import Recording
    from bilateral_rl.analysis.trial_records import TrialRecord
    from bilateral_rl.analysis.trials import Evaluator
    from bilateral_rl.api.comparison import Comparison, compare
    from bilateral_rl.api.importing import import_model
    from bilateral_rl.api.listing import list_runs
    from bilateral_rl.api.plots import plot_blocks, plot_curves, plot_lesions
    from bilateral_rl.api.recording_plots import plot_center_out, plot_channel, plot_muscles, plot_paths, plot_speeds
    from bilateral_rl.api.rendering import render
    from bilateral_rl.api.reproduction import Reproduction, reproduce
    from bilateral_rl.api.run import Run, load
    from bilateral_rl.api.sweeping import sweep
    from bilateral_rl.api.training import train
    from bilateral_rl.io.errors import Stopped, UserError

MODULES = {
    "Comparison": "api.comparison",
    "Evaluator": "analysis.trials",
    "Recording": "analysis.recording",
    "Reproduction": "api.reproduction",
    "Run": "api.run",
    "Stopped": "io.errors",
    "TrialRecord": "analysis.trials",
    "UserError": "io.errors",
    "compare": "api.comparison",
    "import_model": "api.importing",
    "list_runs": "api.listing",
    "load": "api.run",
    "plot_blocks": "api.plots",
    "plot_center_out": "api.recording_plots",
    "plot_channel": "api.recording_plots",
    "plot_curves": "api.plots",
    "plot_lesions": "api.plots",
    "plot_muscles": "api.recording_plots",
    "plot_paths": "api.recording_plots",
    "plot_speeds": "api.recording_plots",
    "render": "api.rendering",
    "reproduce": "api.reproduction",
    "sweep": "api.sweeping",
    "train": "api.training",
}
"""The module of each name, below ``bilateral_rl``."""

__all__ = [
    "Comparison",
    "Evaluator",
    "Recording",
    "Reproduction",
    "Run",
    "Stopped",
    "TrialRecord",
    "UserError",
    "compare",
    "import_model",
    "list_runs",
    "load",
    "plot_blocks",
    "plot_center_out",
    "plot_channel",
    "plot_curves",
    "plot_lesions",
    "plot_muscles",
    "plot_paths",
    "plot_speeds",
    "render",
    "reproduce",
    "sweep",
    "train",
]

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        if name not in MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = globals()[name] = getattr(importlib.import_module(f"bilateral_rl.{MODULES[name]}"), name)
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
