"""Two one-sided t tests: whether a ratio of means lies within bounds, so that absence of a difference can be shown.

Each bound is tested for itself, that the ratio lies on the inner side of it, at half of α: the same certainty as a 95 %
interval that lies between the bounds, and no adjustment is due, because both must be shown (Schuirmann 1987,
doi:10.1007/BF01068419). A ratio is tested as Fieller's interval is made, by mean(first) − bound · mean(second) against
0; :func:`~bilateral_rl.analysis.intervals.ratio_interval` of the same pairs lies between the bounds just where the
test is significant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from bilateral_rl.analysis.intervals import squared_error, welch_df
from bilateral_rl.analysis.samples import Float64, caveats, count_left_out, pair_has_spread, usable
from bilateral_rl.analysis.statistics import ALPHA

EACH_SIDE = ALPHA / 2
"""Significance level of each of the two tests."""
_NAN = float("nan")


@dataclass(frozen=True)
class EquivalenceTest:
    """Two one-sided tests, of a quantity against a lower and an upper bound."""

    name: str
    p_low: float
    """p-value of the lower bound: small if the quantity lies above it."""
    p_high: float
    """p-value of the upper bound: small if the quantity lies below it."""
    note: str = ""

    @property
    def p(self) -> float:
        """The greater of both p-values: below :data:`EACH_SIDE`, the quantity is shown to lie between the bounds."""
        return max(self.p_low, self.p_high, key=lambda p: np.inf if np.isnan(p) else p)


def equivalence_test(
    first: ArrayLike, second: ArrayLike, low: float, high: float, paired: bool = False
) -> EquivalenceTest:
    """Test whether the ratio of two means, first / second, lies between ``low`` and ``high``.

    To test whether a difference is at most a share of a mean, let ``first`` be the differences.

    Args:
        first: (n,), one value a seed.
        second: (m,), the same; its mean is that of something positive.
        low: the lower bound.
        high: the upper bound.
        paired: whether the samples are of the same seeds, in the same order: then the tests are Student's of the
            pairs, otherwise Welch's.

    Returns:
        The test; its p-values are NaN where there are fewer than two seeds or nothing spreads.
    """
    a, b = usable(first, second, paired)
    n = min(len(a), len(b))
    name = f"two one-sided {'paired' if paired else 'Welch'} t tests"
    p_low = _p_greater(a, low * b, paired) if n > 1 else _NAN
    p_high = _p_greater(high * b, a, paired) if n > 1 else _NAN
    note = caveats(n, count_left_out(first, second, paired), varied=not np.isnan(p_low + p_high))
    return EquivalenceTest(name, p_low, p_high, note)


def _p_greater(a: Float64, b: Float64, paired: bool) -> float:
    """One-sided p-value of mean a > mean b; NaN where nothing spreads."""
    if not pair_has_spread(a, b, paired):
        return _NAN
    error = squared_error(a - b) if paired else squared_error(a) + squared_error(b)
    df = len(a) - 1 if paired else welch_df(a, b)
    return float(stats.t.sf((a.mean() - b.mean()) / np.sqrt(error), df))
