"""Numbers of studies as text, the same in every table."""

from __future__ import annotations

import math

import pandas as pd

_MOST_DECIMALS = 6


def spread(values: pd.Series) -> str:
    """Mean ± standard deviation of the values that are numbers, both to the deviation's second significant digit."""
    numbers = values.dropna()
    if numbers.empty:
        return "–"
    mean = float(numbers.mean())
    if len(numbers) == 1:
        return f"{mean:.3g}" if abs(mean) < 100 else f"{mean:.1f}"
    deviation = float(numbers.std(ddof=1))
    if not deviation > 0:
        return f"{mean:.4g} ± 0"
    decimals = min(max(1 - math.floor(math.log10(deviation)), 0), _MOST_DECIMALS)
    return f"{mean:z.{decimals}f} ± {deviation:.{decimals}f}"


def number(value: float, form: str = ".3g") -> str:
    """``value`` by a format specification; a dash if it is none."""
    return "–" if math.isnan(value) else format(value, form)


def p_text(p: float) -> str:
    """A p-value to three decimals; a dash where there was no test."""
    return "< 0.001" if p < 0.001 else number(p, ".3f")
