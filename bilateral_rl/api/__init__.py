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
    from bilateral_rl.api.listing import list_runs
    from bilateral_rl.api.run import Run, load
    from bilateral_rl.api.training import train

MODULES = {
    "Run": "run",
    "list_runs": "listing",
    "load": "run",
    "train": "training",
}
"""Where each name is."""

__all__ = ["Run", "list_runs", "load", "train"]

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        if name not in MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = globals()[name] = getattr(importlib.import_module(f"{__name__}.{MODULES[name]}"), name)
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
