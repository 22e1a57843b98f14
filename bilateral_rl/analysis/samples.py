"""Values of one measure over the seeds: which of them can be used, and what must be said about a result of them."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from bilateral_rl.io.text import seed_counts

Float64 = NDArray[np.float64]

FEW_SEEDS = 5
"""Below this many seeds a result is marked as one of few seeds [ours]."""

ROUNDING = 1e-12
"""Spread below this share of the values' size is rounding, not spread: no test can be made of it [ours]."""


def finite(values: ArrayLike) -> Float64:
    """Return ``values`` without NaN and infinities, (n,) in their order."""
    array = np.asarray(values, dtype=np.float64).ravel()
    return array[np.isfinite(array)]


def finite_pairs(first: ArrayLike, second: ArrayLike) -> tuple[Float64, Float64]:
    """Return the pairs of two samples of equal length in which both values are finite, (n,) each.

    Raises:
        ValueError: samples of different length.
    """
    a, b = (np.asarray(values, dtype=np.float64).ravel() for values in (first, second))
    if len(a) != len(b):
        raise ValueError(f"paired samples must have equal length, got {len(a)} and {len(b)}.")
    both = np.isfinite(a) & np.isfinite(b)
    return a[both], b[both]


def usable(first: ArrayLike, second: ArrayLike, paired: bool) -> tuple[Float64, Float64]:
    """Return the finite values of two samples: of pairs if ``paired``, else of each sample by itself."""
    return finite_pairs(first, second) if paired else (finite(first), finite(second))


def align(first: pd.Series, second: pd.Series) -> tuple[Float64, Float64]:
    """Return the values of the seeds that both samples have, (n,) each, in the order of ``first``."""
    both = pd.concat([first, second], axis=1, join="inner").to_numpy(dtype=np.float64)
    return both[:, 0], both[:, 1]


def has_spread(values: Float64, size: float | None = None) -> bool:
    """Whether ``values`` differ by more than rounding.

    Args:
        values: (n,), finite.
        size: what rounding is relative to; None for the largest of the values.
    """
    if len(values) < 2:
        return False
    size = float(np.abs(values).max()) if size is None else size
    return bool(np.ptp(values) > ROUNDING * size)


def pair_has_spread(a: Float64, b: Float64, paired: bool) -> bool:
    """Whether two samples of finite values have any spread by which a difference can be tested."""
    if not paired:
        return has_spread(a) or has_spread(b)
    return has_spread(a - b, size=float(np.abs(np.concatenate([a, b, [0.0]])).max()))


def caveats(n: int, left_out: int = 0, varied: bool = True) -> str:
    """Say what readers of a result must know, "" if nothing.

    Args:
        n: number of seeds in the smallest sample.
        left_out: number of values that were not finite.
        varied: whether the values differ at all.
    """
    parts = []
    if n < 2:
        parts.append(f"{seed_counts([n])}: no test")
    elif n < FEW_SEEDS:
        parts.append(f"only {n} seeds")
    if n >= 2 and not varied:
        parts.append("all values are equal: no test")
    if left_out:
        parts.append("1 value is no number" if left_out == 1 else f"{left_out} values are no numbers")
    return join_notes(*parts)


def join_notes(*notes: str) -> str:
    """Join notes, each thing once."""
    return "; ".join(dict.fromkeys(part for note in notes for part in note.split("; ") if part))


def count_left_out(first: ArrayLike, second: ArrayLike, paired: bool) -> int:
    """Return how many values (or pairs, if ``paired``) of two samples are not finite."""
    a, b = usable(first, second, paired)
    return int(np.size(first) - len(a) if paired else np.size(first) + np.size(second) - len(a) - len(b))


def pair_caveats(first: ArrayLike, second: ArrayLike, paired: bool) -> str:
    """Say what readers of a comparison of two samples must know: its :func:`caveats`."""
    a, b = usable(first, second, paired)
    left_out = count_left_out(first, second, paired)
    return caveats(min(len(a), len(b)), left_out, pair_has_spread(a, b, paired))
