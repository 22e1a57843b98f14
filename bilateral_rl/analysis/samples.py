"""Values of one measure over the seeds: which of them can be used, and what is to be said about them."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from bilateral_rl.io.text import seed_counts

Float = NDArray[np.float64]

FEW_SEEDS = 5
"""Below this many seeds a result is marked as one of few seeds [ours]."""

ROUNDING = 1e-12
"""Spread below this share of the values' size is rounding, not spread: no test can be made of it [ours]."""


def finite(values: ArrayLike) -> Float:
    """(n,): the numbers among ``values``, in their order; nan and infinities are left out."""
    array = np.asarray(values, dtype=np.float64).ravel()
    return array[np.isfinite(array)]


def finite_pairs(first: ArrayLike, second: ArrayLike) -> tuple[Float, Float]:
    """(n,) each: the pairs of two samples of equal length of which both are numbers.

    Raises:
        ValueError: samples of different length.
    """
    a, b = (np.asarray(values, dtype=np.float64).ravel() for values in (first, second))
    if len(a) != len(b):
        raise ValueError(f"paired samples must have equal length, got {len(a)} and {len(b)}.")
    both = np.isfinite(a) & np.isfinite(b)
    return a[both], b[both]


def usable(first: ArrayLike, second: ArrayLike, paired: bool) -> tuple[Float, Float]:
    """The numbers of two samples: pair by pair, or each for itself."""
    return finite_pairs(first, second) if paired else (finite(first), finite(second))


def align(first: pd.Series, second: pd.Series) -> tuple[Float, Float]:
    """(n,) each: the values of the seeds that both have, by seed."""
    both = pd.concat([first, second], axis=1, join="inner").to_numpy(dtype=np.float64)
    return both[:, 0], both[:, 1]


def has_spread(values: Float, size: float | None = None) -> bool:
    """Whether ``values`` differ by more than rounding.

    Args:
        values: (n,) numbers.
        size: what rounding is relative to; None for the largest of them.
    """
    if len(values) < 2:
        return False
    size = float(np.abs(values).max()) if size is None else size
    return bool(np.ptp(values) > ROUNDING * size)


def pair_has_spread(a: Float, b: Float, paired: bool) -> bool:
    """Whether a test of the difference of two samples of numbers has any spread to go by."""
    if not paired:
        return has_spread(a) or has_spread(b)
    return has_spread(a - b, size=float(np.abs(np.concatenate([a, b, [0.0]])).max()))


def caveats(n: int, left_out: int = 0, spread: bool = True) -> str:
    """What must be said about a result, "" if nothing.

    Args:
        n: seeds of the smallest sample.
        left_out: values that were no numbers.
        spread: whether the values differ at all.
    """
    parts = []
    if n < 2:
        parts.append(f"{seed_counts([n])}: no test")
    elif n < FEW_SEEDS:
        parts.append(f"only {n} seeds")
    if n >= 2 and not spread:
        parts.append("all values are equal: no test")
    if left_out:
        parts.append("1 value is no number" if left_out == 1 else f"{left_out} values are no numbers")
    return join_notes(*parts)


def join_notes(*notes: str) -> str:
    """All that is to be said, each thing once."""
    return "; ".join(dict.fromkeys(part for note in notes for part in note.split("; ") if part))


def count_left_out(first: ArrayLike, second: ArrayLike, paired: bool) -> int:
    """How many values, or pairs, of two samples are no numbers."""
    a, b = usable(first, second, paired)
    return int(np.size(first) - len(a) if paired else np.size(first) + np.size(second) - len(a) - len(b))


def pair_caveats(first: ArrayLike, second: ArrayLike, paired: bool) -> str:
    """:func:`caveats` of a comparison of two samples."""
    a, b = usable(first, second, paired)
    left_out = count_left_out(first, second, paired)
    return caveats(min(len(a), len(b)), left_out, pair_has_spread(a, b, paired))
