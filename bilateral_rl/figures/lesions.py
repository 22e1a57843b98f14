"""What lesions do to models."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bilateral_rl.analysis.intervals import Interval, mean_interval
from bilateral_rl.analysis.results import by_seed
from bilateral_rl.figures.labels import MetricLike, axis_label, lesion_label, model_label, task_label
from bilateral_rl.figures.seeds import draw_seeds, marks_in_words
from bilateral_rl.figures.style import dress, marker_handle, model_style, new_figure, set_note, set_title_and_legend
from bilateral_rl.policies.lesions import INTACT, LESIONS

_PANEL_HEIGHT = 1.6
_SHIFT = 0.19
"""Of the columns without and with retraining from the middle of a state's place."""
_CONDITIONS = {False: "without retraining", True: "with one epoch of retraining"}


def lesion_effects(results: pd.DataFrame, task: str, metric: MetricLike, models: Sequence[str]) -> Figure:
    """A metric after each lesion, without and with the epoch of retraining if there was one, a panel a model.

    States stand in the order of :data:`~bilateral_rl.policies.lesions.LESIONS`; one that a model has no value of, as
    the callosum's where there is none, shows a dash. A dashed line goes through the intact network's mean.

    Args:
        results: table of :mod:`bilateral_rl.analysis.results`.
        task: which of its tasks.
        metric: what to draw.
        models: of which models, from the top.
    """
    rows = results[(results["task"] == task) & (results["metric"] == metric.name) & results["model"].isin(list(models))]
    present = set(rows["lesion"])
    states = [state for state in (INTACT, *LESIONS) if state in present]
    conditions = [condition for condition in _CONDITIONS if (rows["retrained"] == condition).any()]
    figure = new_figure(1.3 + _PANEL_HEIGHT * len(models))
    panels = figure.subplots(len(models), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    means: list[Interval] = []
    for axes, model in zip(panels, models, strict=True):
        means += _panel(axes, rows, task, metric, model, states, conditions)
    panels[-1].set_xticks(range(len(states)), [lesion_label(state) for state in states])
    handles = [marker_handle("o", filled=condition) for condition in conditions]
    set_title_and_legend(figure, f"{task_label(task)}: lesions", handles, [_CONDITIONS[c] for c in conditions])
    set_note(figure, f"{marks_in_words(means)}\nDashed line: mean of the intact network. –: no value.")
    return figure


def _panel(
    axes: Axes,
    rows: pd.DataFrame,
    task: str,
    metric: MetricLike,
    model: str,
    states: Sequence[str],
    conditions: Sequence[bool],
) -> list[Interval]:
    style = model_style(model)._replace(marker="o")
    intact = mean_interval(by_seed(rows, metric.name, task, model))
    axes.axhline(intact.value, color=style.color, linewidth=0.8, linestyle=(0, (5, 3)), gid="intact")
    means = []
    for x, state in enumerate(states):
        for retrained in conditions:
            shift = (_SHIFT if retrained else -_SHIFT) * (len(conditions) > 1)
            values = by_seed(rows, metric.name, task, model, state, retrained)
            means.append(draw_seeds(axes, x + shift, values, style, width=0.26, size=5, filled=retrained))
    dress(axes, y_label=axis_label(metric), title=model_label(model))
    axes.set_xlim(-0.55, len(states) - 0.45)
    return means
