"""Effects of lesions on models."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bilateral_rl.analysis.intervals import Interval, mean_interval
from bilateral_rl.analysis.results import State, by_seed, protocol_words, protocols_in
from bilateral_rl.figures.labels import MetricLike, axis_label, lesion_label, model_label, task_label
from bilateral_rl.figures.seeds import draw_seeds, marks_in_words
from bilateral_rl.figures.style import (
    marker_handle,
    model_style,
    new_figure,
    set_note,
    set_title_and_legend,
    style_axes,
)
from bilateral_rl.policies.lesions import INTACT, LESIONS

_PANEL_HEIGHT = 1.6
_SPREAD = 0.38
"""Distance of the first protocol's column from the last one's, in a lesion's place."""


def lesion_effects(results: pd.DataFrame, task: str, metric: MetricLike, models: Sequence[str]) -> Figure:
    """Draw a metric after each lesion, a column a protocol, a panel a model.

    Lesions stand in the order of :data:`~bilateral_rl.policies.lesions.LESIONS`; one of which a model has no value, as
    the callosum's where there is none, shows a dash. A dashed line goes through the intact network's mean.

    Args:
        results: table of :mod:`bilateral_rl.analysis.results`.
        task: which of its tasks.
        metric: what to draw.
        models: of which models, from the top.
    """
    rows = results[(results["task"] == task) & (results["metric"] == metric.name) & results["model"].isin(list(models))]
    lesions = [lesion for lesion in (INTACT, *LESIONS) if lesion in set(rows["lesion"])]
    protocols = protocols_in(rows)
    figure = new_figure(1.3 + _PANEL_HEIGHT * len(models))
    panels = figure.subplots(len(models), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    means: list[Interval] = []
    for axes, model in zip(panels, models, strict=True):
        states = [[State(task, model, lesion, protocol) for protocol in protocols] for lesion in lesions]
        means += _panel(axes, rows, metric, states)
        _draw_intact_mean(axes, rows, metric, State(task, model))
        style_axes(axes, y_label=axis_label(metric), title=model_label(model))
    panels[-1].set_xticks(range(len(lesions)), [lesion_label(lesion) for lesion in lesions])
    handles = [marker_handle("o", filled=protocol != "none") for protocol in protocols]
    set_title_and_legend(figure, f"{task_label(task)}: lesions", handles, [*map(protocol_words, protocols)])
    set_note(figure, f"{marks_in_words(means)}\nDashed line: mean of the intact network. –: no value.")
    return figure


def _panel(axes: Axes, rows: pd.DataFrame, metric: MetricLike, states: Sequence[Sequence[State]]) -> list[Interval]:
    """Draw the states of one model, a place a lesion."""
    means = []
    for x, of_lesion in enumerate(states):
        for i, state in enumerate(of_lesion):
            n = len(of_lesion)
            shift = _SPREAD * (i / (n - 1) - 0.5) if n > 1 else 0.0
            values = by_seed(rows, metric.name, state)
            style = model_style(state.model)._replace(marker="o")
            means.append(
                draw_seeds(axes, x + shift, values, style, width=0.52 / n, size=5, filled=state.protocol != "none")
            )
    axes.set_xlim(-0.55, len(states) - 0.45)
    return means


def _draw_intact_mean(axes: Axes, rows: pd.DataFrame, metric: MetricLike, intact: State) -> None:
    mean = mean_interval(by_seed(rows, metric.name, intact)).value
    axes.axhline(mean, color=model_style(intact.model).color, linewidth=0.8, linestyle=(0, (5, 3)), gid="intact")
