"""Recorded trials, drawn into given axes: the hand's paths and speeds, and the muscles' activation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle
from numpy.typing import NDArray

from bilateral_rl.analysis.kinematics import hand_speed
from bilateral_rl.envs.arm.parameters import MUSCLE_NAMES
from bilateral_rl.figures.bands import draw_band
from bilateral_rl.figures.style import INK, TEXT_SIZE, ModelStyle, legend_above, style_axes
from bilateral_rl.policies.lesions import INTACT, LESIONS

Floating = NDArray[np.floating]

_ROOM_FOR_LEGEND = 0.25
"""Share of the axis's height."""

_COLORS = ("#a63603", "#fd8d3c", "#01665e", "#5ab4ac", "#7b52ab", "#c51b7d", "#de77ae")
_MARKERS = ("^", "v", "s", "D", "X", "P", "h")
LESION_STYLES = {INTACT: ModelStyle(INK, "o", "-")} | {
    lesion: ModelStyle(color, marker, (0, (4, 1.5)) if "non_dominant" in lesion else "-")
    for lesion, color, marker in zip(LESIONS, _COLORS, _MARKERS, strict=True)
}
"""Look of each lesion; those of the non-dominant side have a broken line."""
MUSCLE_STYLES = {
    name: ModelStyle(color, marker, line)
    for name, color, marker, line in zip(
        MUSCLE_NAMES,
        ("#08519c", "#6baed6", "#a63603", "#fd8d3c", "#3f1069", "#a78fd0"),
        ("o", "s", "^", "v", "D", "P"),
        ("-", (0, (4, 1.5))) * 3,
        strict=True,
    )
}
"""Look of each muscle: a hue for each joint and for the muscles of both, the flexor dark, the extensor light."""


def draw_paths(axes: Axes, hand: Floating, target: Floating, radius: float, reach: float) -> None:
    """Draw the hand's paths in the plane: start as a dot, goal as a disc, one color a trial, the shoulder as a cross.

    Args:
        axes: where to draw.
        hand: (n, T + 1, 2), positions (m).
        target: (n, 2), positions (m).
        radius: radius of the goal (m).
        reach: length of the stretched arm (m), drawn as a circle.
    """
    axes.add_patch(Circle((0, 0), 100 * reach, fill=False, color="0.85"))
    for i, (path, goal) in enumerate(zip(100 * hand, 100 * target, strict=True)):
        color = f"C{i % 10}"
        axes.add_patch(Circle(tuple(goal), 100 * radius, color=color, alpha=0.2, linewidth=0))
        axes.plot(*path.T, color=color, linewidth=1.5)
        axes.plot(*path[0], "o", color=color, markersize=5)
    axes.plot(0, 0, "k+", markersize=8)
    limit = 105 * reach
    lowest = 100 * min(hand[..., 1].min(), target[:, 1].min() - radius)
    # Most arms keep above the shoulder; joints with other ranges may reach anywhere.
    axes.set(xlim=(-limit, limit), ylim=(min(-0.35 * limit, 1.05 * lowest), limit), aspect="equal")
    axes.set(xlabel="hand x (cm), shoulder at +", ylabel="hand y (cm)")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


class SpeedLine(NamedTuple):
    """Trials whose speed is a line."""

    words: str
    """Words for the legend."""
    style: ModelStyle
    """Look of the line."""
    hand: Floating
    """(n, T + 1, 2), positions (m)."""
    cue: NDArray[np.int_]
    """(n,), steps at which the go cues came."""


def draw_speeds(axes: Axes, lines: Sequence[SpeedLine], timestep: float) -> None:
    """Draw the hand's speed over time, mean over the trials, and a band for their quartiles.

    Where any go cue comes later than the start, time is counted from them.

    Args:
        axes: where to draw.
        lines: what is drawn.
        timestep: length of a step (s).
    """
    is_cued = any(line.cue.any() for line in lines)
    for index, line in enumerate(lines):
        speed: Floating = 100 * hand_speed(line.hand, timestep)
        first = 0
        if is_cued:
            speed, first = aligned(speed, line.cue)
        middles = 1000 * timestep * (first + np.arange(speed.shape[1]) + 0.5)
        draw_band(axes, middles, speed, line.style, line.words, index)
    style_axes(axes, "Time from the cue (ms)" if is_cued else "Time (ms)", "Hand speed (cm/s)")
    axes.set_ylim(bottom=0)
    legend_above(axes, columns=2)


def aligned(values: Floating, onset: NDArray[np.int_]) -> tuple[Floating, int]:
    """Return values (n, T) of steps shifted to their ``onset`` (n,), and the number of the first step from there.

    Steps are left out that fewer than half of the trials have; where a trial has none, it is NaN.
    """
    n, length = values.shape
    earliest = -int(onset.max())
    shifted = np.full((n, length + int(onset.max() - onset.min())), np.nan)
    for row, of_trial, at in zip(shifted, values, onset, strict=True):
        row[-earliest - at : -earliest - at + length] = of_trial
    often = np.flatnonzero((~np.isnan(shifted)).mean(axis=0) >= 0.5)
    return shifted[:, often[0] : often[-1] + 1], earliest + int(often[0])


def draw_muscles(axes: Axes, activation: Floating, timestep: float) -> None:
    """Draw the six muscles' activation over time: mean over the trials, and a band for their quartiles.

    Args:
        axes: where to draw.
        activation: (n, T + 1, 6), at the start and after each step.
        timestep: length of a step (s).
    """
    time = 1000 * timestep * np.arange(activation.shape[1])
    for index, (muscle, style) in enumerate(MUSCLE_STYLES.items()):
        draw_band(axes, time, activation[..., index], style, muscle, index)
    style_axes(axes, "Time (ms)", "Activation (0 to 1)")
    # The legend lies inside: above, it would push the title out of figures that are laid out by hand.
    top = axes.get_ylim()[1] / (1 - _ROOM_FOR_LEGEND)
    axes.set_yticks([tick for tick in axes.get_yticks() if 0 <= tick < 1.01])
    axes.set_ylim(0, top)
    axes.legend(
        loc="upper center", fontsize=TEXT_SIZE, frameon=False, ncols=3,
        columnspacing=0.9, handlelength=1.5, handletextpad=0.4,
    )  # fmt: skip
