"""Numbers of studies as text, the same in every table, figure and report: a dash stands for a number that is missing.

``sign`` is "+" where positive numbers carry their sign too, as differences do.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from bilateral_rl.analysis.samples import finite

if TYPE_CHECKING:  # SciPy's statistics, half a second, which a table of one run does without
    from bilateral_rl.analysis.statistics import OmnibusTest

_MOST_DECIMALS = 6
_SMALLEST_P = 0.001


def number(value: float, sign: str = "") -> str:
    """Write a number in three significant digits, from 100 on to one decimal."""
    return "–" if math.isnan(value) else f"{value:{sign}{'.3g' if abs(value) < 100 else '.1f'}}"


def fixed(value: float, decimals: int, sign: str = "") -> str:
    """Write a number to so many decimals."""
    return "–" if math.isnan(value) else f"{value:{sign}z.{decimals}f}"


def decimals_for(size: float, digits: int) -> int:
    """Return how many decimals, 0 to 6, show a number as large as ``size`` in ``digits`` significant digits."""
    return min(max(digits - 1 - math.floor(math.log10(size)), 0), _MOST_DECIMALS) if size > 0 else 0


def mean_sd(values: ArrayLike, decimals: int | None = None, sign: str = "") -> str:
    """Write mean ± standard deviation of the finite values, and of how many seeds they are if not of all.

    Args:
        values: (n,), one a seed; NaN where a seed has none.
        decimals: of both numbers; None for those that show the deviation in two significant digits.
        sign: "+" for a mean that carries its sign, "" otherwise.
    """
    numbers, n = finite(values), np.size(values)
    if not len(numbers):
        return "–"
    mean, deviation = float(numbers.mean()), float(numbers.std(ddof=1)) if len(numbers) > 1 else math.nan
    if decimals is not None:
        text = fixed(mean, decimals, sign)
        text += f" ± {fixed(deviation, decimals)}" if len(numbers) > 1 else ""
    elif len(numbers) == 1:
        text = number(mean, sign)
    elif deviation > 0:
        decimals = decimals_for(deviation, 2)
        text = f"{fixed(mean, decimals, sign)} ± {fixed(deviation, decimals)}"
    else:
        text = f"{mean:{sign}.4g} ± 0"
    return text if len(numbers) == n else f"{text} ({len(numbers)} of {n} seeds)"


def p_value(p: float) -> str:
    """Write a p-value to three decimals, for a column of them."""
    return f"< {_SMALLEST_P}" if p < _SMALLEST_P else fixed(p, 3)


def p_equation(p: float) -> str:
    """Write a p-value for running text: "p = 0.012", "p < 0.001" or "no test"."""
    if math.isnan(p):
        return "no test"
    return f"p {p_value(p)}" if p < _SMALLEST_P else f"p = {p_value(p)}"


def f_statistic(test: OmnibusTest) -> str:
    """Write the statistic of an analysis of variance with its degrees of freedom: "F(6, 63) = 4.20"."""
    return f"F({', '.join(f'{value:.4g}' for value in test.df)}) = {test.statistic:.2f}"
