"""Two hands side by side: what each does in each role, how much better each is in its own, and arms after lesions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from bilateral_rl.analysis.intervals import Interval
from bilateral_rl.figures.hands import hand_label
from bilateral_rl.figures.labels import MetricLike, axis_label, model_label
from bilateral_rl.figures.seeds import draw_seeds, marks_in_words
from bilateral_rl.figures.style import (
    INK,
    ModelStyle,
    in_order,
    marker_handle,
    model_style,
    new_figure,
    set_note,
    set_title_and_legend,
    style_axes,
)
from bilateral_rl.vocabulary import SIDES, Side

_PANEL_HEIGHT, _REST_HEIGHT = 1.9, 1.1
"""Heights (inches): of a panel, and of what is above and below all."""
_WIDTH = 0.8
"""Width of a model's place, of 1, that its columns share."""
_MARKERS: dict[Side, str] = {"dominant": "o", "non_dominant": "s"}


@dataclass(frozen=True)
class Panel:
    """What one panel shows of every model: a column for each of the same names."""

    label: str
    """Of the y axis."""
    values: Mapping[str, Mapping[str, ArrayLike]]
    """Values of the seeds, (n,), by model and by the column's name."""


def hand_panel(metric: MetricLike, role: str, values: Mapping[str, Mapping[Side, ArrayLike]]) -> Panel:
    """Return a panel of a metric of both hands in a role.

    Args:
        metric: the metric.
        role: "reach" or "hold".
        values: of the seeds, (n,), by model and hand.
    """
    by_name = {model: {hand_label(hand): of[hand] for hand in SIDES} for model, of in values.items()}
    return Panel(f"Hands that {role}\n{axis_label(metric)}", by_name)


def hands_and_roles(panels: Sequence[Panel], title: str) -> Figure:
    """Draw what the hands of intact networks do, a panel a role and metric: the dominant hand is filled.

    Args:
        panels: as :func:`hand_panel` makes them.
        title: of the figure.
    """
    looks = {hand_label(hand): (_MARKERS[hand], hand == "dominant") for hand in SIDES}
    return _figure(panels, looks, f"{title}: hands and roles")


def own_roles(values: Mapping[str, Mapping[str, ArrayLike]], title: str, margin: float | None = None) -> Figure:
    """Draw how much better each hand is in its own role, and their mean, which is the interaction of hand and role.

    Args:
        values: by model, then by the columns "dominant hand in reach", "non-dominant hand in hold" and "interaction",
            the advantages of the seeds, (n,), in percent of both hands' mean.
        title: of the figure.
        margin: advantages below this size count as none (%): a band; None for no band.
    """
    names = list(next(iter(values.values()), {}))
    looks = {name: (marker, name == names[-1]) for name, marker in zip(names, "osD", strict=False)}
    figure = _figure([Panel("Advantage in its own role (%)", values)], looks, f"{title}: each hand in its own role")
    for axes in figure.axes:
        axes.axhline(0, color=INK, linewidth=0.8)
        if margin is not None:
            axes.axhspan(-margin, margin, color="0.92", zorder=0)
    return figure


def lesioned_arms(panels: Sequence[Panel], title: str) -> Figure:
    """Draw what deep lesions do to the arm of the same side, relative to the intact network.

    Args:
        panels: with a column a lesion, of values in percent of the intact network's.
        title: of the figure.
    """
    names = list(dict.fromkeys(name for panel in panels for of in panel.values.values() for name in of))
    looks = {name: (marker, filled) for name, (marker, filled) in zip(names, (("v", True), ("^", False)), strict=False)}
    figure = _figure(panels, looks, f"{title}: the ipsilesional arm after deep lesions")
    for axes in figure.axes:
        axes.axhline(100, color=INK, linewidth=0.8, linestyle="--")
    return figure


def _figure(panels: Sequence[Panel], looks: Mapping[str, tuple[str, bool]], title: str) -> Figure:
    """Draw panels below each other, models from the left."""
    figure = new_figure(_REST_HEIGHT + _PANEL_HEIGHT * len(panels))
    rows = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    means = [mean for axes, panel in zip(rows, panels, strict=True) for mean in _draw(axes, panel, looks)]
    models = in_order(model for panel in panels for model in panel.values)
    rows[-1].set_xticks(range(len(models)), [model_label(name) for name in models])
    handles = [marker_handle(marker, filled) for marker, filled in looks.values()]
    set_title_and_legend(figure, title, handles, list(looks))
    set_note(figure, marks_in_words(means))
    return figure


def _draw(axes: Axes, panel: Panel, looks: Mapping[str, tuple[str, bool]]) -> list[Interval]:
    means, models, step = [], in_order(panel.values), _WIDTH / len(looks)
    for x, model in enumerate(models):
        color, _, line = model_style(model)
        for i, (name, (marker, filled)) in enumerate(looks.items()):
            place = x + step * (i - (len(looks) - 1) / 2)
            style = ModelStyle(color, marker, line)
            values = panel.values[model].get(name, ())
            means.append(draw_seeds(axes, place, values, style, width=0.6 * step, filled=filled))
    style_axes(axes, y_label=panel.label)
    axes.set_xlim(-0.6, len(models) - 0.4)
    return means
