"""Comparison of models on a task."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bilateral_rl.analysis.intervals import Interval
from bilateral_rl.analysis.results import State, as_trained, by_seed
from bilateral_rl.figures.labels import MetricLike, axis_label, model_label, task_label
from bilateral_rl.figures.seeds import draw_seeds, marks_in_words
from bilateral_rl.figures.style import in_order, model_style, new_figure, set_note, set_title, style_axes
from bilateral_rl.policies.lesions import INTACT

_PANEL_HEIGHT = 1.75


def model_comparison(results: pd.DataFrame, task: str, metrics: Sequence[MetricLike]) -> Figure:
    """Draw the intact models of a study side by side, a panel a metric.

    Args:
        results: table of :mod:`bilateral_rl.analysis.results`.
        task: which of its tasks; every model that has intact values of it is drawn.
        metrics: what to draw, from the top.
    """
    rows = results[(results["task"] == task) & (results["lesion"] == INTACT) & as_trained(results)]
    models = in_order(rows["model"])
    figure = new_figure(0.85 + _PANEL_HEIGHT * len(metrics))
    panels = figure.subplots(len(metrics), 1, sharex=True, squeeze=False)[:, 0]
    means = [mean for axes, metric in zip(panels, metrics, strict=True) for mean in _panel(axes, rows, task, metric)]
    panels[-1].set_xticks(range(len(models)), [model_label(name) for name in models])
    set_title(figure, f"{task_label(task)}: models compared")
    set_note(figure, marks_in_words(means))
    return figure


def _panel(axes: Axes, rows: pd.DataFrame, task: str, metric: MetricLike) -> list[Interval]:
    means = []
    for x, name in enumerate(in_order(rows["model"])):
        values = by_seed(rows, metric.name, State(task, name))
        means.append(draw_seeds(axes, x, values, model_style(name), width=0.5))
    style_axes(axes, y_label=axis_label(metric))
    axes.set_xlim(-0.6, len(means) - 0.4)
    return means
