"""Lesions along an axis: a place for each, in which columns of seeds stand beside the mean of fresh networks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from bilateral_rl.analysis.intervals import Interval, mean_interval
from bilateral_rl.analysis.results import FRESH, State, by_seed
from bilateral_rl.figures.labels import lesion_label
from bilateral_rl.figures.protocols import CONTROL_COLOR
from bilateral_rl.figures.seeds import draw_seeds
from bilateral_rl.figures.style import FAINT, INK, ModelStyle
from bilateral_rl.policies.lesions import INTACT, LESIONS

WIDTH = 0.84
"""Width of a lesion's place, of 1, that its columns share."""
_LEAST_PLACES = 4
"""Where there are fewer, they stand in the middle: a place too wide has its columns too far apart."""


class Column(NamedTuple):
    """What one column shows."""

    values: pd.Series
    """By seed."""
    control: float
    """Mean of fresh networks that were treated alike; NaN where there are none."""
    style: ModelStyle


def column_of(results: pd.DataFrame, metric: str, state: State, style: ModelStyle) -> Column:
    """Return a column of a metric of the networks in a state."""
    control = mean_interval(by_seed(results, metric, state.control)).value
    return Column(by_seed(results, metric, state), control, style)


def lesions_in(results: pd.DataFrame) -> list[str]:
    """Return the names of the lesions in a table of results in the order of figures, "intact" first."""
    present = set(results["lesion"])
    return [lesion for lesion in (INTACT, *LESIONS) if lesion in present]


def has_control(results: pd.DataFrame) -> bool:
    """Return whether a table of results has fresh networks."""
    return bool((results["network"] == FRESH).any())


def draw_places(axes: Axes, places: Sequence[Sequence[Column]]) -> list[Interval]:
    """Draw the columns of each place, lines between the places, and the limits along x.

    Returns:
        The means.
    """
    means = [mean for x, columns in enumerate(places) for mean in _draw_place(axes, x, columns)]
    middle, reach = (len(places) - 1) / 2, max(len(places), _LEAST_PLACES) / 2 + 0.05
    axes.set_xlim(middle - reach, middle + reach)
    for place in range(1, len(places)):
        axes.axvline(place - 0.5, color=FAINT, linewidth=0.6, zorder=0)
    return means


def label_places(axes: Axes, lesions: Sequence[str]) -> None:
    """Write the lesions below their places."""
    axes.set_xticks(range(len(lesions)), [lesion_label(lesion) for lesion in lesions])


def style_handle(style: ModelStyle) -> Line2D:
    """Return the mark of a column for a legend."""
    return Line2D(
        [], [], linestyle="", marker=style.marker, markersize=5.5, color=style.color, markeredgecolor=INK,
        markeredgewidth=0.7,
    )  # fmt: skip


def control_handle() -> tuple[Line2D, str]:
    """Return the line of fresh networks for a legend, and what it is called."""
    return Line2D([], [], color=CONTROL_COLOR, linewidth=1.5), "fresh networks, treated alike"


def _draw_place(axes: Axes, x: int, columns: Sequence[Column]) -> list[Interval]:
    """Draw the columns of one lesion side by side, and return the means."""
    if not any(column.values.notna().any() for column in columns):
        columns = columns[:1]  # one dash says it
    means, step = [], WIDTH / max(len(columns), 2)
    for i, column in enumerate(columns):
        center = x + step * (i - (len(columns) - 1) / 2)
        left, right = center - 0.45 * step, center + 0.45 * step
        axes.hlines(column.control, left, right, color=CONTROL_COLOR, linewidth=1.5, gid="control")
        means.append(draw_seeds(axes, center, column.values, column.style, width=0.62 * step, size=4.5))
    return means
