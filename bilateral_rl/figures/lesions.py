"""Effects of lesions on models, by what follows each lesion, beside fresh networks that were treated alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bilateral_rl.analysis.intervals import Interval, mean_interval
from bilateral_rl.analysis.results import FRESH, State, by_seed, protocol_words, protocols_in
from bilateral_rl.figures.labels import MetricLike, axis_label, lesion_label, model_label, task_label
from bilateral_rl.figures.protocols import CONTROL_COLOR, protocol_styles
from bilateral_rl.figures.seeds import draw_seeds, marks_in_words
from bilateral_rl.figures.style import (
    FAINT,
    INK,
    TEXT_SIZE,
    ModelStyle,
    new_figure,
    set_note,
    set_title_and_legend,
    style_axes,
)
from bilateral_rl.policies.lesions import INTACT, LESIONS

_PANEL_HEIGHT, _REST_HEIGHT, _LEGEND_LINE = 1.6, 1.25, 0.16
"""Heights (inches): of a panel, of what is above and below all, and of each protocol in the legend."""
_MOST_COLUMNS = 4
"""Most protocols that fit side by side; more go on in a panel below."""
_LEAST_PLACES = 4
"""Where there are fewer, they stand in the middle: a place too wide has its columns too far apart."""
_WIDTH = 0.84
"""Width of a lesion's place, of 1, that its columns share."""


def lesion_effects(
    results: pd.DataFrame,
    task: str,
    metric: MetricLike,
    models: Sequence[str],
    protocols: Sequence[str] | None = None,
) -> Figure:
    """Draw a metric after each lesion, protocols side by side, a panel a model or more where protocols are many.

    Lesions stand in the order of :data:`~bilateral_rl.policies.lesions.LESIONS`; one of which a model has no value, as
    the callosum's where there is none, shows a dash. A short line across a column is the mean of fresh networks that
    were treated alike, and a dashed line goes through the intact networks' mean.

    Args:
        results: table of :mod:`bilateral_rl.analysis.results`.
        task: which of its tasks.
        metric: what to draw.
        models: of which models, from the top.
        protocols: names of the protocols, from the left; None for all that the table has.
    """
    rows = results[(results["task"] == task) & (results["metric"] == metric.name) & results["model"].isin(list(models))]
    lesions = [lesion for lesion in (INTACT, *LESIONS) if lesion in set(rows["lesion"])]
    styles = protocol_styles(protocols_in(rows) if protocols is None else protocols)
    panels = [(model, part) for model in models for part in _parts([*styles])]
    first, has_control = next(iter(styles)), bool((rows["network"] == FRESH).any())
    figure = new_figure(_REST_HEIGHT + _PANEL_HEIGHT * len(panels) + _LEGEND_LINE * (len(styles) + has_control))
    all_axes = figure.subplots(len(panels), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    means: list[Interval] = []
    for axes, (model, part) in zip(all_axes, panels, strict=True):
        places = [[State(task, model, lesion, name) for name in part] for lesion in lesions]
        means += _draw_panel(axes, rows, metric, places, State(task, model, protocol=first), styles)
        style_axes(axes, y_label=axis_label(metric), title=model_label(model) if part[0] == first else "")
    all_axes[-1].set_xticks(range(len(lesions)), [lesion_label(lesion) for lesion in lesions])
    set_title_and_legend(figure, f"{task_label(task)}: lesions", *_legend(styles, has_control))
    dash = "" if all(mean.n for mean in means) else " –: no value."
    set_note(figure, f"{marks_in_words(means)}\nDashed line: mean of the intact network.{dash}")
    return figure


def draw_lesions(axes: Axes, results: pd.DataFrame, task: str, metric: MetricLike, model: str) -> None:
    """Draw a metric of one model after each lesion into ``axes``, as a panel of :func:`lesion_effects`, with a legend.

    Args:
        axes: where to draw; as wide as the lesions need.
        results: table of :mod:`bilateral_rl.analysis.results`.
        task: which of its tasks.
        metric: what to draw.
        model: of which of its models.
    """
    rows = results[(results["task"] == task) & (results["metric"] == metric.name) & (results["model"] == model)]
    lesions = [lesion for lesion in (INTACT, *LESIONS) if lesion in set(rows["lesion"])]
    styles = protocol_styles(protocols_in(rows))
    places = [[State(task, model, lesion, name) for name in styles] for lesion in lesions]
    _draw_panel(axes, rows, metric, places, State(task, model, protocol=next(iter(styles))), styles)
    style_axes(axes, y_label=axis_label(metric))
    axes.set_xticks(range(len(lesions)), [lesion_label(lesion) for lesion in lesions])
    handles, words = _legend(styles, bool((rows["network"] == FRESH).any()))
    axes.legend(handles, words, loc="lower center", bbox_to_anchor=(0.5, 1), fontsize=TEXT_SIZE, frameon=False)


def _parts(protocols: Sequence[str]) -> list[Sequence[str]]:
    """Split protocols evenly into as few panels as can hold them."""
    n = max(1, -(-len(protocols) // _MOST_COLUMNS))
    return [protocols[len(protocols) * i // n : len(protocols) * (i + 1) // n] for i in range(n)]


def _draw_panel(
    axes: Axes,
    rows: pd.DataFrame,
    metric: MetricLike,
    places: Sequence[Sequence[State]],
    intact: State,
    styles: Mapping[str, ModelStyle],
) -> list[Interval]:
    """Draw a place for each lesion, a column for each of its states; the line of the intact networks; the limits.

    Returns:
        The means.
    """
    means: list[Interval] = []
    for x, states in enumerate(places):
        means += _draw_place(axes, x, rows, metric, states, styles)
    mean = mean_interval(by_seed(rows, metric.name, intact)).value
    axes.axhline(mean, color=INK, linewidth=0.8, linestyle=(0, (5, 3)), gid="intact")
    middle, reach = (len(places) - 1) / 2, max(len(places), _LEAST_PLACES) / 2 + 0.05
    axes.set_xlim(middle - reach, middle + reach)
    for place in range(1, len(places)):
        axes.axvline(place - 0.5, color=FAINT, linewidth=0.6, zorder=0)
    return means


def _draw_place(
    axes: Axes,
    x: int,
    rows: pd.DataFrame,
    metric: MetricLike,
    states: Sequence[State],
    styles: Mapping[str, ModelStyle],
) -> list[Interval]:
    """Draw what follows one lesion, a column a protocol, and return the means."""
    values = {state: by_seed(rows, metric.name, state) for state in states}
    if not any(series.notna().any() for series in values.values()):
        states = states[:1]  # one dash says it
    means, step = [], _WIDTH / max(len(states), 2)
    for i, state in enumerate(states):
        center = x + step * (i - (len(states) - 1) / 2)
        control = mean_interval(by_seed(rows, metric.name, state.control)).value
        axes.hlines(
            control, center - 0.45 * step, center + 0.45 * step, color=CONTROL_COLOR, linewidth=1.5, gid="control"
        )
        style = styles[state.protocol]
        means.append(draw_seeds(axes, center, values[state], style, width=0.62 * step, size=4.5))
    return means


def _legend(styles: Mapping[str, ModelStyle], has_control: bool) -> tuple[list[Line2D], list[str]]:
    """Return the handles of protocols, and of their control, and what they are called."""
    handles = [
        Line2D([], [], linestyle="", marker=style.marker, markersize=5.5, color=style.color, markeredgecolor=INK,
               markeredgewidth=0.7)
        for style in styles.values()
    ]  # fmt: skip
    words = [protocol_words(name) for name in styles]
    if has_control:
        handles.append(Line2D([], [], color=CONTROL_COLOR, linewidth=1.5))
        words.append("fresh networks, treated alike")
    return handles, words
