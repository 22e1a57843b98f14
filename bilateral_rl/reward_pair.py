"""The pair of rewards of a step, dominant and non-dominant: the one check of it, wherever it comes from."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def checked_pair(pair: object, what: str) -> NDArray[np.float32]:
    """Return a pair of rewards, (2,).

    Args:
        pair: what somebody gave for one.
        what: what it is, as the beginning of the error's sentence.

    Raises:
        ValueError: anything but two finite numbers.
    """
    rewards = _numbers(pair)
    if rewards.shape != (2,) or not np.isfinite(rewards).all():
        raise ValueError(f"{what} must be two finite numbers, dominant and non-dominant, got {pair!r}.")
    return rewards


def checked_pairs(pairs: Any, n: int, what: str) -> NDArray[np.float32]:
    """Return the pairs of rewards of ``n`` environments, (n, 2).

    Args:
        pairs: a sequence of ``n`` pairs, or an array (n, 2).
        n: number of environments.
        what: what they are, as the beginning of the error's sentence.

    Raises:
        ValueError: anything but two finite numbers for each; the sentence names the first such environment.
    """
    is_array = isinstance(pairs, np.ndarray) and pairs.dtype == np.float32  # nearly always: this is every step's
    rewards = pairs if is_array else _numbers(pairs)
    if rewards.shape == (n, 2) and np.isfinite(rewards).all():
        return rewards
    if np.ndim(pairs) if isinstance(pairs, np.ndarray) else isinstance(pairs, (list, tuple)):
        for number, pair in enumerate(pairs):
            checked_pair(pair, f"{what} of environment {number}")
    shape = f"an array {rewards.shape}" if rewards.size else repr(pairs)
    raise ValueError(f"{what} must be a pair for each of {n} environments, ({n}, 2), got {shape}.")


def _numbers(values: Any) -> NDArray[np.float32]:
    """Return ``values`` as numbers, or an empty array if they are none."""
    try:
        numbers = np.asarray(values)
        if numbers.dtype.kind not in "biuf":
            numbers = np.asarray(values, dtype=np.float32) if numbers.dtype == object else np.empty(0)
        with np.errstate(over="ignore"):
            return numbers.astype(np.float32, copy=False)
    except (TypeError, ValueError, RuntimeError):  # the last one is torch's
        return np.empty(0, dtype=np.float32)
