"""Effects of components on one scale: how far an estimate lies on the claim's side, as a share of the mean.

Components have their own units and their own lines: a difference is to be above 0, a ratio at least 0.95, a mean
between 94.7 and 98.7 %. On this scale the line is 0, the claim's side is positive, and 0.1 is a tenth of the mean of
what is compared, or of the lower bound where a mean is compared with numbers.
"""

from __future__ import annotations

import math
from dataclasses import replace

from bilateral_rl.analysis.intervals import Interval


def from_line(difference: Interval, mean: float, sign: int = 1) -> Interval:
    """Effect of a difference that should be above 0, or with ``sign`` −1 should not, as a share of ``mean``."""
    if not mean:
        return _scaled(difference, math.nan, math.nan, math.nan)
    ends = sign * difference.low / mean, sign * difference.high / mean
    return _scaled(difference, sign * difference.value / mean, *(ends if sign > 0 else reversed(ends)))


def inside(estimate: Interval, low: float, high: float, whole: float = 1.0) -> Interval:
    """Effect of a quantity that should lie between ``low`` and ``high``, as a share of ``whole``.

    It is the distance to the nearer of both bounds, either of which may be infinite. Its interval holds the distances
    of all values in the estimate's interval: it is above 0 just where that lies between the bounds, and below where
    that lies outside.
    """

    def depth(x: float) -> float:
        return min(distance for distance, bound in ((x - low, low), (high - x, high)) if math.isfinite(bound))

    ends = depth(estimate.low), depth(estimate.high)
    middle = (low + high) / 2
    holds_middle = math.isfinite(middle) and estimate.low <= middle <= estimate.high
    deepest = depth(middle) if holds_middle else max(ends)
    if not whole:
        return _scaled(estimate, math.nan, math.nan, math.nan)
    return _scaled(estimate, depth(estimate.value) / whole, min(ends) / whole, deepest / whole)


def _scaled(estimate: Interval, value: float, low: float, high: float) -> Interval:
    return replace(estimate, value=value, low=low, high=high)
