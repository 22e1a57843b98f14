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
    from bilateral_rl.api.comparison import Comparison, compare
    from bilateral_rl.api.importing import import_model
    from bilateral_rl.api.listing import list_runs
    from bilateral_rl.api.plots import plot_curves, plot_lesions, plot_muscles, plot_paths, plot_speeds
    from bilateral_rl.api.rendering import render
    from bilateral_rl.api.reproduction import Reproduction, reproduce
    from bilateral_rl.api.run import Run, load
    from bilateral_rl.api.sweeping import sweep
    from bilateral_rl.api.training import train

MODULES = {
    "Comparison": "comparison",
    "Reproduction": "reproduction",
    "Run": "run",
    "compare": "comparison",
    "import_model": "importing",
    "list_runs": "listing",
    "load": "run",
    "plot_curves": "plots",
    "plot_lesions": "plots",
    "plot_muscles": "plots",
    "plot_paths": "plots",
    "plot_speeds": "plots",
    "render": "rendering",
    "reproduce": "reproduction",
    "sweep": "sweeping",
    "train": "training",
}
"""Where each name is."""

__all__ = [
    "Comparison",
    "Reproduction",
    "Run",
    "compare",
    "import_model",
    "list_runs",
    "load",
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
        value = globals()[name] = getattr(importlib.import_module(f"{__name__}.{MODULES[name]}"), name)
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
