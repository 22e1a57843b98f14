"""Traces of past actions: what critics need to see where an action changes a state that no observation shows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import SupportsFloat

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class ActionTraces:
    """Running averages of the past actions of many environments, reset where a trial ends.

    A command to a muscle first changes its activation, which no observation shows; force, speed and position follow
    steps later. An observation alone is no state then: the reward of a step does not depend on its action, and a
    critic that sees nothing else learns nothing about it. Averages over a few past steps stand for the activation.

    Args:
        decays: share of each trace that stays at a step, in [0, 1); none for no traces. An action counts for about
            1 / (1 - decay) steps.
        n_actions: numbers in an action.

    Raises:
        ValueError: a decay that is not in [0, 1).
    """

    decays: tuple[float, ...]
    n_actions: int

    def __init__(self, decays: Sequence[float], n_actions: int) -> None:
        object.__setattr__(self, "decays", checked_decays(decays))
        object.__setattr__(self, "n_actions", n_actions)

    @property
    def size(self) -> int:
        """Numbers in the traces of an environment: of each decay those of an action, and one more."""
        return len(self.decays) * (self.n_actions + 1)

    def start(self, n_envs: int) -> NDArray[np.float32]:
        """Return the traces at the start of a trial, zeros (n_envs, size)."""
        return np.zeros((n_envs, self.size), dtype=np.float32)

    def advance(self, traces: NDArray[np.float32], actions: NDArray[np.floating]) -> NDArray[np.float32]:
        """Return the traces after a step.

        Args:
            traces: (n, size), before it.
            actions: (n, n_actions), each number scaled to [-1, 1].

        Returns:
            (n, size).
        """
        # x ← d x + (1 - d) [a, 1]. The one at the end makes a trace that has begun at zero tell how long ago that was.
        n, decays = len(traces), np.array(self.decays, dtype=np.float32)[:, None]  # (n_decays, 1)
        new = np.ones((n, 1, self.n_actions + 1), dtype=np.float32)
        new[:, 0, :-1] = actions
        old = traces.reshape(n, len(self.decays), self.n_actions + 1)
        return (decays * old + (1 - decays) * new).reshape(n, self.size)


def checked_decays(decays: object) -> tuple[float, ...]:
    """Return the decays of traces as numbers.

    Raises:
        ValueError: what is no sequence, or a decay that is not in [0, 1).
    """
    if isinstance(decays, str) or not isinstance(decays, Iterable):
        raise ValueError(f"action_traces must be a sequence of decays, such as (0.5, 0.8), not {decays!r}.")
    values = list(decays)
    if wrong := [decay for decay in values if not (isinstance(decay, SupportsFloat) and 0 <= float(decay) < 1)]:
        raise ValueError(f"the decays of action_traces must be at least 0 and less than 1, got {wrong[0]!r}.")
    return tuple(float(decay) for decay in values)
