"""How far the hemispheres of models have specialized."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text

from bilateral_rl.analysis.floor import AT_FLOOR, at_floor
from bilateral_rl.analysis.intervals import Interval
from bilateral_rl.analysis.results import State, protocol_words
from bilateral_rl.analysis.specialization import specialization_by_seed
from bilateral_rl.figures.labels import MetricLike, model_label, task_label
from bilateral_rl.figures.seeds import draw_seeds, marks_in_words
from bilateral_rl.figures.style import (
    INK,
    NOTE_SIZE,
    in_order,
    marker_handle,
    model_style,
    new_figure,
    set_note,
    set_title_and_legend,
    style_axes,
)

_TASK_MARKERS = (("o", True), ("s", False), ("^", True), ("D", False))
"""Marker of each task, and whether it is filled."""


def specialization(
    results: pd.DataFrame, metrics: Mapping[str, MetricLike], models: Sequence[str], protocol: str = "none"
) -> Figure:
    """Draw how much better the dominant hemisphere of each model works alone than the other one, tasks side by side.

    The index is that of :func:`bilateral_rl.analysis.specialization.specialization_index`. Where neither hemisphere
    does better than in a fresh network that was treated alike, it means nothing, and the figure says "at the floor".

    Args:
        results: table of :mod:`bilateral_rl.analysis.results`.
        metrics: the metric of each task, one where more is better, by the task's name; at most four tasks.
        models: of which models; those without hemispheres show a dash.
        protocol: name of the protocol that followed the lesions.
    """
    figure = new_figure(3.6)
    axes = figure.subplots()
    order = in_order(models)
    means: list[Interval] = []
    floors: list[Text] = []
    for (task, metric), mark, shift in zip(metrics.items(), _TASK_MARKERS, _shifts(len(metrics)), strict=False):
        for x, model in enumerate(order):
            state = State(task, model, protocol=protocol)
            if at_floor(results, metric.name, state):
                floors.append(_draw_floor(axes, x + shift))
                continue
            index = specialization_by_seed(results, metric.name, state)
            style, width = model_style(model)._replace(marker=mark[0]), 0.5 / len(metrics)
            means.append(draw_seeds(axes, x + shift, index, style, width=width, filled=mark[1]))
    if not any(mean.n for mean in means):
        axes.set_ylim(-1, 1)
    axes.axhline(0, color=INK, linewidth=0.8)
    style_axes(axes, y_label="Specialization index\n← non-dominant · dominant →")
    axes.set_xticks(range(len(order)), [model_label(model) for model in order])
    axes.set_xlim(-0.6, len(order) - 0.4)
    words = [f"{task_label(task)}: {metric.label}" for task, metric in metrics.items()]
    handles = [marker_handle(*mark) for mark in _TASK_MARKERS[: len(words)]]
    set_title_and_legend(figure, f"Specialization of the hemispheres, {protocol_words(protocol)}", handles, words)
    meaning = "(d − n) / (d + n); d, n: value with only the dominant, only the non-dominant hemisphere."
    floor = "At the floor: both are no better than those of fresh networks that were treated alike."
    set_note(figure, "\n".join([meaning, *([marks_in_words(means)] if means else []), *([floor] if floors else [])]))
    return figure


def _draw_floor(axes: Axes, x: float) -> Text:
    return axes.text(
        x, 0.03, AT_FLOOR, transform=axes.get_xaxis_transform(), rotation=90, ha="center", va="bottom",
        size=NOTE_SIZE, color="0.4", gid="floor",
    )  # fmt: skip


def _shifts(n: int) -> list[float]:
    """Return the distances of the columns of ``n`` tasks from the middle of a model's place."""
    return [0.7 * ((i + 0.5) / n - 0.5) for i in range(n)]
