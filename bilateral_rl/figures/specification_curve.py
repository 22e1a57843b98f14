"""Specification curves: one effect under every reading of what was left open, and the choices that each reading makes.

Source: Simonsohn, Simmons & Nelson 2020, doi:10.1038/s41562-020-0912-z.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bilateral_rl.analysis.intervals import Interval
from bilateral_rl.figures.style import (
    FAINT,
    INK,
    LABEL_SIZE,
    NOTE_SIZE,
    new_figure,
    set_note,
    set_title_and_legend,
    style_axes,
)

VERDICT_STYLES = {
    "supported": ("#1b7837", "o", True),
    "undecided": ("#b8860b", "s", False),
    "not supported": ("#a50f15", "X", True),
}
"""Color, marker and whether that is filled, of each verdict: they differ without color, too."""
_CURVE_HEIGHT, _ROW_HEIGHT = 2.3, 0.165
_ROOM = 0.6
"""Share of the effects' range that the curve shows beyond them; longer intervals leave the panel."""


@dataclass(frozen=True)
class Specification:
    """One effect under one reading."""

    effect: Interval
    """As a share of the mean; NaN where there is none."""
    verdict: str
    """A key of :data:`VERDICT_STYLES`."""
    choices: Mapping[str, str]
    """What the reading chooses, by what there is to choose; the same keys in all specifications."""


def specification_curve(specifications: Sequence[Specification], title: str) -> Figure:
    """Draw effects from the smallest to the largest with their 95 % intervals, and below each the choices made.

    What all specifications choose alike is left out; those without an effect stand last.

    Args:
        specifications: one a reading.
        title: says which effect.

    Raises:
        ValueError: no specification at all.
    """
    if not specifications:
        raise ValueError("a specification curve needs a specification.")
    order = sorted(specifications, key=lambda s: math.inf if math.isnan(s.effect.value) else s.effect.value)
    rows = _rows(specifications)
    grid_height = _ROW_HEIGHT * max(len(rows), 1)
    figure = new_figure(1.3 + _CURVE_HEIGHT + grid_height)
    curve, grid = figure.subplots(2, 1, sharex=True, height_ratios=[_CURVE_HEIGHT, grid_height])
    _draw_curve(curve, order)
    _draw_grid(grid, order, rows)
    present = [verdict for verdict in VERDICT_STYLES if any(s.verdict == verdict for s in order)]
    set_title_and_legend(figure, title, [_handle(verdict) for verdict in present], present)
    set_note(
        figure,
        "Each column is one reading. Above: the effect with its 95 % interval, as a share of the mean; above 0 it is "
        "on the claim's side. Intervals that leave the panel go on. Below: what the reading chooses.",
    )
    return figure


def _draw_curve(axes: Axes, order: Sequence[Specification]) -> None:
    for x, specification in enumerate(order):
        effect, (color, marker, filled) = specification.effect, VERDICT_STYLES[specification.verdict]
        if math.isnan(effect.value):
            axes.text(x, 0.03, "–", transform=axes.get_xaxis_transform(), ha="center", size=LABEL_SIZE, color=color)
            continue
        low, high = np.clip([100 * effect.low, 100 * effect.high], -1e6, 1e6)
        if not math.isnan(low):
            axes.vlines(x, low, high, color=color, linewidth=1.1, alpha=0.6, gid="interval")
        face = color if filled else "white"
        axes.plot(x, 100 * effect.value, marker, color=color, markerfacecolor=face, markersize=4.5, gid="effect")
    axes.axhline(0, color=INK, linewidth=0.8)
    axes.set_ylim(*_limits(order))
    style_axes(axes, y_label="Effect (% of the mean)")
    axes.tick_params(bottom=False)


def _limits(order: Sequence[Specification]) -> tuple[float, float]:
    """Limits that show every effect and the line, and of the intervals what does not dwarf them."""
    effects = [100 * s.effect.value for s in order if math.isfinite(s.effect.value)]
    ends = [100 * end for s in order for end in (s.effect.low, s.effect.high) if math.isfinite(end)]
    low, high = min([0.0, *effects]), max([0.0, *effects])
    room = _ROOM * (high - low) or 1.0
    # Not farther than the intervals reach, with a little air.
    bottom, top = max(low - room, min([low, *ends])), min(high + room, max([high, *ends]))
    air = 0.05 * (top - bottom) or 1.0
    return bottom - air, top + air


def _rows(specifications: Sequence[Specification]) -> list[tuple[str, str]]:
    """What can be chosen, from the top: (of what, which), values in the order in which they first appear."""
    names = specifications[0].choices
    values = {name: list(dict.fromkeys(s.choices[name] for s in specifications)) for name in names}
    return [(name, value) for name, chosen in values.items() if len(chosen) > 1 for value in chosen]


def _draw_grid(axes: Axes, order: Sequence[Specification], rows: Sequence[tuple[str, str]]) -> None:
    x, y = np.meshgrid(range(len(order)), range(len(rows)))
    axes.plot(x.ravel(), y.ravel(), "o", color="0.87", markersize=1.6, markeredgewidth=0)
    for verdict, (color, _, _) in VERDICT_STYLES.items():
        chosen = [(x, y) for x, s in enumerate(order) for y, (name, value) in enumerate(rows)
                  if s.verdict == verdict and s.choices[name] == value]  # fmt: skip
        axes.plot(*np.reshape(chosen, (-1, 2)).T, "o", color=color, markersize=3.4, markeredgewidth=0, gid="choice")
    first = {name: y for y, (name, _) in reversed(list(enumerate(rows)))}
    for i, (name, top) in enumerate(first.items()):
        if i % 2 == 0:
            height = sum(other == name for other, _ in rows)
            axes.axhspan(top - 0.5, top + height - 0.5, color=FAINT, alpha=0.6, linewidth=0, zorder=0)
    labels = [f"{name}:  {value}" if first[name] == y else value for y, (name, value) in enumerate(rows)]
    axes.set_yticks(range(len(rows)), labels, fontsize=NOTE_SIZE)
    axes.set_ylim(max(len(rows), 1) - 0.5, -0.5)
    axes.set_xlim(-0.8, len(order) - 0.2)
    axes.set_xticks([])
    axes.tick_params(length=0)
    for side in axes.spines.values():
        side.set_visible(False)


def _handle(verdict: str) -> Line2D:
    color, marker, filled = VERDICT_STYLES[verdict]
    return Line2D(
        [], [], linestyle="", marker=marker, markersize=6, color=color, markerfacecolor=color if filled else "white"
    )
