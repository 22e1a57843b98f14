"""Bootstrap intervals (95 %, BCa) of a mean, of a difference and of a ratio of means; the same every time.

Source: Efron 1987, doi:10.1080/01621459.1987.10478410. SciPy resamples.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from bilateral_rl.analysis.intervals import CONFIDENCE, Interval
from bilateral_rl.analysis.samples import Float64, caveats, finite, has_spread, join_notes, pair_caveats, usable

RESAMPLES = 9_999
SEED = 0
"""Seed of the resampling, so that a report repeats itself."""
_NAN = float("nan")


def bootstrap_mean(values: ArrayLike) -> Interval:
    """Mean and its bootstrap interval."""
    x = finite(values)
    note = caveats(len(x), np.size(values) - len(x), has_spread(x))
    return _interval((x,), lambda x, axis: x.mean(axis=axis), paired=False, note=note)


def bootstrap_difference(first: ArrayLike, second: ArrayLike, paired: bool = False) -> Interval:
    """Difference of two means, first − second, and its bootstrap interval; pairs are resampled as pairs."""
    samples = usable(first, second, paired)
    note = pair_caveats(first, second, paired)
    return _interval(samples, lambda a, b, axis: a.mean(axis=axis) - b.mean(axis=axis), paired, note)


def bootstrap_ratio(first: ArrayLike, second: ArrayLike, paired: bool = False) -> Interval:
    """Ratio of two means, first / second, and its bootstrap interval; pairs are resampled as pairs.

    NaN where the values of the divisor are not all of one sign.
    """
    samples = usable(first, second, paired)
    note = pair_caveats(first, second, paired)
    if not (np.all(samples[1] > 0) or np.all(samples[1] < 0)):
        n = min(len(sample) for sample in samples)
        note = join_notes(note, "the divisor may be 0") if n else note
        return Interval(_NAN, _NAN, _NAN, n, note)
    return _interval(samples, lambda a, b, axis: a.mean(axis=axis) / b.mean(axis=axis), paired, note)


def _interval(samples: tuple[Float64, ...], statistic: Callable[..., Any], paired: bool, note: str) -> Interval:
    n = min(len(sample) for sample in samples)
    if n == 0:
        return Interval(_NAN, _NAN, _NAN, n, note)
    value = float(statistic(*samples, axis=0))
    if n < 2:
        return Interval(value, _NAN, _NAN, n, note)
    if not any(has_spread(sample) for sample in samples):
        return Interval(value, value, value, n, note)
    with warnings.catch_warnings(), np.errstate(divide="ignore", invalid="ignore"):
        warnings.simplefilter("ignore", stats.DegenerateDataWarning)  # all resamples give the same value
        result = stats.bootstrap(
            samples, statistic, paired=paired, n_resamples=RESAMPLES, confidence_level=CONFIDENCE, rng=SEED
        )
    low, high = map(float, result.confidence_interval)
    if np.isnan([low, high]).any():
        return Interval(value, _NAN, _NAN, n, join_notes(note, "all resamples are equal: no interval"))
    return Interval(value, low, high, n, note)
