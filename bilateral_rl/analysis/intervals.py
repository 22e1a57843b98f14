"""95 % intervals under the normal model, fit for the few seeds of a preview too: mean, difference, ratio, effect.

Verdicts use these and not the bootstrap, whose intervals are too narrow for few seeds: from three it covers a mean
about three times in four, because it cannot leave the range of the sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import special, stats
from scipy.optimize import brentq

from bilateral_rl.analysis.samples import (
    Float64,
    caveats,
    finite,
    has_spread,
    join_notes,
    pair_caveats,
    pair_has_spread,
    usable,
)

CONFIDENCE = 0.95
_TAIL = (1 - CONFIDENCE) / 2
_LARGE_T = 1_000.0
_NAN = float("nan")


@dataclass(frozen=True)
class Interval:
    """An estimate with its 95 % interval.

    The bounds are NaN if there are fewer than two seeds, both equal to the estimate if all values are equal, and
    infinite if the data exclude no value, as for a ratio whose divisor may be 0.
    """

    value: float
    low: float
    high: float
    n: int
    """Number of seeds in the smallest sample."""
    note: str = ""
    """What readers must know about the estimate."""


def mean_interval(values: ArrayLike) -> Interval:
    """Mean and its interval by Student's t."""
    x = finite(values)
    note = caveats(len(x), np.size(values) - len(x), has_spread(x))
    if len(x) < 2:
        return Interval(_mean(x), _NAN, _NAN, len(x), note)
    reach = float(stats.t.isf(_TAIL, len(x) - 1) * np.sqrt(squared_error(x))) if has_spread(x) else 0.0
    return Interval(_mean(x), _mean(x) - reach, _mean(x) + reach, len(x), note)


def difference_interval(first: ArrayLike, second: ArrayLike, paired: bool = False) -> Interval:
    """Difference of two means, first − second, and its interval.

    Args:
        first: (n,), one value a seed.
        second: (m,), the same.
        paired: whether the samples are of the same seeds, in the same order: then the interval is Student's t of the
            pairs' differences, otherwise Welch's t.
    """
    a, b = usable(first, second, paired)
    n, value, note = min(len(a), len(b)), _mean(a) - _mean(b), pair_caveats(first, second, paired)
    if n < 2:
        return Interval(value, _NAN, _NAN, n, note)
    if not pair_has_spread(a, b, paired):
        return Interval(value, value, value, n, note)
    df = n - 1 if paired else welch_df(a, b)
    error = np.sqrt(squared_error(a - b) if paired else squared_error(a) + squared_error(b))
    reach = float(stats.t.isf(_TAIL, df) * error)
    return Interval(value, value - reach, value + reach, n, note)


def ratio_interval(first: ArrayLike, second: ArrayLike, paired: bool = False) -> Interval:
    """Ratio of two means, first / second, and its interval after Fieller.

    The interval holds every ratio ρ at which mean(first) − ρ · mean(second) is not significantly different from 0;
    independent samples have Welch's degrees of freedom, taken at the estimate. The interval is unbounded where
    mean(second) itself is not significantly different from 0.

    Sources: Fieller 1954, doi:10.1111/j.2517-6161.1954.tb00159.x; for the degrees of freedom Tamhane & Logan 2004.
    """
    a, b = usable(first, second, paired)
    n, note = min(len(a), len(b)), pair_caveats(first, second, paired)
    value = _mean(a) / _mean(b) if n and _mean(b) != 0 else _NAN
    if n < 2:
        return Interval(value, _NAN, _NAN, n, note)
    if not np.isfinite(value):
        return Interval(_NAN, -np.inf, np.inf, n, join_notes(note, "the divisor is 0"))
    low, high = _fieller(a, b, value, paired)
    if not np.isfinite(low):
        note = join_notes(note, "the divisor is not clearly different from 0")
    return Interval(value, low, high, n, note)


def hedges_g(first: ArrayLike, second: ArrayLike, paired: bool = False) -> Interval:
    """Standardized difference first − second without the bias of small samples, and its exact interval.

    The unit is the pooled standard deviation of independent samples, or the standard deviation of the pairs'
    differences (d_z). The interval inverts the noncentral t distribution. NaN where nothing spreads, and for two
    pairs, from which no unbiased estimate can be made.

    Sources: Hedges 1981, doi:10.3102/10769986006002107; Steiger & Fouladi 1997, in What if there were no significance
    tests?, ch. 9.
    """
    a, b = usable(first, second, paired)
    n, note = min(len(a), len(b)), pair_caveats(first, second, paired)
    if n < 2 or not pair_has_spread(a, b, paired):
        return Interval(_NAN, _NAN, _NAN, n, note)
    if paired:
        df, scale, sd = n - 1, 1 / np.sqrt(n), np.std(a - b, ddof=1)
    else:
        df, scale = len(a) + len(b) - 2, np.sqrt(1 / len(a) + 1 / len(b))
        sd = np.sqrt((np.var(a) * len(a) + np.var(b) * len(b)) / df)
    if df < 2:
        return Interval(_NAN, _NAN, _NAN, n, note)
    t = (_mean(a) - _mean(b)) / float(sd * scale)
    low, high = _noncentrality_interval(t, df)
    unit = small_sample_correction(df) * float(scale)
    return Interval(unit * t, unit * low, unit * high, n, note)


def small_sample_correction(df: int) -> float:
    """Return J(df), the factor that removes the bias of a standardized difference; ``df`` is at least 2."""
    return float(np.exp(special.gammaln(df / 2) - special.gammaln((df - 1) / 2)) / np.sqrt(df / 2))


def welch_df(a: Float64, b: Float64) -> float:
    """Return the degrees of freedom of the difference of two means whose samples may differ in variance.

    Both samples, (n,) and (m,), hold two or more numbers. Source: Welch 1947, doi:10.1093/biomet/34.1-2.28.
    """
    first, second = squared_error(a), squared_error(b)
    # Shares, because squares of tiny errors underflow.
    share = first / (first + second)
    return float(1 / (share**2 / (len(a) - 1) + (1 - share) ** 2 / (len(b) - 1)))


def squared_error(values: Float64) -> float:
    """Return the square of the standard error of the mean of two or more numbers."""
    return float(values.var(ddof=1)) / len(values)


def _fieller(a: Float64, b: Float64, ratio: float, paired: bool) -> tuple[float, float]:
    """Return the roots ρ of (mean a − ρ mean b)² = t² · squared error of (mean a − ρ mean b).

    Over (mean b)², with r the ratio of the means, aa and bb t² times their squared errors and ab t² times their
    covariance, that is (r − ρ)² = aa − 2 ρ ab + ρ² bb, or (1 − bb) ρ² − 2 (r − ab) ρ + r² − aa = 0. From bb ≥ 1 on, the
    divisor may be 0, and no ρ is excluded on both sides.
    """
    if not pair_has_spread(a, ratio * b, paired):
        return ratio, ratio
    df = len(a) - 1 if paired else welch_df(a, ratio * b)
    scale = (float(stats.t.isf(_TAIL, df)) / b.mean()) ** 2
    aa, bb = scale * squared_error(a), scale * squared_error(b)
    ab = scale * float(np.cov(a, b)[0, 1]) / len(a) if paired else 0.0
    if bb >= 1:
        return -np.inf, np.inf
    center = (ratio - ab) / (1 - bb)
    square = (aa - 2 * ratio * ab + ratio**2 * bb) - (aa * bb - ab**2)
    reach = np.sqrt(max(square, 0.0)) / (1 - bb)
    return float(center - reach), float(center + reach)


def _noncentrality_interval(t: float, df: int) -> tuple[float, float]:
    """Return the noncentralities of the t distributions that have 97.5 % and 2.5 % below ``t``."""
    if t < 0:
        low, high = _noncentrality_interval(-t, df)
        return -high, -low
    if t > _LARGE_T:
        # (noncentrality + normal) / scaled chi: so far out the normal part no longer matters.
        return t * _scaled_chi(_TAIL, df), t * _scaled_chi(1 - _TAIL, df)
    # Each part at half the tail bounds both roots; brackets must be near, because SciPy's distribution fails far out.
    normal = float(special.ndtri(1 - _TAIL / 2))
    least, most = t * _scaled_chi(_TAIL / 2, df) - normal, t * _scaled_chi(1 - _TAIL / 2, df) + normal
    low, high = (float(brentq(_excess, least, most, args=(t, df, q))) for q in (1 - _TAIL, _TAIL))
    return low, high


def _excess(noncentrality: float, t: float, df: int, probability: float) -> float:
    return float(stats.nct.cdf(t, df, noncentrality)) - probability


def _scaled_chi(probability: float, df: int) -> float:
    """Return the quantile of √(χ² / df), by which a noncentral t variable is divided."""
    return float(np.sqrt(special.chdtri(df, 1 - probability) / df))


def _mean(values: Float64) -> float:
    return float(values.mean()) if len(values) else _NAN
