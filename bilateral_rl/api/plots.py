"""Figures of results in a given axis of matplotlib, in the look of the toolkit's own figures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from bilateral_rl.analysis.channels import force_on_walls
from bilateral_rl.analysis.kinematics import SAME_PLACE
from bilateral_rl.analysis.metrics import find_metric, preferred_among
from bilateral_rl.analysis.recording import Recording
from bilateral_rl.analysis.results import COLUMNS
from bilateral_rl.api.checks import whole
from bilateral_rl.api.wording import in_python
from bilateral_rl.envs.tasks import RandomReach, make_task
from bilateral_rl.figures import curves as learning
from bilateral_rl.figures.adaptation import MEASURES, draw_blocks, draw_channel_force
from bilateral_rl.figures.center_out import MOST_TARGETS, Reaches, draw_center_out, has_few_targets
from bilateral_rl.figures.lesions import draw_lesions
from bilateral_rl.figures.recordings import draw_muscles, draw_paths, draw_speeds
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import lesion_words

T = TypeVar("T")

_USUAL_RADIUS = 0.05
"""Radius of the goal (m) at which lesions are drawn if nothing is said."""


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

    The shoulder is a cross, and the arm's reach a circle.

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
    reach = sum(settings["arm"]["link_length"])
    axes = _axes(ax, (4.5, 4.2))
    draw_paths(axes, recording["hand"][rows], recording["target"][rows], settings["threshold"], reach)
    axes.set_title(f"{len(rows)} trials, {_words(recording, rows)}", fontsize=10)
    return axes


@in_python
def plot_center_out(
    recording: Recording, ax: Axes | None = None, *, seed: int | None = None, lesion: str | None = None
) -> Axes:
    """Draw the hand's paths around the start, a hue for each target: thin the trials, thick their mean.

    Args:
        recording: from :meth:`Run.record`, of a task with a few targets, such as center-out.
        ax: where to draw; None for a new figure.
        seed: seed of the network; it may be left out where there is one only.
        lesion: its lesion, likewise.

    Raises:
        UserError: a recording of several networks or lesions and no word on which, one that is not in it, or one whose
            trials do not repeat a few targets.
    """
    rows = _one(recording, seed, lesion)
    reaches = _reaches(recording, rows)
    if not has_few_targets(reaches):
        raise UserError(
            f"The {len(rows)} trials do not repeat 2 to {MOST_TARGETS} targets around their starts: record more of "
            "them or another task, or draw them by plot_paths."
        )
    axes = _axes(ax, (4.0, 4.0))
    draw_center_out(axes, reaches, recording.metadata["settings"]["threshold"])
    axes.set_title(f"{len(rows)} trials, {_words(recording, rows)}", fontsize=10)
    return axes


@in_python
def plot_speeds(recording: Recording, ax: Axes | None = None) -> Axes:
    """Draw the hand's speed (cm/s) over time (ms), a line a lesion.

    A line is the mean over the trials of all networks, a band their quartiles. Where go cues come within trials,
    time counts from them, and trials without one are left out.

    Args:
        recording: from :meth:`Run.record`.
        ax: where to draw; None for a new figure.
    """
    _check(recording)
    cue, comes = _cues(recording["hand"], recording["seen_target"])
    rows = {lesion: recording["lesion"] == lesion for lesion in dict.fromkeys(recording["lesion"].tolist())}
    if cue.any():
        rows = {lesion: of & comes for lesion, of in rows.items() if (of & comes).any()}
    axes = _axes(ax, (5.0, 3.0))
    draw_speeds(
        axes,
        {lesion: recording["hand"][of] for lesion, of in rows.items()},
        recording.timestep,
        {lesion: cue[of] for lesion, of in rows.items()} if cue.any() else None,
    )
    return axes


@in_python
def plot_muscles(
    recording: Recording, ax: Axes | None = None, *, seed: int | None = None, lesion: str | None = None
) -> Axes:
    """Draw the activation of the six muscles over time (ms).

    A line is the mean over trials, a band their quartiles.

    Args:
        recording: from :meth:`Run.record`.
        ax: where to draw; None for a new figure.
        seed: seed of the network; it may be left out where there is one only.
        lesion: its lesion, likewise.

    Raises:
        UserError: a recording of several networks or lesions and no word on which, or one that is not in it.
    """
    rows = _one(recording, seed, lesion)
    axes = _axes(ax, (5.0, 3.4))
    draw_muscles(axes, recording["activation"][rows], recording.timestep)
    axes.set_title(f"{len(rows)} trials, {_words(recording, rows)}", fontsize=10)
    return axes


@in_python
def plot_lesions(
    results: pd.DataFrame, ax: Axes | None = None, *, metric: str | None = None, model: str | None = None
) -> Axes:
    """Draw what networks do after each lesion, beside each other by what followed it.

    Dots are networks, large markers and bars their mean and its 95 % interval; a short red line is the mean of fresh
    networks that were treated alike, the dashed line that of the intact ones.

    Args:
        results: from :meth:`Run.lesion`, or its ``lesions.csv``.
        ax: where to draw; None for a new figure.
        metric: name of a metric in the table; None for the one that the paper judges the task by, at 5 cm.
        model: which of several models.

    Raises:
        UserError: no such table, or a metric or model that is not in it.
    """
    if not isinstance(results, pd.DataFrame) or not {*COLUMNS} <= {*results.columns} or results.empty:
        raise UserError("--results must be a table of lesions, as `run.lesion()` returns it.")
    task = _only("task", results["task"].unique().tolist())
    of_model = _only("model", results["model"].unique().tolist(), model, "table")
    found = find_metric(metric or preferred_among(results["metric"].unique(), _USUAL_RADIUS))
    measured = results.loc[results["model"] == of_model, "metric"].unique().tolist()
    if found.name not in measured:
        raise UserError(f"The table has no {found.name}; choose a metric from {', '.join(measured)}.")
    axes = _axes(ax, (7.0, 3.4))
    draw_lesions(axes, results, task, found, of_model)
    return axes


@in_python
def plot_channel(
    recording: Recording, ax: Axes | None = None, *, seed: int | None = None, lesion: str | None = None
) -> Axes:
    """Draw the force of the hand on the walls of a channel over time, beside the one that would cancel the field.

    Left of the way to the target is positive. A line is the mean over the trials in a channel, a band their quartiles;
    time counts from the go cue.

    Args:
        recording: from :meth:`Run.record`, of an experiment with a field and a channel.
        ax: where to draw; None for a new figure.
        seed: seed of the network; it may be left out where there is one only.
        lesion: its lesion, likewise.

    Raises:
        UserError: a recording of several networks or lesions and no word on which, one that is not in it, or one
            without trials in a channel.
    """
    rows = _one(recording, seed, lesion)
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
    axes = _axes(ax, (4.5, 3.2))
    draw_channel_force(axes, on_walls, ideal, recording.timestep, _cues(hand, seen)[0])
    axes.set_title(f"{len(rows)} trials, {_words(recording, rows)}", fontsize=10)
    return axes


@in_python
def plot_blocks(blocks: pd.DataFrame, ax: Axes | None = None, *, measure: str = "deviation_at_peak_speed") -> Axes:
    """Draw how networks adapt to a field by block: in the field, with the field off, and in a channel.

    A line is the mean over the seeds, a band its 95 % interval.

    Args:
        blocks: from :meth:`Run.blocks`.
        ax: where to draw; None for a new figure.
        measure: a column of the table, such as "final_error" or "channel_compensation".

    Raises:
        UserError: no such table, or no such column.
    """
    if not isinstance(blocks, pd.DataFrame) or not {"seed", "block", "condition"} <= {*blocks.columns} or blocks.empty:
        raise UserError("--blocks must be a table of blocks, as `run.blocks()` returns it.")
    known = [name for name in MEASURES if name in blocks and blocks[name].notna().any()]
    if measure not in known:
        raise UserError(f"The table has no {measure} by block; choose a measure from {', '.join(known)}.")
    axes = _axes(ax, (4.5, 3.2))
    draw_blocks(axes, blocks, measure)
    return axes


@in_python
def plot_curves(curves: pd.DataFrame, ax: Axes | None = None, *, measure: str | None = None) -> Axes:
    """Draw how networks learned: the mean over the seeds of each model, and its 95 % interval.

    Args:
        curves: from :meth:`Run.curves`, or those of several runs of one task and one way to train, by ``pd.concat``.
        ax: where to draw; None for a new figure.
        measure: a column of the table, such as "final_error_cm"; None for the one that the paper judges the task by.

    Raises:
        UserError: no such table, or no such column.
    """
    if not isinstance(curves, pd.DataFrame) or not {"model", "task", "seed"} <= {*curves.columns} or curves.empty:
        raise UserError("--curves must be a table of trainings, as `run.curves()` returns it.")
    if sum(curves[name].notna().any() for name in learning.PROGRESS if name in curves) != 1:
        raise UserError("Trainings by epochs and by steps have no axis in common; draw each in one of its own.")
    task = _only("task", curves["task"].unique().tolist())
    usual = learning.PREFERRED[_judged_by(task)]
    known = {column.name: column for column in (usual, learning.FINAL_ERROR, learning.VALIDATION_LOSS)}
    name = measure or usual.name
    if name not in curves or not pd.api.types.is_numeric_dtype(curves[name]):
        raise UserError(f"The table has no numbers {name}; choose a measure from its columns.")
    axes = _axes(ax, (5.0, 3.0))
    column = known.get(name, learning.HistoryColumn(name, name.replace("_", " ").capitalize()))
    learning.draw_curves(axes, curves, column)
    return axes


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


def _judged_by(task: str) -> str:
    """Return what a task is judged by that a table names; one that only its user has counts as one of reaching."""
    try:
        return make_task(task).judged_by
    except ValueError:
        return RandomReach.judged_by


def _axes(ax: Axes | None, size: tuple[float, float]) -> Axes:
    """Return the axis to draw into: the given one, or that of a new figure, which a notebook shows."""
    if ax is None:
        from matplotlib import pyplot  # chooses how to show figures, which is the caller's affair if there is an axis

        return pyplot.figure(figsize=size, layout="constrained").subplots()
    if not isinstance(ax, Axes):
        raise UserError(f"--ax must be one axis of matplotlib, such as axes[0], not {type(ax).__name__}.")
    return ax


def _check(recording: Recording) -> None:
    if not isinstance(recording, Recording):
        raise UserError(f"--recording must be one, as `run.record()` returns it, not {type(recording).__name__}.")


def _one(recording: Recording, seed: int | None, lesion: str | None) -> np.ndarray:
    """Return the rows of one network with one lesion. Raises UserError if it is not clear which."""
    _check(recording)
    of_seed = _only("seed", list(dict.fromkeys(recording["seed"].tolist())), seed)
    of_lesion = _only("lesion", list(dict.fromkeys(recording["lesion"].tolist())), lesion)
    rows: np.ndarray = np.flatnonzero((recording["seed"] == of_seed) & (recording["lesion"] == of_lesion))
    return rows


def _only(name: str, present: Sequence[T], chosen: T | None = None, where: str = "recording") -> T:
    """Return the one that is chosen, or the only one that there is. Raises UserError for anything else."""
    words = ", ".join(map(str, present))
    if chosen is None and len(present) > 1:
        raise UserError(f"There are several ({words}): say which by --{name}.")
    if chosen is not None and chosen not in present:
        raise UserError(f"There is no {name} {chosen} in this {where}; choose from {words}.")
    return present[0] if chosen is None else chosen


def _words(recording: Recording, rows: np.ndarray) -> str:
    first = rows[0]
    return f"seed {recording['seed'][first]}, {lesion_words(str(recording['lesion'][first]))}"
