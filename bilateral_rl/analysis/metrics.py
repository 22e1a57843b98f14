"""Every metric of the studies, as data: what it is called, what it means, in which task, and how it is computed.

A metric's value is that of a seed: the mean over its trials, those left out in which it has no meaning (NaN where it
has none in any). The metrics of a goal carry the goal's radius in their name: ``goal_completion_5cm``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bilateral_rl.analysis import kinematics, smoothness
from bilateral_rl.analysis.goals import from_centimeters, in_centimeters
from bilateral_rl.analysis.trials import TrialRecord
from bilateral_rl.config.catalogue import check_choice
from bilateral_rl.envs.measures import trial_measures
from bilateral_rl.envs.task_specs import TASK_SPECS
from bilateral_rl.envs.tasks import HoldPosition, RandomReach
from bilateral_rl.io.errors import UserError

_REACH, _HOLD = (RandomReach.id,), (HoldPosition.id,)
_BOTH = _REACH + _HOLD


@dataclass(frozen=True)
class Metric:
    """One number that sums up the trials of one seed."""

    name: str
    """What tables and commands call it."""
    label: str
    """Words for axes and reports, without the unit."""
    unit: str
    """Unit of the value; empty for a pure number."""
    tasks: tuple[str, ...]
    """Ids of the tasks in which it means something."""
    better: Literal["higher", "lower"] | None
    """Which values are better; None if neither."""
    definition: str
    """One sentence, with its source."""
    value: Callable[[TrialRecord], float]
    """Computes the value of a seed from all its trials; NaN where no trial has one."""


def metrics_of(task: str, radii: Sequence[float]) -> list[Metric]:
    """Return all metrics that mean something in ``task``, each once.

    Args:
        task: id of the task.
        radii: goal radii (m) at which the metrics of a goal are wanted.

    Raises:
        UserError: the task does not exist.
    """
    check_choice("task", task, TASK_SPECS)
    at_radii = [metric.at(radius) for metric in _GOAL_METRICS.values() for radius in radii]
    by_name = {metric.name: metric for metric in (*at_radii, *_TRIAL_METRICS.values())}
    return [metric for metric in by_name.values() if task in metric.tasks]


def find_metric(name: str) -> Metric:
    """Return the metric called ``name``.

    Raises:
        UserError: there is no such metric; the message names those there are.
    """
    if name in _TRIAL_METRICS:
        return _TRIAL_METRICS[name]
    goal = re.fullmatch(r"(\w+)_(\d{1,99}(?:\.\d{1,99})?)cm", name)
    if goal and goal[1] in _GOAL_METRICS and from_centimeters(goal[2]) > 0:
        return _GOAL_METRICS[goal[1]].at(from_centimeters(goal[2]))
    with_radius = ", ".join(f"{start}_<radius>cm" for start in _GOAL_METRICS)
    raise UserError(
        f"Unknown metric {name!r}; choose from {', '.join(_TRIAL_METRICS)}, or with the goal's radius, as in "
        f"goal_completion_5cm, from {with_radius}."
    )


def metric_name(start: str, radius: float) -> str:
    """Return the name of a metric at a goal of ``radius`` (m), as ``time_in_goal_4.5cm``; without a goal, ``start``.

    :func:`find_metric` finds the metric of every name, of whatever radius.
    """
    return f"{start}_{in_centimeters(radius)}cm" if start in _GOAL_METRICS else start


def preferred_metric(task: str, radius: float) -> str:
    """Return the name of what the paper judges ``task`` by (section 7), at a goal of ``radius`` (m).

    That is the share of completed reaches, or the time in the goal in a hold.

    Raises:
        UserError: the task does not exist.
    """
    check_choice("task", task, TASK_SPECS)
    return metric_name(TASK_SPECS[task].judged_by, radius)


def measure(record: TrialRecord, metrics: Iterable[Metric]) -> dict[str, float]:
    """Return the value of each of ``metrics`` over all trials of ``record``, by name."""
    return {metric.name: metric.value(record) for metric in metrics}


def _mean(values: ArrayLike, scale: float = 1.0) -> float:
    """``scale`` times the mean of the values that are not NaN; NaN where all are."""
    numbers = np.asarray(values, dtype=np.float64)
    numbers = numbers[~np.isnan(numbers)]
    return scale * float(numbers.mean()) if len(numbers) else float("nan")


@dataclass(frozen=True)
class _GoalMetric:
    """A field of :class:`~bilateral_rl.envs.measures.TrialMeasures`, averaged: a metric at each radius of the goal."""

    field: str
    label: str
    unit: str
    scale: float
    tasks: tuple[str, ...]
    definition: str
    better: Literal["higher", "lower"] = "higher"

    def at(self, radius: float) -> Metric:
        """Return the metric at a goal of ``radius`` (m), as exact as its name says it."""
        centimeters = in_centimeters(radius)
        named_radius = from_centimeters(centimeters)

        def value(record: TrialRecord) -> float:
            measures = trial_measures(record.distance, record.start_distance, named_radius)
            return _mean(getattr(measures, self.field), self.scale)

        name, label = f"{self.field}_{centimeters}cm", f"{self.label} {centimeters} cm"
        return Metric(name, label, self.unit, self.tasks, self.better, self.definition, value)


# fmt: off
_GOAL_METRICS: dict[str, _GoalMetric] = {metric.field: metric for metric in (
    _GoalMetric("goal_completion", "Goal completion within", "%", 100, _REACH,
                "Share of trials whose hand comes within the goal's radius of the target and stays for three "
                "consecutive steps (paper section 3)."),
    _GoalMetric("speed_to_goal", "Speed to goal of", "cm/step", 100, _REACH,
                "Distance from start to target over the steps until the goal is reached, in the trials that complete "
                "it (paper section 3)."),
    _GoalMetric("speed_to_third_step", "Speed to the third step within", "cm/step", 100, _REACH,
                "Distance from start to target over the steps until the third one within the goal, in the trials that "
                "complete it (paper section 3, which does not say at which of the three steps the goal is reached)."),
    _GoalMetric("time_to_goal", "Time to goal of", "steps", 1, _REACH,
                "Steps until the goal is reached, all of the trial's where it is not: the restricted mean time, which "
                "no choice of trials biases (Royston & Parmar 2013, doi:10.1186/1471-2288-13-152).", "lower"),
    _GoalMetric("time_in_goal", "Time within", "steps", 1, _BOTH,
                "Steps after which the hand is within the goal's radius of the target (paper section 3)."),
)}
# fmt: on
"""Metrics of a goal, by the start of their names."""


def _speed(record: TrialRecord) -> NDArray[np.float64]:
    return kinematics.hand_speed(record.hand, record.arm.timestep)


# fmt: off
_TRIAL_METRICS: dict[str, Metric] = {metric.name: metric for metric in (
    Metric("final_error", "Final error", "cm", _BOTH, "lower",
           "Distance from hand to target after the last step (paper section 3).",
           lambda record: _mean(record.distance[:, -1], 100)),
    Metric("end_point_variability", "End-point variability", "cm", _BOTH, "lower",
           "Root mean squared distance of the trials' end-point errors from their mean, the bivariate variable error "
           "(Hancock et al. 1995, doi:10.1080/00222895.1995.9941714).",
           lambda record: 100 * kinematics.end_point_variability(record.hand, record.target)),
    Metric("path_length_ratio", "Path length ratio", "", _REACH, "lower",
           "Length of the hand's path over the straight distance from start to target; 1 is straight, less fell short "
           "(Coderre et al. 2010, doi:10.1177/1545968309356091).",
           lambda record: _mean(kinematics.path_length_ratio(record.hand, record.target))),
    Metric("perpendicular_deviation", "Maximal perpendicular deviation", "cm", _REACH, "lower",
           "Largest distance of the hand from the line through start and target "
           "(Atkeson & Hollerbach 1985, doi:10.1523/JNEUROSCI.05-09-02318.1985).",
           lambda record: _mean(kinematics.perpendicular_deviation(record.hand, record.target), 100)),
    Metric("initial_direction_error", "Initial direction error", "deg", _REACH, "lower",
           "Angle between the directions from the start to the target and to the hand at peak speed "
           "(Krakauer et al. 2000, doi:10.1523/JNEUROSCI.20-23-08916.2000).",
           lambda record: _mean(np.degrees(kinematics.initial_direction_error(record.hand, record.target)))),
    Metric("peak_speed", "Peak hand speed", "cm/s", _REACH, None,
           "Speed of the hand in its fastest step (Coderre et al. 2010, doi:10.1177/1545968309356091).",
           lambda record: _mean(kinematics.peak_speed(record.hand, record.arm.timestep), 100)),
    Metric("time_to_peak_speed", "Time to peak hand speed", "ms", _REACH, None,
           "Time from the start of the trial to the middle of the hand's fastest step "
           "(Messier & Kalaska 1999, doi:10.1007/s002210050669).",
           lambda record: _mean(kinematics.time_to_peak_speed(record.hand, record.arm.timestep), 1000)),
    Metric("sparc", "Smoothness (SPARC)", "", _REACH, "higher",
           "Spectral arc length of the hand's speed over the whole trial "
           "(Balasubramanian et al. 2015, doi:10.1186/s12984-015-0090-9).",
           lambda record: _mean(smoothness.sparc(_speed(record), record.arm.timestep))),
    Metric("ldlj", "Smoothness (LDLJ)", "", _REACH, "higher",
           "Log dimensionless jerk of the hand's speed over the whole trial "
           "(Balasubramanian et al. 2015, doi:10.1186/s12984-015-0090-9).",
           lambda record: _mean(smoothness.ldlj(_speed(record), record.arm.timestep))),
    Metric("hold_rms_error", "RMS error in hold", "cm", _HOLD, "lower",
           "Root mean squared distance from hand to target after each step, from the first to the last (ours).",
           lambda record: _mean(kinematics.rms_error(record.hand, record.target), 100)),
    Metric("hold_speed", "Hand speed in hold", "cm/s", _HOLD, "lower",
           "Mean speed of the hand over all steps, the posture speed "
           "(Coderre et al. 2010, doi:10.1177/1545968309356091).",
           lambda record: _mean(kinematics.mean_speed(record.hand, record.arm.timestep), 100)),
    Metric("effort", "Effort", "s", _BOTH, "lower",
           "Integral over the trial of the sum of the muscles' squared excitations "
           "(Pedotti et al. 1978, doi:10.1016/0025-5564(78)90018-4).",
           lambda record: _mean(kinematics.effort(record.excitation, record.arm.timestep))),
    Metric("force_effort", "Effort scaled by maximal force", "s", _BOTH, "lower",
           "Integral over the trial of the sum of squares of the excitations, each times its muscle's maximal "
           "force over the mean maximal force "
           "(Pedotti et al. 1978, doi:10.1016/0025-5564(78)90018-4).",
           lambda record: _mean(kinematics.force_effort(
               record.excitation, record.arm.max_isometric_force, record.arm.timestep))),
    Metric("return_dominant", "Return of the dominant reward", "", _BOTH, "higher",
           "Sum of the rewards that stand for the dominant loss (paper section 4).",
           lambda record: _mean(record.vector_return[:, 0])),
    Metric("return_non_dominant", "Return of the non-dominant reward", "", _BOTH, "higher",
           "Sum of the rewards that stand for the non-dominant loss (paper section 4).",
           lambda record: _mean(record.vector_return[:, 1])),
)}
# fmt: on
