"""Figures of trials: the hand's paths and speeds, and the muscles' activity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bilateral_rl.analysis.kinematics import hand_speed
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.envs.arm.parameters import MUSCLE_NAMES
from bilateral_rl.figures.bands import BANDS_NOTE, draw_band
from bilateral_rl.figures.center_out import center_out, has_few_targets, reaches_by_force, reaches_of
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

    Args:
        record: the trials.
        radius: radius of the goal (m).
        reach: length of the stretched arm (m).
        n_trials: how many trials to draw.
    """
    if has_few_targets(reaches_of(record)):
        conditions = reaches_by_force(record)
        if [*conditions] == ["null"]:
            conditions = {"": conditions["null"]}  # a word for nothing, where there is nothing else
        return center_out(conditions, radius, f"Hand paths of {len(record.hand)} trials")
    figure = Figure(figsize=(5, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    draw_paths(axes, record.hand[:n_trials], record.target[:n_trials], radius, reach)
    axes.set_title(f"Hand paths of {min(n_trials, len(record.hand))} trials", fontsize=10)
    return figure


def speed_profiles(records: Records, title: str) -> Figure:
    """Draw the hand's speed over time, mean and quartiles over the trials of all seeds, a panel an architecture.

    Args:
        records: trials of equal length, by model.
        title: title of the figure, with the task.
    """
    groups = families(records)
    figure = new_figure(2.9)
    panels = figure.subplots(1, len(groups), sharey=True, squeeze=False)[0]
    for axes, models in zip(panels, groups, strict=True):
        for index, model in enumerate(models):
            speed = np.concatenate([100 * hand_speed(r.hand, r.arm.timestep) for r in records[model]])
            middles = (np.arange(speed.shape[1]) + 0.5) * _milliseconds(records[model])
            draw_band(axes, middles, speed, model_style(model), model_label(model), index)
        style_axes(axes, "Time (ms)", "Hand speed (cm/s)" if axes is panels[0] else "")
        axes.set_ylim(bottom=0)
        legend_above(axes)
    set_title(figure, title)
    set_note(figure, BANDS_NOTE)
    return figure


def muscle_activity(records: Records, title: str) -> Figure:
    """Draw the six muscles' activation over time, mean and quartiles over the trials of all seeds, a panel a muscle.

    Args:
        records: trials of equal length, by model; more than three lie over each other.
        title: title of the figure, with the task.
    """
    figure = new_figure(4.6)
    panels = figure.subplots(2, len(MUSCLE_NAMES) // 2, sharex=True, sharey=True)
    for index, model in enumerate(in_order(records)):
        activation = np.concatenate([record.activation for record in records[model]])
        ends = (np.arange(activation.shape[1]) + 1) * _milliseconds(records[model])
        for muscle, axes in enumerate(panels.flat):
            draw_band(axes, ends, activation[..., muscle], model_style(model), model_label(model), index)
    for muscle, axes in enumerate(panels.flat):
        is_left, is_low = muscle % panels.shape[1] == 0, muscle >= panels.shape[1]
        style_axes(axes, "Time (ms)" * is_low, "Activation (0 to 1)" * is_left, MUSCLE_NAMES[muscle])
    panels[0, 0].set_ylim(bottom=0)
    set_title_and_legend(figure, title, *panels[0, 0].get_legend_handles_labels())
    set_note(figure, BANDS_NOTE)
    return figure


def _milliseconds(records: Sequence[TrialRecord]) -> float:
    return 1000 * records[0].arm.timestep
