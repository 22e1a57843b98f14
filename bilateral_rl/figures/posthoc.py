"""Matrices of pairwise tests."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd
import seaborn
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from bilateral_rl.analysis.formats import decimals_for, fixed, p_equation
from bilateral_rl.analysis.samples import Float64
from bilateral_rl.figures.labels import MetricLike, model_label, with_unit
from bilateral_rl.figures.style import LABEL_SIZE, TEXT_SIZE, in_order, new_figure, set_note, set_title

STARS = ((0.001, "***"), (0.01, "**"), (0.05, "*"))
"""Marks of p values below a bound, the smallest first."""

_COLORS = ("#7fb5dd", "#a9d1ec", "#dcebf7", "#f7f7f7", "#fde3cf", "#fbc08d", "#f59a50")
"""Row lower with three stars to one, not significant, row higher with one star to three; as light on either side."""

_CELL_HEIGHT = 0.55


def posthoc_matrix(pairs: pd.DataFrame, p_column: str, metric: MetricLike, title: str) -> Figure:
    """Draw the difference of means and the p value of every pair of models, row minus column.

    The more significant, the darker the cell: orange where the row is higher, blue with a hatched edge where it is
    lower.

    Args:
        pairs: columns ``first`` and ``second`` (models), ``difference`` of their means (first − second, in the metric's
            unit) and p values, as those of :func:`bilateral_rl.analysis.comparison.compare`; each pair once, in either
            direction. A pair that is missing or has no p value shows a dash.
        p_column: name of the column of p values.
        metric: what was compared.
        title: says the task and the test.

    Raises:
        ValueError: no pair at all.
    """
    order = in_order([*pairs["first"], *pairs["second"]])
    if not order:
        raise ValueError("a matrix of pairwise tests needs a pair of models.")
    difference, p = _square(pairs, p_column, order)
    figure = new_figure(1.1 + _CELL_HEIGHT * max(len(order) - 1, 2))
    axes = figure.subplots()
    _draw(axes, difference, p)
    axes.set_xticklabels([model_label(name) for name in order[:-1]])
    axes.set_yticklabels([model_label(name) for name in order[1:]])
    axes.tick_params(labelsize=LABEL_SIZE, length=0, rotation=0)
    set_title(figure, title)
    meaning = f"{with_unit(metric)}: mean of the row minus mean of the column, and p value."
    bounds = ", ".join(f"{stars} p < {bound}" for bound, stars in reversed(STARS))
    set_note(figure, f"{meaning}\n{bounds}. Orange: row higher. Blue, hatched edge: row lower.")
    return figure


def stars_of(p: float) -> str:
    """Return the mark of a p value, empty if it is NaN or not significant."""
    return next((stars for bound, stars in STARS if p < bound), "")


def _square(pairs: pd.DataFrame, p_column: str, order: Sequence[str]) -> tuple[Float64, Float64]:
    """Return differences, row minus column, and p values, (m − 1, m − 1) each of m models in order.

    Rows are the models from the second on, columns those up to the last but one.
    """
    difference, p = np.full((2, len(order), len(order)), math.nan)
    indices = [[order.index(name) for name in pairs[column]] for column in ("first", "second")]
    for a, b, d, p_value in zip(*indices, pairs["difference"], pairs[p_column], strict=True):
        difference[a, b], difference[b, a] = d, -d
        p[a, b] = p[b, a] = p_value
    return difference[1:, :-1], p[1:, :-1]


def _draw(axes: Axes, difference: Float64, p: Float64) -> None:
    """Draw the cells on and below the diagonal."""
    levels = _levels(difference, p)
    seaborn.heatmap(
        levels,
        mask=np.triu(np.ones_like(levels, dtype=np.bool_), k=1),
        annot=np.vectorize(_cell_text)(difference, p, _decimals(difference)),
        fmt="",
        cmap=ListedColormap(_COLORS),
        vmin=-len(STARS) - 0.5,
        vmax=len(STARS) + 0.5,
        cbar=False,
        linewidths=2,
        linecolor="white",
        annot_kws={"size": TEXT_SIZE, "color": "black"},
        ax=axes,
    )
    for row, column in zip(*np.nonzero(np.tril(levels < 0)), strict=True):
        axes.add_patch(Rectangle((column, row), 0.13, 1, fill=False, hatch="////", edgecolor="white", linewidth=0))
    axes.set_aspect(_CELL_HEIGHT / 0.85)


def _levels(difference: Float64, p: Float64) -> Float64:
    """Return the number of stars with the sign of the difference; 0 where there is no test."""
    n_stars = np.sum([p < bound for bound, _ in STARS], axis=0)
    return np.asarray(np.nan_to_num(np.sign(difference)) * n_stars)


def _decimals(difference: Float64) -> int:
    """Return how many decimals give the largest difference three digits."""
    return decimals_for(np.nanmax(np.abs(difference), initial=0), 3)


def _cell_text(difference: float, p: float, decimals: int) -> str:
    if math.isnan(p) or math.isnan(difference):
        return "–"
    return f"{fixed(difference, decimals, '+')} {stars_of(p)}".replace("-", "−").strip() + f"\n{p_equation(p)}"
