"""What a confirmation must be able to find, for each kind of component: the input of its power analysis.

The smallest effect of interest is a share of the mean, the same for all. A direction is planned for a difference of
that size; a range for a value in its middle; a bound for a value that lies beyond it by that size, or by as much as
equality does if that is nearer (a ratio that is to be at least 0.95 is planned for 1).
"""

from __future__ import annotations

import math

import numpy as np

from bilateral_rl.analysis.power import SMALLEST_EFFECT_OF_INTEREST, Design, Spread
from bilateral_rl.analysis.samples import Float64, finite, usable


def of_direction(
    first: Float64, second: Float64, mean: float, paired: bool, *, comparisons: int = 1, groups: int = 0, least: int = 2
) -> Design:
    """Plan for a difference of two means of ``mean``; the other arguments are those of :class:`Design`."""
    effect = SMALLEST_EFFECT_OF_INTEREST * mean
    return Design("direction", effect, _spreads(first, second, paired), comparisons, groups, least)


def of_mean(values: Float64, low: float, high: float) -> Design:
    """Plan for a mean within a range, or, if ``high`` is infinite, above a bound."""
    spreads = (_spread(finite(values)),)
    if math.isinf(high):
        return Design("direction", SMALLEST_EFFECT_OF_INTEREST * abs(float(finite(values).mean())), spreads)
    return Design("equivalence", (high - low) / 2, spreads)


def of_ratio(first: Float64, second: Float64, low: float, high: float, paired: bool) -> Design:
    """Plan for a ratio of two means within a range or beyond a bound, tested by first − bound · second."""
    bounds = [bound for bound in (low, high) if math.isfinite(bound)]
    candidates = [_spreads(first, bound * second, paired) for bound in bounds]
    spreads = max(candidates, key=lambda spreads: sum(spread.sd**2 for spread in spreads))
    mean = float(usable(first, second, paired)[1].mean())
    if len(bounds) == 2:
        return Design("equivalence", (high - low) / 2 * mean, spreads)
    return Design("direction", min(SMALLEST_EFFECT_OF_INTEREST, abs(1 - bounds[0])) * mean, spreads)


def _spreads(first: Float64, second: Float64, paired: bool) -> tuple[Spread, ...]:
    a, b = usable(first, second, paired)
    return (_spread(a - b),) if paired else (_spread(a), _spread(b))


def _spread(values: Float64) -> Spread:
    return Spread(float(np.std(values, ddof=1)) if len(values) > 1 else math.nan, len(values))
