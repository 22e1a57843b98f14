"""Figures of trials: the hand's paths and speeds, and the muscles' activity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bilateral_rl.analysis.kinematics import hand_speed
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.envs.arm.parameters import MUSCLE_NAMES
from bilateral_rl.figures.bands import BANDS_NOTE, draw_band
from bilateral_rl.figures.center_out import center_out, has_few_targets, reaches_by_force, reaches_of
from bilateral_rl.figures.hands import by_hand_and_role, draw_paths_of_two
from bilateral_rl.figures.labels import model_label
from bilateral_rl.figures.recordings import draw_paths
from bilateral_rl.figures.style import (
    families,
    in_order,
    legend_above,
    model_style,
    new_figure,
    set_note,
    set_title,
    set_title_and_legend,
    style_axes,
)

Records = Mapping[str, Sequence[TrialRecord]]
"""Trials by model, a record a seed."""


def hand_paths(record: TrialRecord, radius: float, reach: float, n_trials: int = 12) -> Figure:
    """Draw the hand's paths in the first trials: start as a dot, goal as a disc, one color a trial.

    Where all trials together repeat a few targets, all are drawn around the start, with a panel for each kind of force.
    Of two arms both hands are drawn, in the frame of the body, each in its own color or its own panels.

    Args:
        record: the trials.
        radius: radius of the goal (m).
        reach: length of the stretched arm (m).
        n_trials: how many trials to draw.
    """
    n_all = len(record.hand) // record.n_arms
    if has_few_targets(reaches_of(record)):
        conditions = reaches_by_force(record)
        if [*conditions] == ["null"]:
            conditions = {"": conditions["null"]}  # a word for nothing, where there is nothing else
        return center_out(conditions, radius, f"Hand paths of {n_all} trials")
    figure = Figure(figsize=(5, 4.2) if record.n_arms == 1 else (6.5, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes, n = figure.subplots(), min(n_trials, n_all)
    if record.shoulder_distance is None:
        draw_paths(axes, record.hand[:n], record.target[:n], radius, reach)
    else:
        draw_paths_of_two(axes, *_by_arm(record, n), radius, reach, record.shoulder_distance)
    axes.set_title(f"Hand paths of {n} trials", fontsize=10)
    return figure


def _by_arm(record: TrialRecord, n: int) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.str_]]:
    """Return hands, targets and roles of the first trials as (n, …, 2 arms, …), in the frame of the body."""
    rows = slice(0, n * record.n_arms)
    hand = record.body_positions(record.hand)[rows].reshape(n, record.n_arms, -1, 2)
    target = record.body_positions(record.target)[rows].reshape(n, record.n_arms, 2)
    return hand.swapaxes(1, 2), target, record.plan.role[rows].reshape(n, record.n_arms)


def speed_profiles(records: Records, title: str) -> Figure:
    """Draw the hand's speed over time, mean and quartiles over the trials of all seeds, a panel an architecture.

    Of two arms each hand has a row of panels in each of its roles.

    Args:
        records: trials of equal length, by model.
        title: title of the figure, with the task.
    """
    groups, parts = families(records), _parts(records)
    figure = new_figure(2.9 + 1.7 * (len(parts) - 1))
    grid = figure.subplots(len(parts), len(groups), sharex=True, sharey="row", squeeze=False)
    for i, part in enumerate(parts):
        for axes, models in zip(grid[i], groups, strict=True):
            for index, model in enumerate(models):
                speed = np.concatenate([_speeds(record, part) for record in records[model]])
                middles = (np.arange(speed.shape[1]) + 0.5) * _milliseconds(records[model])
                draw_band(axes, middles, speed, model_style(model), model_label(model), index)
            label = "\n".join(filter(None, ("Hand speed (cm/s)", part)))
            style_axes(axes, "Time (ms)" * (i == len(parts) - 1), label * (axes is grid[i, 0]))
            axes.set_ylim(bottom=0)
            if i == 0:
                legend_above(axes)
    set_title(figure, title)
    set_note(figure, BANDS_NOTE)
    return figure


def muscle_activity(records: Records, title: str) -> Figure:
    """Draw the six muscles' activation over time, mean and quartiles over the trials of all seeds, a panel a muscle.

    Of two arms each hand has its panels, a row for each of its roles.

    Args:
        records: trials of equal length, by model; more than three lie over each other.
        title: title of the figure, with the task.
    """
    parts = _parts(records)
    rows, columns = (2, len(MUSCLE_NAMES) // 2) if parts == [""] else (len(parts), len(MUSCLE_NAMES))
    figure = new_figure(4.6 if parts == [""] else 1.4 + 1.3 * rows)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    words = " " if parts == [""] else "\n"  # of muscles, in narrow panels
    of_parts = panels.reshape(len(parts), -1)
    for index, model in enumerate(in_order(records)):
        for part, row in zip(parts, of_parts, strict=True):
            activation = np.concatenate(
                [record.activation[by_hand_and_role(record)[part]] for record in records[model]]
            )
            ends = (np.arange(activation.shape[1]) + 1) * _milliseconds(records[model])
            for muscle, axes in enumerate(row):
                draw_band(axes, ends, activation[..., muscle], model_style(model), model_label(model), index)
    for i, axes in enumerate(panels.flat):
        of_part, muscle = divmod(i, len(MUSCLE_NAMES))
        is_left, is_low = i % columns == 0, i >= panels.size - columns
        label = parts[of_part].replace(" hand", "\nhand") or "Activation (0 to 1)"
        style_axes(
            axes, "Time (ms)" * is_low, label * is_left, MUSCLE_NAMES[muscle].replace(" ", words) * (of_part == 0)
        )
    panels[0, 0].set_ylim(bottom=0)
    set_title_and_legend(figure, title, *panels[0, 0].get_legend_handles_labels())
    set_note(figure, BANDS_NOTE if parts == [""] else f"Activation, 0 to 1. {BANDS_NOTE}")
    return figure


def _parts(records: Records) -> list[str]:
    """Return what each panel is of, in words: a hand in a role; nothing where there is one arm."""
    return list(by_hand_and_role(next(iter(records.values()))[0]))


def _speeds(record: TrialRecord, part: str) -> NDArray[np.float64]:
    return 100 * hand_speed(record.hand[by_hand_and_role(record)[part]], record.arm.timestep)


def _milliseconds(records: Sequence[TrialRecord]) -> float:
    return 1000 * records[0].arm.timestep
