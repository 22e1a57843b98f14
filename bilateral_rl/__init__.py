"""Two-hemisphere motor controllers on a six-muscle arm, trained with stable-baselines3.

For notebooks and scripts there are the words of :mod:`bilateral_rl.api`, such as ``bilateral_rl.train`` and
``bilateral_rl.load``, imported when they are first used.

``import bilateral_rl`` registers the environments with Gymnasium and the policies' names with SB3's PPO, A2C, SAC and
TD3, so that ``PPO("CallosalPolicy", "bilateral_rl/RandomReach-v0")`` works. It imports neither library by itself: what
needs one is registered as soon as that library is imported.
"""

from __future__ import annotations

import importlib
import importlib.abc
import importlib.machinery
import sys
from collections.abc import Sequence
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bilateral_rl import algorithms, envs, policies
    from bilateral_rl.api import (
        Comparison,
        Evaluator,
        Recording,
        Reproduction,
        Run,
        Stopped,
        TrialRecord,
        UserError,
        compare,
        import_model,
        list_runs,
        load,
        plot_blocks,
        plot_center_out,
        plot_channel,
        plot_curves,
        plot_lesions,
        plot_muscles,
        plot_paths,
        plot_speeds,
        render,
        reproduce,
        sweep,
        train,
    )

__version__ = "0.2.0"

__all__ = [
    "Comparison",
    "Evaluator",
    "Recording",
    "Reproduction",
    "Run",
    "Stopped",
    "TrialRecord",
    "UserError",
    "__version__",
    "algorithms",
    "compare",
    "envs",
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
    "policies",
    "render",
    "reproduce",
    "sweep",
    "train",
]

_ROOMS = ("algorithms", "envs", "policies")

_REGISTERED_BY = {"gymnasium": "bilateral_rl.envs.registration", "stable_baselines3": "bilateral_rl.policies"}
"""The module whose import registers with each library."""


if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        if name in _ROOMS:
            return importlib.import_module(f"{__name__}.{name}")
        if name in __all__:
            value = globals()[name] = getattr(importlib.import_module(f"{__name__}.api"), name)
            return value
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


class _AfterImport(importlib.abc.MetaPathFinder):
    """Finds the libraries of ``_REGISTERED_BY`` as Python would, and registers with each once it is imported."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname not in _REGISTERED_BY:
            return None
        for finder in sys.meta_path:
            spec = None if finder is self else finder.find_spec(fullname, path, target)
            if spec is not None and spec.loader is not None:
                _register_after(spec.loader, _REGISTERED_BY[fullname])
                return spec
        return None


def _register_after(loader: Any, registration: str) -> None:
    """Let ``loader`` import the module ``registration`` after the next module that it loads."""
    execute = loader.exec_module

    def exec_module(module: ModuleType) -> None:
        loader.exec_module = execute  # some loaders load many modules
        execute(module)
        importlib.import_module(registration)

    loader.exec_module = exec_module


def _register() -> None:
    sys.meta_path.insert(0, _AfterImport())
    for library, registration in _REGISTERED_BY.items():
        if library in sys.modules:
            importlib.import_module(registration)


_register()
