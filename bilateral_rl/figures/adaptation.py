"""How networks adapt to a field of forces: what they do by block, and what they press with on a channel's walls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from bilateral_rl.figures.bands import draw_band
from bilateral_rl.figures.curves import carried_forward, interval_over_seeds
from bilateral_rl.figures.recordings import aligned
from bilateral_rl.figures.style import (
    INK,
    ModelStyle,
    new_figure,
    set_note,
    set_title_and_legend,
    style_axes,
)
from bilateral_rl.io.text import seed_counts

CONDITION_STYLES = {
    "field": ModelStyle("#a63603", "o", "-"),
    "null": ModelStyle("#08519c", "s", (0, (4, 1.5))),
    "channel": ModelStyle("#762a83", "D", "-"),
}
"""Look of each condition of a test."""
CONDITION_WORDS = {"field": "in the field", "null": "field off (after-effect)", "channel": "in a channel"}
_IDEAL_STYLE = ModelStyle("0.45", "", (0, (4, 1.5)))


@dataclass(frozen=True)
class BlockMeasure:
    """A column of a table of blocks, and how it is drawn."""

    label: str
    """Words for the axis, with the unit."""
    conditions: tuple[str, ...] = ("field", "null")
    """Conditions in which it means something."""
    references: tuple[float, ...] = (0.0,)
    """Values with a thin line."""


MEASURES = {
    "deviation_at_peak_speed": BlockMeasure("Deviation at peak speed\n(cm, left is positive)"),
    "signed_deviation": BlockMeasure("Largest deviation\n(cm, left is positive)"),
    "perpendicular_deviation": BlockMeasure("Largest deviation (cm)"),
    "final_error": BlockMeasure("Final error (cm)"),
    "goal_completion": BlockMeasure("Goal completion (%)"),
    "channel_compensation": BlockMeasure("Compensation\non the channel", ("channel",), (0.0, 1.0)),
    "channel_peak_force": BlockMeasure("Peak force on the\nchannel (N)", ("channel",)),
}
"""The columns of a table of blocks that can be drawn."""
_SHOWN = ("deviation_at_peak_speed", "final_error", "channel_compensation")


def adaptation(blocks: pd.DataFrame, title: str, measures: Sequence[str] = _SHOWN) -> Figure:
    """Draw what networks do by block, a panel a measure: means over the seeds.

    Args:
        blocks: a row for each seed, block and condition, with columns ``seed``, ``block``, ``condition`` and measures.
        title: title of the figure.
        measures: what to draw, of those that the table has numbers of.
    """
    drawn = [name for name in measures if name in blocks and blocks[name].notna().any()]
    figure = new_figure(2.9)
    panels = figure.subplots(1, len(drawn), squeeze=False)[0]
    for axes, name in zip(panels, drawn, strict=True):
        _draw(axes, blocks, name)
    entries = {
        label: handle for axes in panels for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    set_title_and_legend(figure, title, [*entries.values()], [*entries])
    n_seeds = blocks["seed"].nunique()
    lines = "One seed." if n_seeds == 1 else f"Mean of {seed_counts([n_seeds])} and its 95 % confidence interval."
    channel = " Compensation 1 would cancel the field." * ("channel_compensation" in drawn)
    set_note(figure, f"{lines}{channel}")
    return figure


def draw_blocks(axes: Axes, blocks: pd.DataFrame, measure: str) -> None:
    """Draw one measure by block into ``axes``, as a panel of :func:`adaptation`, with a legend."""
    _draw(axes, blocks, measure)
    axes.legend(frameon=False, fontsize="small")


def _draw(axes: Axes, blocks: pd.DataFrame, name: str) -> None:
    measure = MEASURES[name]
    for value in measure.references:
        axes.axhline(value, color=INK, linewidth=0.6, linestyle=(0, (2, 2)), zorder=1)
    for condition in measure.conditions:
        rows = blocks[blocks["condition"] == condition]
        if rows.empty:
            continue
        style, words = CONDITION_STYLES[condition], CONDITION_WORDS[condition]
        x, mean, low, high = interval_over_seeds(carried_forward(rows, name, "block"))
        axes.fill_between(x, low, high, color=style.color, alpha=0.2, linewidth=0)
        axes.plot(
            x, mean, color=style.color, linestyle=style.line, linewidth=1.6, label=words, gid=condition,
            marker=style.marker, markersize=4.5, markevery=max(1, len(x) // 8),
            markeredgecolor="white", markeredgewidth=0.5,
        )  # fmt: skip
    style_axes(axes, "Block", measure.label)
    axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))


def draw_channel_force(
    axes: Axes,
    force: NDArray[np.floating],
    ideal: NDArray[np.floating],
    timestep: float,
    cue: NDArray[np.int_],
) -> None:
    """Draw the force of the hand on a channel's wall over time, and the one that would cancel the field.

    Args:
        axes: where to draw.
        force: (n, T), to the left of the way to the target (N).
        ideal: (n, T), what would cancel the field at the hand's velocity (N).
        timestep: length of a step (s).
        cue: (n,), steps at which the go cues came, from which on time is counted.
    """
    looks = (ideal, _IDEAL_STYLE, "would cancel the field"), (force, CONDITION_STYLES["channel"], "on the wall")
    for values, style, words in looks:
        shifted, first = aligned(values, cue)
        draw_band(axes, 1000 * timestep * (first + np.arange(shifted.shape[1])), shifted, style, words)
    style_axes(axes, "Time from the cue (ms)" if cue.any() else "Time (ms)", "Force (N, left is positive)")
    axes.legend(frameon=False, fontsize="small")
