"""Pairs of rewards for many environments at once: what a function of a batch of steps gives, checked and summed up."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bilateral_rl.reward_pair import checked_pairs

Float32 = NDArray[np.float32]


class Transitions(NamedTuple):
    """A step of ``n`` environments, as the function that gives their pairs of rewards sees it."""

    observation: Any
    """(n, …): what the agents acted on."""
    action: Any
    """(n, …): the actions that the wrapper was given."""
    next_observation: Any
    """(n, …): what the actions led to; where an episode ended, its last observation, and not the next episode's."""
    reward: NDArray[Any]
    """(n,), the environments' own reward, or (n, k) where their rewards are many."""
    info: Any
    """Their own info in their library's form: a dictionary of arrays in Gymnasium, a list of dictionaries in SB3."""


RewardPairs = Callable[[Transitions], tuple[ArrayLike, ArrayLike] | NDArray[Any]]
"""A function from a step of n environments to their dominant and their non-dominant rewards.

It gives two arrays (n,) as a tuple, or one array (n, 2).
"""


class BatchedPairs:
    """The pairs of ``n`` environments, step by step, and their sums over each episode.

    Args:
        n: number of environments.
        reward_pairs: gives the pairs; None if the environments' own rewards (n, 2) are the pairs.
    """

    def __init__(self, n: int, reward_pairs: RewardPairs | None) -> None:
        self._n, self._reward_pairs = n, reward_pairs
        self._returns = np.zeros((n, 2))

    def begin(self, episodes: NDArray[np.bool_] | slice = slice(None)) -> None:
        """Take note that these environments begin an episode."""
        self._returns[episodes] = 0

    def step(self, transitions: Transitions, moved: NDArray[np.bool_] | None = None) -> Float32:
        """Return the pairs (n, 2) of a step, 0 for environments that have not ``moved`` (n,).

        Raises:
            ValueError: anything but two finite numbers for each that has.
        """
        pairs = self._given(transitions)
        if moved is not None and pairs.shape == (self._n, 2):
            pairs = np.where(moved[:, None], pairs, np.float32(0))
        pairs = checked_pairs(pairs, self._n, self._what)
        self._returns += pairs
        return pairs

    def returns(self, ended: NDArray[np.bool_]) -> Float32:
        """Return the sums (k, 2) over the episodes of the k environments that ``ended`` (n,), which begin anew."""
        returns = self._returns[ended].astype(np.float32)
        self.begin(ended)
        return returns

    @property
    def _what(self) -> str:
        return "the environments' reward" if self._reward_pairs is None else "what reward_pairs gives"

    def _given(self, transitions: Transitions) -> NDArray[Any]:
        given = transitions.reward if self._reward_pairs is None else self._reward_pairs(transitions)
        if isinstance(given, (tuple, list)) and len(given) == 2:
            try:
                with np.errstate(over="ignore"):
                    given = np.stack([np.broadcast_to(np.asarray(one, np.float32), self._n) for one in given], axis=1)
            except (TypeError, ValueError):
                shapes = ", ".join(str(np.shape(one)) for one in given)
                raise ValueError(
                    f"{self._what} must be two arrays ({self._n},), dominant and non-dominant, got shapes {shapes}."
                ) from None
        if not isinstance(given, np.ndarray) or given.shape != (self._n, 2):
            raise ValueError(
                f"{self._what} must be two arrays ({self._n},) as a tuple, dominant and non-dominant, or one array "
                f"({self._n}, 2), got {type(given).__name__} of shape {np.shape(given)}."
            )
        with np.errstate(over="ignore"):
            return given.astype(np.float32)
