"""Reaches to a few targets as motor control shows them: around the start, a hue for each target, their mean on top."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.figures.hands import hand_label
from bilateral_rl.figures.style import INK, LABEL_SIZE, WIDTH, new_figure, set_note, set_title, style_axes

Floating = NDArray[np.floating]

MOST_TARGETS = 24
"""More hues than so many cannot be told apart."""
_FORCES = ("field", "channel", "pulse")
_SAME_TARGET = 1e-3  # m
_FURTHEST = 2.5  # distances of the furthest target: what goes beyond is cut off, or nothing else could be seen
_MOST_COLUMNS = 3
_NOTE = "Thin: trials. Thick: their mean. Discs: targets. Positions are relative to the start."


@dataclass(frozen=True)
class Reaches:
    """Trials of one condition."""

    hand: Floating
    """(n, T + 1, 2): position of the hand at the start and after each step (m)."""
    target: Floating
    """(n, 2): position of the target, the last one where it jumps (m)."""
    first_target: Floating | None = None
    """(n, 2): that before it jumps (m); None where no target jumps."""

    def target_numbers(self) -> NDArray[np.intp]:
        """Return the number of each trial's target (n,), counted from 0 by direction and distance from the start.

        A target that another one jumped to is not the same as one that was there at once. Where there are more than
        :data:`MOST_TARGETS`, the rest count as one: thousands of random targets would take seconds to tell apart.
        """
        start = self.hand[:, 0]
        first = self.target if self.first_target is None else self.first_target
        offsets = np.concatenate((self.target - start, first - start), axis=1)
        numbers = np.full(len(offsets), -1)
        found: list[Floating] = []
        while (numbers < 0).any():
            one = offsets[numbers.argmin()]
            alike = (np.abs(offsets - one).max(axis=1) < _SAME_TARGET) | (len(found) == MOST_TARGETS)
            numbers[(numbers < 0) & alike] = len(found)
            found.append(one)
        x, y, first_x, first_y = np.reshape(found, (-1, 4)).T
        direction, first_direction = (np.arctan2(b, a).round(3) % (2 * np.pi) for a, b in ((x, y), (first_x, first_y)))
        order = np.lexsort((np.hypot(first_x, first_y), first_direction, np.hypot(x, y), direction))
        return np.asarray(order.argsort()[numbers], dtype=np.intp)


def reaches_of(record: TrialRecord) -> Reaches:
    """Return the reaches of a record: its trials but for those without a cue, which reach for nothing.

    Of two arms, those of both hands, in the frame of the body, and not what hands do that hold.
    """
    return _chosen(record, _reach(record))


def reaches_by_force(record: TrialRecord) -> dict[str, Reaches]:
    """Return :func:`reaches_of` a record by the force on the hand, such as "field", "channel" and "null".

    Of two arms by the hand, too: "dominant hand, field"; or by the hand alone, where there are no forces.
    """
    plan = record.plan
    parts = [[part for part in joined.split("+") if part in _FORCES] for joined in plan.condition]
    words = np.array(["+".join(of_trial) or "null" for of_trial in parts], dtype=object)
    if record.n_arms > 1:
        hands = np.array([hand_label(hand) for hand in plan.hand], dtype=object)
        words = hands if (words == "null").all() else hands + ", " + words
    rows = {name: _reach(record) & (words == name) for name in dict.fromkeys(words.tolist())}
    return {name: _chosen(record, of) for name, of in rows.items() if of.any()}


def _reach(record: TrialRecord) -> NDArray[np.bool_]:
    """(n,): which trials, or hands of trials of two arms, reach for something."""
    comes = ~record.plan.has("no_go")
    return comes if record.n_arms == 1 else comes & (record.plan.role == "reach")


def _chosen(record: TrialRecord, rows: NDArray[np.bool_]) -> Reaches:
    places = (record.hand, record.target, record.plan.goal)
    return Reaches(*(record.body_positions(of)[rows] for of in places))


def has_few_targets(reaches: Reaches) -> bool:
    """Whether trials repeat a few targets, several of them away from the start: else there is nothing to group."""
    numbers = reaches.target_numbers()
    n_targets = int(numbers.max(initial=-1)) + 1
    return 2 <= n_targets <= min(MOST_TARGETS, len(numbers) // 2)


def center_out(conditions: Mapping[str, Reaches], radius: float, title: str) -> Figure:
    """Draw the hand's paths around the start, a panel a condition.

    Args:
        conditions: trials by the words for their condition, such as "null", "field" and "after-effect".
        radius: radius of the goal (m).
        title: title of the figure.
    """
    columns = 2 if len(conditions) == 4 else min(len(conditions), _MOST_COLUMNS)
    rows = -(-len(conditions) // columns)
    figure = new_figure(0.9 + rows * WIDTH / max(columns, 2))
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes in panels.flat[len(conditions) :]:
        axes.set_visible(False)
    numbers = _joined(conditions.values()).target_numbers()
    ends = np.cumsum([len(reaches.hand) for reaches in conditions.values()])
    own = np.split(numbers, ends[:-1])  # of all, so that a target has one hue in all panels
    for i, (axes, (words, reaches)) in enumerate(zip(panels.flat, conditions.items(), strict=False)):
        _draw(axes, reaches, radius, own[i], int(numbers.max(initial=0)) + 1)
        axes.set_title(words, fontsize=LABEL_SIZE)
        axes.set_ylabel("Hand y (cm)" * (i % columns == 0))
        is_lowest = i + columns >= len(conditions)
        axes.set_xlabel("Hand x (cm)" * is_lowest)
        axes.tick_params(labelbottom=is_lowest)
    limit = max(_limit(reaches, radius) for reaches in conditions.values())
    panels.flat[0].set(xlim=(-limit, limit), ylim=(-limit, limit))
    set_title(figure, title)
    set_note(figure, _NOTE)
    return figure


def draw_center_out(axes: Axes, reaches: Reaches, radius: float) -> None:
    """Draw the hand's paths around the start, a hue for each target: each trial, and the mean over those to a target.

    Args:
        axes: where to draw.
        reaches: the trials.
        radius: radius of the goal (m).
    """
    numbers = reaches.target_numbers()
    _draw(axes, reaches, radius, numbers, int(numbers.max(initial=0)) + 1)


def _joined(conditions: Iterable[Reaches]) -> Reaches:
    """Return the starts and targets of several conditions as one."""
    parts = [
        (one.hand[:, :1], one.target, one.target if one.first_target is None else one.first_target)
        for one in conditions
    ]
    return Reaches(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def _draw(axes: Axes, reaches: Reaches, radius: float, numbers: NDArray[np.intp], n_hues: int) -> None:
    from seaborn import husl_palette  # slow to import, and trainings that draw other paths do without

    start = reaches.hand[:, :1]
    paths, goals = 100 * (reaches.hand - start), 100 * (reaches.target - start[:, 0])
    hues = husl_palette(n_hues, s=0.85, l=0.55)
    for number, color in enumerate(hues):
        of_target = numbers == number
        if of_target.any():
            axes.add_patch(Circle(tuple(goals[of_target][0]), 100 * radius, color=color, alpha=0.22, linewidth=0))
            for path in paths[of_target]:
                axes.plot(*path.T, color=color, linewidth=0.6, alpha=0.35, gid="trial")
    for number, color in enumerate(hues):
        of_target = numbers == number
        if of_target.any():
            axes.plot(*paths[of_target].mean(axis=0).T, color=color, linewidth=2.0, gid="mean", zorder=3)
    axes.plot(0, 0, "o", markersize=4, color="white", markeredgecolor=INK, markeredgewidth=0.8, zorder=4, gid="start")
    limit = _limit(reaches, radius)
    style_axes(axes, "Hand x (cm)", "Hand y (cm)")
    axes.grid(visible=False)
    axes.set(xlim=(-limit, limit), ylim=(-limit, limit), aspect="equal")


def _limit(reaches: Reaches, radius: float) -> float:
    """Return half the side of what is shown (cm): the targets, and the paths unless they go far astray."""
    start = reaches.hand[:, :1]
    furthest = np.linalg.norm(reaches.target - start[:, 0], axis=1).max(initial=0)
    paths = np.abs(reaches.hand - start).max(initial=0)
    return float(105 * max(furthest + radius, min(paths, _FURTHEST * furthest)))
