"""The two hands in figures: the look of each in each role, and their paths in the frame of the body."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from numpy.typing import NDArray

from bilateral_rl.analysis.metric import ROLES
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.figures.style import TEXT_SIZE, ModelStyle
from bilateral_rl.vocabulary import SIDES

Floating = NDArray[np.floating]

_DASHED = (0, (4, 1.5))
HAND_STYLES = {
    ("dominant", "reach"): ModelStyle("#005fa0", "o", "-"),
    ("dominant", "hold"): ModelStyle("#5a9bd4", "s", _DASHED),
    ("non_dominant", "reach"): ModelStyle("#b06000", "^", "-"),
    ("non_dominant", "hold"): ModelStyle("#e0a24c", "D", _DASHED),
}
"""Look of each hand in each role: a hue for each hand, the colors of pictures; lighter and dashed where it holds."""


def hand_label(hand: str, role: str | None = None) -> str:
    """Return a hand in words, with its role: "non-dominant hand, hold"."""
    words = f"{hand.replace('_', '-')} hand"
    return f"{words}, {role}" if role else words


def spring_in_words(stiffness: float) -> str:
    """Return whether a spring of this stiffness (N/m) ties the hands, as a sentence."""
    return f"A spring of {stiffness:g} N/m ties the hands." if stiffness else "No spring ties the hands."


def by_hand_and_role(record: TrialRecord) -> dict[str, NDArray[np.bool_]]:
    """Return which rows (n,) of a record are of each hand in each role, by words for it; of one arm all, by none."""
    plan = record.plan
    if record.n_arms == 1:
        return {"": np.ones(len(plan.hand), dtype=np.bool_)}
    rows = {hand_label(*of): (plan.hand == of[0]) & (plan.role == of[1]) for of in HAND_STYLES}
    return {words: of for words, of in rows.items() if of.any()}


def draw_paths_of_two(
    axes: Axes,
    hands: Floating,
    targets: Floating,
    roles: NDArray[np.str_],
    radius: float,
    reach: float,
    shoulder_distance: float,
) -> None:
    """Draw the paths of both hands in the frame of the body: start as a dot, goal as a disc, a hold's as a ring.

    Args:
        axes: where to draw.
        hands: (n, T + 1, 2 arms, 2), positions (m).
        targets: (n, 2 arms, 2), positions (m).
        roles: (n, 2 arms), "reach" or "hold".
        radius: radius of the goal (m).
        reach: length of a stretched arm (m).
        shoulder_distance: distance of the shoulders (m), which are crosses.
    """
    shoulders = 50 * shoulder_distance * np.array((1.0, -1.0))
    for arm, hand in enumerate(SIDES):
        axes.add_patch(Circle((shoulders[arm], 0), 100 * reach, fill=False, color="0.88"))
        axes.plot(shoulders[arm], 0, "k+", markersize=8)
        for path, goal, role in zip(100 * hands[:, :, arm], 100 * targets[:, arm], roles[:, arm], strict=True):
            color = HAND_STYLES[hand, "reach"].color
            holds = role == "hold"
            axes.add_patch(
                Circle(
                    tuple(goal), 100 * radius, fill=not holds, color=color, alpha=0.5 if holds else 0.15, linewidth=1
                )
            )
            axes.plot(*path.T, color=color, linewidth=1.4, gid=f"{hand} {role}")
            axes.plot(*path[0], "s" if holds else "o", color=color, markersize=4)
    axes.axvline(0, color="0.85", linewidth=0.8, linestyle=(0, (6, 4)), zorder=0)
    farthest = 102 * (reach + radius)
    lowest = 100 * min(hands[..., 1].min(), targets[..., 1].min() - radius)
    axes.set(xlim=(-shoulders[0] - farthest, shoulders[0] + farthest), aspect="equal")
    axes.set(ylim=(min(-40 * reach, 1.05 * lowest), farthest))
    axes.set(xlabel="hand x (cm), from the body's midline", ylabel="hand y (cm), shoulders at +")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    _draw_legend(axes, np.unique(roles).tolist())


def _draw_legend(axes: Axes, roles: list[str]) -> None:
    handles = [
        Line2D([], [], color=HAND_STYLES[hand, "reach"].color, linewidth=1.4, label=hand_label(hand)) for hand in SIDES
    ]
    marks = {"reach": ("o", "starts to reach"), "hold": ("s", "holds")}
    if len(roles) > 1:
        handles += [
            Line2D([], [], linestyle="", color="0.3", marker=marks[role][0], markersize=4, label=marks[role][1])
            for role in ROLES
        ]
    axes.legend(handles=handles, loc="lower center", ncols=2, fontsize=TEXT_SIZE, frameon=False, handlelength=1.5)
