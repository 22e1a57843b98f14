"""Effects of lesions on models, by what follows each lesion, beside fresh networks that were treated alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bilateral_rl.analysis.intervals import Interval, mean_interval
from bilateral_rl.analysis.results import State, by_seed, protocol_words, protocols_in
from bilateral_rl.figures.labels import MetricLike, axis_label, model_label, task_label
from bilateral_rl.figures.lesion_places import (
    column_of,
    control_handle,
    draw_places,
    has_control,
    label_places,
    lesions_in,
    style_handle,
)
from bilateral_rl.figures.protocols import protocol_styles
from bilateral_rl.figures.seeds import marks_in_words
from bilateral_rl.figures.style import (
    INK,
    TEXT_SIZE,
    ModelStyle,
    new_figure,
    set_note,
    set_title_and_legend,
    style_axes,
)

_PANEL_HEIGHT, _REST_HEIGHT, _LEGEND_LINE = 1.6, 1.25, 0.16
"""Heights (inches): of a panel, of what is above and below all, and of each protocol in the legend."""
_NOTE_LINE = 0.2
"""Height (inches) of what the note says of two hands."""
_MOST_COLUMNS = 4
"""Most protocols that fit side by side; more go on in a panel below."""


def lesion_effects(
    results: pd.DataFrame,
    task: str,
    metric: MetricLike,
    models: Sequence[str],
    protocols: Sequence[str] | None = None,
    hands: str = "",
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
        hands: what the note says of two hands, of which a value is the mean; "" of one arm.
    """
    rows = results[(results["task"] == task) & (results["metric"] == metric.name) & results["model"].isin(list(models))]
    lesions = lesions_in(rows)
    styles = protocol_styles(protocols_in(rows) if protocols is None else protocols)
    panels = [(model, part) for model in models for part in _parts([*styles])]
    first, with_control = next(iter(styles)), has_control(rows)
    rest = _REST_HEIGHT + _NOTE_LINE * bool(hands) + _LEGEND_LINE * (len(styles) + with_control)
    figure = new_figure(rest + _PANEL_HEIGHT * len(panels))
    all_axes = figure.subplots(len(panels), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    means: list[Interval] = []
    for axes, (model, part) in zip(all_axes, panels, strict=True):
        places = [[State(task, model, lesion, name) for name in part] for lesion in lesions]
        means += _draw_panel(axes, rows, metric, places, State(task, model, protocol=first), styles)
        style_axes(axes, y_label=axis_label(metric), title=model_label(model) if part[0] == first else "")
    label_places(all_axes[-1], lesions)
    set_title_and_legend(figure, f"{task_label(task)}: lesions", *_legend(styles, with_control))
    dash = "" if all(mean.n for mean in means) else " –: no value."
    set_note(figure, f"{marks_in_words(means)}\nDashed line: mean of the intact network.{dash}\n{hands}")
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
    lesions = lesions_in(rows)
    styles = protocol_styles(protocols_in(rows))
    places = [[State(task, model, lesion, name) for name in styles] for lesion in lesions]
    _draw_panel(axes, rows, metric, places, State(task, model, protocol=next(iter(styles))), styles)
    style_axes(axes, y_label=axis_label(metric))
    label_places(axes, lesions)
    handles, words = _legend(styles, has_control(rows))
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
    """Draw a place for each lesion, a column for each of its states, and the line of the intact networks.

    Returns:
        The means.
    """
    columns = [[column_of(rows, metric.name, state, styles[state.protocol]) for state in states] for states in places]
    mean = mean_interval(by_seed(rows, metric.name, intact)).value
    axes.axhline(mean, color=INK, linewidth=0.8, linestyle=(0, (5, 3)), gid="intact")
    return draw_places(axes, columns)


def _legend(styles: Mapping[str, ModelStyle], with_control: bool) -> tuple[list[Line2D], list[str]]:
    """Return the handles of protocols, and of their control, and what they are called."""
    handles, words = [style_handle(style) for style in styles.values()], [protocol_words(name) for name in styles]
    if with_control:
        handle, word = control_handle()
        handles.append(handle)
        words.append(word)
    return handles, words
