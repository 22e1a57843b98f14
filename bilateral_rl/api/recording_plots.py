"""Figures of recordings in a given axis of matplotlib, in the look of the toolkit's own figures."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from bilateral_rl.analysis.channels import force_on_walls
from bilateral_rl.analysis.kinematics import SAME_PLACE
from bilateral_rl.analysis.recording import Recording
from bilateral_rl.api.checks import whole
from bilateral_rl.api.plotting import axes_for, only
from bilateral_rl.api.wording import in_python
from bilateral_rl.figures.adaptation import draw_channel_force
from bilateral_rl.figures.center_out import MOST_TARGETS, Reaches, draw_center_out, has_few_targets
from bilateral_rl.figures.hands import HAND_STYLES, draw_paths_of_two, hand_label
from bilateral_rl.figures.recordings import LESION_STYLES, SpeedLine, draw_muscles, draw_paths, draw_speeds
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import lesion_words
from bilateral_rl.vocabulary import SIDES


@in_python
def plot_paths(
    recording: Recording,
    ax: Axes | None = None,
    *,
    trials: int = 12,
    seed: int | None = None,
    lesion: str | None = None,
) -> Axes:
    """Draw the hand's paths in the first trials of one network: start as a dot, goal as a disc, one color a trial.

    The shoulder is a cross, and the arm's reach a circle. Of two arms both hands are drawn, each in its own color, in
    the frame of the body; the goal of a hand that holds is a ring.

    Args:
        recording: from :meth:`Run.record`.
        ax: where to draw; None for a new figure.
        trials: how many trials to draw.
        seed: seed of the network; it may be left out where there is one only.
        lesion: its lesion, likewise.

    Raises:
        UserError: a recording of several networks or lesions and no word on which, or one that is not in it.
    """
    rows = _one(recording, seed, lesion)[: whole("--trials", trials, least=1)]
    settings = recording.metadata["settings"]
    hand, target, reach = recording["hand"][rows], recording["target"][rows], sum(settings["arm"]["link_length"])
    if recording.n_arms > 1:
        axes, distance = axes_for(ax, (5.5, 4.0)), settings["two_arms"]["shoulder_distance"]
        draw_paths_of_two(axes, hand, target, recording["role"][rows], settings["threshold"], reach, distance)
    else:
        axes = axes_for(ax, (4.5, 4.2))
        draw_paths(axes, hand, target, settings["threshold"], reach)
    axes.set_title(f"{len(rows)} trials, {_words(recording, rows)}", fontsize=10)
    return axes


@in_python
def plot_center_out(
    recording: Recording, ax: Axes | None = None, *, seed: int | None = None, lesion: str | None = None
) -> Axes:
    """Draw the hand's paths around the start, a hue for each target: thin the trials, thick their mean.

    Args:
        recording: from :meth:`Run.record`, of a task with a few targets, such as center-out; of two arms, one hand
            of it (:meth:`Recording.of_hand`).
        ax: where to draw; None for a new figure.
        seed: seed of the network; it may be left out where there is one only.
        lesion: its lesion, likewise.

    Raises:
        UserError: a recording of several networks or lesions and no word on which, one that is not in it, or one whose
            trials do not repeat a few targets.
    """
    rows = _one(_of_one_arm(recording), seed, lesion)
    reaches = _reaches(recording, rows)
    if not has_few_targets(reaches):
        raise UserError(
            f"The {len(rows)} trials do not repeat 2 to {MOST_TARGETS} targets around their starts: record more of "
            "them or another task, or draw them by plot_paths."
        )
    axes = axes_for(ax, (4.0, 4.0))
    draw_center_out(axes, reaches, recording.metadata["settings"]["threshold"])
    axes.set_title(f"{len(rows)} trials, {_words(recording, rows)}", fontsize=10)
    return axes


@in_python
def plot_speeds(recording: Recording, ax: Axes | None = None) -> Axes:
    """Draw the hand's speed (cm/s) over time (ms), a line a lesion; of two arms a line for each hand in each role.

    A line is the mean over the trials of all networks, a band their quartiles. Where go cues come within trials,
    time counts from them, and trials without one are left out.

    Args:
        recording: from :meth:`Run.record`.
        ax: where to draw; None for a new figure.

    Raises:
        UserError: a recording of two arms with several lesions, of which lines would be too many: draw those of one
            hand, by ``recording.of_hand("dominant", "reach")``.
    """
    _check(recording)
    axes = axes_for(ax, (5.0, 3.0))
    draw_speeds(axes, _speeds_of_hands(recording) if recording.n_arms > 1 else _speeds(recording), recording.timestep)
    return axes


@in_python
def plot_muscles(
    recording: Recording, ax: Axes | None = None, *, seed: int | None = None, lesion: str | None = None
) -> Axes:
    """Draw the activation of the six muscles over time (ms).

    A line is the mean over trials, a band their quartiles.

    Args:
        recording: from :meth:`Run.record`; of two arms, one hand of it (:meth:`Recording.of_hand`).
        ax: where to draw; None for a new figure.
        seed: seed of the network; it may be left out where there is one only.
        lesion: its lesion, likewise.

    Raises:
        UserError: a recording of several networks or lesions and no word on which, or one that is not in it.
    """
    rows = _one(_of_one_arm(recording), seed, lesion)
    axes = axes_for(ax, (5.0, 3.4))
    draw_muscles(axes, recording["activation"][rows], recording.timestep)
    axes.set_title(f"{len(rows)} trials, {_words(recording, rows)}", fontsize=10)
    return axes


@in_python
def plot_channel(
    recording: Recording, ax: Axes | None = None, *, seed: int | None = None, lesion: str | None = None
) -> Axes:
    """Draw the force of the hand on the walls of a channel over time, beside the one that would cancel the field.

    Left of the way to the target is positive. A line is the mean over the trials in a channel, a band their quartiles;
    time counts from the go cue.

    Args:
        recording: from :meth:`Run.record`, of an experiment with a field and a channel; of two arms, one hand of it
            (:meth:`Recording.of_hand`).
        ax: where to draw; None for a new figure.
        seed: seed of the network; it may be left out where there is one only.
        lesion: its lesion, likewise.

    Raises:
        UserError: a recording of several networks or lesions and no word on which, one that is not in it, or one
            without trials in a channel.
    """
    rows = _one(_of_one_arm(recording), seed, lesion)
    conditions = recording.arrays.get("condition", np.full(len(recording), ""))[rows]
    rows = rows[[{"channel", "pulse", "no_go"} & {*words.split("+")} == {"channel"} for words in conditions.tolist()]]
    if not len(rows):
        raise UserError(
            "The recording has no trials in a channel: record an experiment with one, as by "
            'settings={"experiment.forces.channel.share": 1.0}.'
        )
    hand, target, seen = (recording[name][rows] for name in ("hand", "target", "seen_target"))
    of_walls = recording["force"][rows] - recording["load"][rows][:, None]
    on_walls, ideal = (
        force_on_walls(force, hand[:, 0], target) for force in (of_walls, recording["field_force"][rows])
    )
    axes = axes_for(ax, (4.5, 3.2))
    draw_channel_force(axes, on_walls, ideal, recording.timestep, _cues(hand, seen)[0])
    axes.set_title(f"{len(rows)} trials, {_words(recording, rows)}", fontsize=10)
    return axes


def _speeds(recording: Recording) -> list[SpeedLine]:
    """Return a line a lesion; where go cues come within trials, of those with one alone."""
    cue, comes = _cues(recording["hand"], recording["seen_target"])
    rows = {lesion: recording["lesion"] == lesion for lesion in dict.fromkeys(recording["lesion"].tolist())}
    if cue.any():
        rows = {lesion: of & comes for lesion, of in rows.items() if (of & comes).any()}
    return [
        SpeedLine(lesion_words(lesion), LESION_STYLES[lesion], recording["hand"][of], cue[of])
        for lesion, of in rows.items()
    ]


def _speeds_of_hands(recording: Recording) -> list[SpeedLine]:
    """Return a line for each hand in each role. Raises UserError for several lesions."""
    if len(lesions := dict.fromkeys(recording["lesion"].tolist())) > 1:
        raise UserError(
            f"There are both hands after several lesions ({', '.join(lesions)}), too many for lines: draw one hand, as "
            'by recording.of_hand("dominant", "reach").'
        )
    lines = []
    for (hand, role), style in HAND_STYLES.items():
        if (recording["role"][:, SIDES.index(hand)] == role).any():
            (line,) = _speeds(recording.of_hand(hand, role))
            lines.append(line._replace(words=hand_label(hand, role), style=style))
    return lines


def _reaches(recording: Recording, rows: np.ndarray) -> Reaches:
    """Return the trials of ``rows`` that have something to reach for."""
    hand, target, seen = (recording[name][rows] for name in ("hand", "target", "seen_target"))
    cue, comes = _cues(hand, seen)
    goal = seen[np.arange(len(rows)), cue]
    return Reaches(hand[comes], target[comes], goal[comes])


def _cues(hand: np.ndarray, seen_target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the step (n,) at which a target other than the start is first seen, and whether one is, (n,)."""
    elsewhere = np.abs(seen_target - hand[:, :1]).max(axis=2) > SAME_PLACE
    return elsewhere.argmax(axis=1), elsewhere.any(axis=1)


def _check(recording: Recording) -> None:
    if not isinstance(recording, Recording):
        raise UserError(f"--recording must be one, as `run.record()` returns it, not {type(recording).__name__}.")


def _of_one_arm(recording: Recording) -> Recording:
    """Return a recording. Raises UserError if it is of two arms."""
    _check(recording)
    if recording.n_arms > 1:
        raise UserError('This recording is of two arms: draw one hand, as by recording.of_hand("dominant").')
    return recording


def _one(recording: Recording, seed: int | None, lesion: str | None) -> np.ndarray:
    """Return the rows of one network with one lesion. Raises UserError if it is not clear which."""
    _check(recording)
    of_seed = only("seed", list(dict.fromkeys(recording["seed"].tolist())), seed)
    of_lesion = only("lesion", list(dict.fromkeys(recording["lesion"].tolist())), lesion)
    rows: np.ndarray = np.flatnonzero((recording["seed"] == of_seed) & (recording["lesion"] == of_lesion))
    return rows


def _words(recording: Recording, rows: np.ndarray) -> str:
    first = rows[0]
    return f"seed {recording['seed'][first]}, {lesion_words(str(recording['lesion'][first]))}"
