"""How many seeds a test needs, so that it finds the smallest effect of interest in four of five studies.

The standard deviation is not known but estimated from few seeds of an exploration; its upper confidence limit stands in
its place, so that a lucky exploration does not promise too much (Browne 1995, doi:10.1002/sim.4780141709).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from scipy import special, stats

from bilateral_rl.analysis.samples import Float64
from bilateral_rl.analysis.statistics import ALPHA

SMALLEST_EFFECT_OF_INTEREST = 0.10
"""Share of the mean, fixed before any seed of a confirmation was run [ours]."""

POWER = 0.80
"""Probability with which an effect of that size is to be found."""

SPREAD_CONFIDENCE = 0.80
"""Confidence of the upper limit that stands for the standard deviation (Browne 1995)."""

MOST_SEEDS = 50
"""A question that needs more seeds is called undecidable at this cost [ours]."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(200)
_FARTHEST = 1e-12
"""Probability that the quadrature leaves out on either side."""
_TABLE_DF = np.array([120.0, 60.0, 30.0, 20.0, 15.0, 12.0, 10.0, 8.0, 6.0, 5.0, 4.0, 3.0, 2.5, 2.0, 1.7, 1.4, 1.2, 1.0])


@dataclass(frozen=True)
class Spread:
    """The standard deviation of one value a seed, as an exploration has it."""

    sd: float
    n: int
    """Number of seeds; there is no limit of fewer than two."""

    @property
    def upper(self) -> float:
        """Upper one-sided 80 % confidence limit of the standard deviation, by χ²; NaN if there is none."""
        if self.n < 2:
            return math.nan
        df = self.n - 1
        return self.sd * math.sqrt(df / float(special.chdtri(df, SPREAD_CONFIDENCE)))


@dataclass(frozen=True)
class Design:
    """A t test whose number of seeds is to be chosen."""

    kind: Literal["direction", "equivalence"]
    """Two-sided for a difference from 0, found on the side where it is; or two one-sided tests at half of α each that
    there is none."""
    effect: float
    """The difference that is to be found; or the bound to either side, while there is no difference."""
    spreads: tuple[Spread, ...]
    """One of pairs' differences (or of one sample), or those of two independent samples."""
    comparisons: int = 1
    """Size of the family that Holm's procedure adjusts for; planned for is its strictest step."""
    groups: int = 0
    """Number of groups whose pairs Games and Howell's procedure compares; 0 if the test is a t test."""
    at_least: int = 2
    """Seeds without which the question is not decided, whatever the power."""

    def power(self, n: int) -> float:
        """Probability that ``n`` seeds (of each sample) show it; NaN if the spread is not known.

        Exact by the noncentral t distribution, or with both bounds by the like integral; of two samples with unequal
        spreads nearly so, with Welch's degrees of freedom.
        """
        variances = [spread.upper**2 for spread in self.spreads]
        error = math.sqrt(sum(variances) / n)
        if math.isnan(error) or math.isnan(self.effect):
            return math.nan
        if error == 0:
            return float(self.effect > 0)
        shares = [variance / sum(variances) for variance in variances]
        df = (n - 1) / sum(share**2 for share in shares)
        return _power(self.effect / error, self._critical(df), df, both=self.kind == "equivalence")

    def seeds(self) -> int | None:
        """Return the fewest seeds that reach :data:`POWER`; None if :data:`MOST_SEEDS` do not, or nobody can say."""
        if not self.power(MOST_SEEDS) >= POWER:
            return None
        low, high = 1, MOST_SEEDS
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if self.power(middle) >= POWER else (middle, high)
        return max(high, self.at_least)

    def _critical(self, df: float) -> float:
        if self.groups:
            return _games_howell_critical(self.groups, df)
        return float(stats.t.isf(ALPHA / 2 / self.comparisons, df))


def _games_howell_critical(groups: int, df: float) -> float:
    """The t beyond which a pair of ``groups`` differs significantly, its logarithm interpolated in 1 / df."""
    return math.exp(np.interp(1 / df, 1 / _TABLE_DF, _games_howell_table(groups)))


@lru_cache
def _games_howell_table(groups: int) -> Float64:
    """The logarithm of the same at the degrees of freedom of the table; each takes a tenth of a second."""
    return np.log([stats.studentized_range.isf(ALPHA, groups, df) / math.sqrt(2) for df in _TABLE_DF])


def _power(noncentrality: float, critical: float, df: float, both: bool) -> float:
    """P((z + noncentrality) / u > critical), u the estimated standard error over the true one; of both bounds at once.

    Integrated over u, a scaled χ: SciPy's noncentral t fails far out, and has no two bounds.
    """
    low, high = np.sqrt(special.chdtri(df, [1 - _FARTHEST, _FARTHEST]) / df)
    u = low + (high - low) * (_NODES + 1) / 2
    density = stats.chi.pdf(u * np.sqrt(df), df) * np.sqrt(df) * _WEIGHTS * (high - low) / 2
    # Within both bounds: the estimate lies between them by the critical value, if there is room between at all.
    inside = special.ndtr(noncentrality - critical * u)
    chance = np.maximum(2 * inside - 1, 0.0) if both else inside
    return float(min(chance @ density, 1.0))
