"""How far the hemispheres of models have specialized."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd
from matplotlib.figure import Figure

from bilateral_rl.analysis.results import State, protocol_words
from bilateral_rl.analysis.specialization import specialization_by_seed
from bilateral_rl.figures.labels import MetricLike, model_label, task_label
from bilateral_rl.figures.seeds import draw_seeds, marks_in_words
from bilateral_rl.figures.style import (
    INK,
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

    The index is that of :func:`bilateral_rl.analysis.specialization.specialization_index`.

    Args:
        results: table of :mod:`bilateral_rl.analysis.results`.
        metrics: the metric of each task, one where more is better, by the task's name; at most four tasks.
        models: of which models; those without hemispheres show a dash.
        protocol: name of the protocol that followed the lesions.
    """
    figure = new_figure(3.6)
    axes = figure.subplots()
    order, means = in_order(models), []
    for (task, metric), mark, shift in zip(metrics.items(), _TASK_MARKERS, _shifts(len(metrics)), strict=False):
        for x, model in enumerate(order):
            index = specialization_by_seed(results, metric.name, State(task, model, protocol=protocol))
            style, width = model_style(model)._replace(marker=mark[0]), 0.5 / len(metrics)
            means.append(draw_seeds(axes, x + shift, index, style, width=width, filled=mark[1]))
    axes.axhline(0, color=INK, linewidth=0.8)
    style_axes(axes, y_label="Specialization index\n← non-dominant · dominant →")
    axes.set_xticks(range(len(order)), [model_label(model) for model in order])
    axes.set_xlim(-0.6, len(order) - 0.4)
    words = [f"{task_label(task)}: {metric.label}" for task, metric in metrics.items()]
    handles = [marker_handle(*mark) for mark in _TASK_MARKERS[: len(words)]]
    set_title_and_legend(figure, f"Specialization of the hemispheres, {protocol_words(protocol)}", handles, words)
    meaning = "(d − n) / (d + n); d, n: value with only the dominant, only the non-dominant hemisphere."
    set_note(figure, f"{meaning}\n{marks_in_words(means)}")
    return figure


def _shifts(n: int) -> list[float]:
    """Return the distances of the columns of ``n`` tasks from the middle of a model's place."""
    return [0.7 * ((i + 0.5) / n - 0.5) for i in range(n)]
