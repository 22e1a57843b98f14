"""What every environment face shares: settings that can be read by name, and cannot change while its arms run."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.trials import TrialBatch

_SETTINGS = frozenset(field.name for field in dataclasses.fields(TrialSettings))
_NEVER = _SETTINGS | {"task", "n", "n_envs", "n_arms", "device"}
_ONCE = frozenset({"settings", "batch", "num_envs", "render_mode"})
_FIXED = _NEVER | _ONCE


class RunningArms:
    """An environment whose settings are attributes too (``env.threshold``), and refuse to be replaced.

    Some of them size the kernels' memory, some are drawn ahead, and a stored run says what its settings were: all of
    them hold from the start to the end, and other settings are another environment.
    """

    settings: TrialSettings
    batch: TrialBatch

    if not TYPE_CHECKING:  # where it would let every misspelled attribute pass

        def __getattr__(self, name: str) -> Any:
            if name in _SETTINGS:
                return getattr(self.settings, name)
            if name in ("task", "device", "n_arms"):
                return getattr(self.batch, name)
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")

    def __setattr__(self, name: str, value: object) -> None:
        if name in _FIXED:
            self.refuse_change(name, value)
        object.__setattr__(self, name, value)

    def refuse_change(self, name: str, value: object) -> None:
        """Raise an AttributeError if ``name`` is what cannot change any more."""
        if name in _NEVER or (name in _ONCE and self.__dict__.get(name, value) is not value):
            raise AttributeError(
                f"{name} of a running {type(self).__name__} cannot be changed: make a new environment with the other "
                f"{name}, which a model of stable-baselines3 takes by model.set_env."
            )
