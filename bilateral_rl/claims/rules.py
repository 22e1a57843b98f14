"""From an estimate and a test to a verdict.

Intervals are those of each comparison by itself; p-values are adjusted for the comparisons of their family. A claim
needs all its components, so no adjustment beyond that of the families is due.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Literal

from bilateral_rl.analysis.equivalence import EACH_SIDE
from bilateral_rl.analysis.intervals import Interval
from bilateral_rl.analysis.statistics import ALPHA
from bilateral_rl.claims.margins import PAPER_SEEDS

Verdict = Literal["supported", "not supported", "undecided"]


def is_greater(difference: Interval, p: float, matters: float) -> Verdict:
    """Decide whether one mean is greater than another.

    Supported if significantly so. Not supported if significantly less, or if the interval of the difference lies
    below the smallest difference that ``matters``. NaN, where nothing could be tested or estimated, decides nothing.
    """
    if p < ALPHA:
        return "supported" if difference.value > 0 else "not supported"
    return "not supported" if difference.high < matters else "undecided"


def is_not_conclusively_greater(difference: Interval, p: float, matters: float) -> Verdict:
    """Decide whether a study such as the paper's would not find one mean greater than another.

    Not supported if it is significantly greater. Supported if the interval excludes a difference that ``matters``, or
    if as many seeds as the paper's show no significant one.
    """
    if p < ALPHA and difference.value > 0:
        return "not supported"
    if difference.high < matters or (difference.n >= PAPER_SEEDS and p >= 0):
        return "supported"
    return "undecided"


def is_within(estimate: Interval, low: float, high: float) -> Verdict:
    """Decide whether a quantity lies within a range: supported if its interval does, not if that lies outside."""
    if low <= estimate.low and estimate.high <= high:
        return "supported"
    return "not supported" if estimate.high < low or estimate.low > high else "undecided"


def is_equivalent(estimate: Interval, p: float, low: float, high: float) -> Verdict:
    """Decide by two one-sided tests whether a quantity lies within a range.

    Supported if both tests are significant at half of α, which the 95 % interval then shows too; not supported if
    either is significant the other way. NaN, where nothing spreads, leaves the decision to the interval.
    """
    tested = math.isnan(p) or p < EACH_SIDE or p > 1 - EACH_SIDE
    return is_within(estimate, low, high) if tested else "undecided"


def all_of(verdicts: Iterable[Verdict]) -> Verdict:
    """Combine verdicts: supported if all are, not supported if any is not, otherwise (and of none) undecided."""
    different = set(verdicts)
    if "not supported" in different:
        return "not supported"
    return "supported" if different == {"supported"} else "undecided"
