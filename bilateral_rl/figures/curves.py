"""Learning curves of models, over their seeds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter, LogLocator, MaxNLocator, NullFormatter, StrMethodFormatter

from bilateral_rl.analysis.intervals import mean_interval
from bilateral_rl.analysis.samples import Float64
from bilateral_rl.figures.hands import HAND_STYLES, hand_label
from bilateral_rl.figures.labels import axis_label, model_label
from bilateral_rl.figures.style import (
    ModelStyle,
    families,
    in_order,
    legend_above,
    model_style,
    new_figure,
    set_note,
    set_title,
    style_axes,
)


@dataclass(frozen=True)
class HistoryColumn:
    """A measure in a training's history, and how it is drawn."""

    name: str
    """Name of the column."""
    label: str
    """Words for the axis, without the unit."""
    unit: str = ""
    """Unit of the values; empty for pure numbers."""
    logarithmic: bool = False
    """Whether its axis is logarithmic."""


COMPLETION = HistoryColumn("goal_completion_percent", "Goal completion", "%")
TIME_IN_GOAL = HistoryColumn("time_in_goal_steps", "Time in goal", "steps")
FINAL_ERROR = HistoryColumn("final_error_cm", "Final error", "cm", logarithmic=True)
VALIDATION_LOSS = HistoryColumn("validation_loss", "Validation loss", logarithmic=True)
PREFERRED = {"goal_completion": COMPLETION, "time_in_goal": TIME_IN_GOAL}
"""What tasks are judged by (paper section 7), in a training's history."""

PROGRESS = {"epoch": "Epoch", "timesteps": "Environment steps"}
"""Columns that count how far a training has come, and their words for the axis."""


_PANEL_HEIGHT = 1.55
_MARGIN = 0.05


class _Line(NamedTuple):
    """Look and names of a line."""

    style: ModelStyle
    label: str
    gid: str


def _line_of(model: str) -> _Line:
    return _Line(model_style(model), model_label(model), model)


def learning_curves(
    epochs: pd.DataFrame, measures: Sequence[HistoryColumn], title: str, progress: str = "epoch"
) -> Figure:
    """Draw means over the seeds of models as they learn, a row of panels a measure, a column an architecture.

    A seed that has stopped keeps its weights, so its last value goes on into the mean: every curve ends at the mean of
    the networks that the training left. From where fewer than half of a model's seeds still train, the curve is thin.

    Args:
        epochs: a row for each model, seed and epoch, with columns ``model``, ``seed``, the one that ``progress`` names,
            and those of the measures.
        measures: what to draw, from the top.
        title: title of the figure, with the task.
        progress: the column along the x axis, one of ``PROGRESS``.
    """
    groups = families(epochs["model"])
    figure = new_figure(1.3 + _PANEL_HEIGHT * len(measures))
    grid = figure.subplots(len(measures), len(groups), sharex=True, sharey="row", squeeze=False)
    for i, (row, measure) in enumerate(zip(grid, measures, strict=True)):
        for j, (axes, models) in enumerate(zip(row, groups, strict=True)):
            for model in models:
                _curve(axes, epochs[epochs["model"] == model], measure.name, progress, _line_of(model))
            if measure.logarithmic:
                _set_logarithmic(axes)
            style_axes(axes, PROGRESS[progress] * (i == len(grid) - 1), axis_label(measure) * (j == 0))
            _count(axes)
        _limit(row[0], epochs[measure.name])
    for axes in grid[0]:
        legend_above(axes)
    set_title(figure, title)
    set_note(
        figure,
        "Mean over the seeds and its 95 % confidence interval; a stopped seed keeps its last value.\n"
        "Thin from the marker on, where fewer than half of the seeds still train.",
    )
    return figure


def draw_curves(axes: Axes, history: pd.DataFrame, measure: HistoryColumn) -> None:
    """Draw one measure of models as they learn into ``axes``, as a panel of :func:`learning_curves`, with a legend.

    Args:
        axes: where to draw.
        history: as for :func:`learning_curves`, with one of the columns of ``PROGRESS``.
        measure: what to draw.
    """
    lines = [
        (history[history["model"] == model], measure.name, _line_of(model)) for model in in_order(history["model"])
    ]
    _draw_lines(axes, lines, measure)


def draw_curves_of_hands(axes: Axes, history: pd.DataFrame, measure: HistoryColumn) -> None:
    """Draw one measure of one model of two arms as it learns, a line for each hand in each role that has it.

    Args:
        axes: where to draw.
        history: of one model, with the columns of :func:`columns_of_hands`.
        measure: what to draw.
    """
    lines = [
        (history, name, _Line(HAND_STYLES[of], hand_label(*of), "_".join(of)))
        for of, name in columns_of_hands(history, measure.name).items()
    ]
    _draw_lines(axes, lines, measure)


def columns_of_hands(history: pd.DataFrame, measure: str) -> dict[tuple[str, str], str]:
    """Return the columns that have a measure by hand and role, by both."""
    names = {of: f"{measure}_of_{'_'.join(of)}" for of in HAND_STYLES}
    return {of: name for of, name in names.items() if name in history and history[name].notna().any()}


def _draw_lines(axes: Axes, lines: Sequence[tuple[pd.DataFrame, str, _Line]], measure: HistoryColumn) -> None:
    """Draw lines, each with its rows and column, of one measure."""
    progress = next(name for name in PROGRESS if name in lines[0][0])
    for rows, name, line in lines:
        _curve(axes, rows, name, progress, line)
    if measure.logarithmic:
        _set_logarithmic(axes)
    style_axes(axes, PROGRESS[progress], axis_label(measure))
    _count(axes)
    _limit(axes, pd.concat([rows[name] for rows, name, _ in lines]))
    legend_above(axes, columns=2)


def carried_forward(rows: pd.DataFrame, measure: str, progress: str) -> pd.DataFrame:
    """Return the values of one model's seeds, a column each, at every point of progress.

    Each seed's last value is carried forward. Where a resumed training has a point twice, the later row counts.
    """
    rows = rows.drop_duplicates(["seed", progress], keep="last")
    return rows.pivot(index=progress, columns="seed", values=measure).sort_index().ffill()


def interval_over_seeds(values: pd.DataFrame) -> tuple[Float64, Float64, Float64, Float64]:
    """Return the points of progress (the index), and at each the mean over the columns and its interval's ends.

    All four arrays are (T,), of T points.
    """
    mean, low, high = np.array([(i.value, i.low, i.high) for i in map(mean_interval, values.to_numpy())]).T
    return values.index.to_numpy(dtype=np.float64), mean, low, high


def half_training(rows: pd.DataFrame, progress: str) -> float:
    """Return the last point of progress that at least half of one model's seeds reached."""
    last = rows.groupby("seed")[progress].max().sort_values(ascending=False)
    return float(last.iloc[math.ceil(len(last) / 2) - 1])


def _set_logarithmic(axes: Axes) -> None:
    """Make the y axis logarithmic, with plain numbers at its ticks even where it spans less than a decade."""
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _count(axes: Axes) -> None:
    """Let the x axis count: there is no half of an epoch, or of a step."""
    axes.xaxis.set_major_locator(MaxNLocator(nbins="auto", steps=[1, 2, 2.5, 5, 10], integer=True))
    axes.xaxis.set_major_formatter(EngFormatter())


def _limit(axes: Axes, values: pd.Series) -> None:
    """Show the range of the seeds' values: intervals of two or three seeds go far beyond it."""
    is_logarithmic = axes.get_yscale() == "log"
    drawn = values[np.isfinite(values) & ((values > 0) | (not is_logarithmic))]
    if drawn.nunique() < 2:
        return
    low, high = drawn.min(), drawn.max()
    if is_logarithmic:
        axes.set_ylim(low / (high / low) ** _MARGIN, high * (high / low) ** _MARGIN)
    else:
        axes.set_ylim(low - _MARGIN * (high - low), high + _MARGIN * (high - low))


def _curve(axes: Axes, rows: pd.DataFrame, measure: str, progress: str, line: _Line) -> None:
    style = line.style
    x, mean, low, high = interval_over_seeds(carried_forward(rows, measure, progress))
    until = int(np.searchsorted(x, half_training(rows, progress)))
    axes.fill_between(x, low, high, color=style.color, alpha=0.2, linewidth=0)
    axes.plot(
        x[: until + 1], mean[: until + 1], color=style.color, linestyle=style.line, linewidth=1.6,
        marker=style.marker, markersize=5, markevery=[until], markeredgecolor="white", markeredgewidth=0.5,
        label=line.label, gid=line.gid,
    )  # fmt: skip
    axes.plot(x[until:], mean[until:], color=style.color, linewidth=0.7, gid=f"{line.gid} tail")
