"""Every metric of the studies, as data: what it is called, what it means, in which task, and how it is computed.

A metric's value is that of a seed: the mean over its trials, those left out in which it has no meaning (NaN where it
has none in any). The metrics of a goal carry the goal's radius in their name: ``goal_completion_5cm``. What a reach
comes to is measured from its onset on, the go cue or the jump of the target, and not in trials without a cue. Of the
trials in one condition alone a metric ends with it: ``final_error_in_null``, ``goal_completion_5cm_in_field``.

In trials of two arms a value is the mean over the hands, those that reach or those that hold where it is of one of
both. Of one hand alone a metric ends with it, and with its role in tasks in which it may have either:
``goal_completion_5cm_of_dominant``, ``final_error_of_non_dominant_hold``.
"""

from __future__ import annotations

import functools
import itertools
import re
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bilateral_rl.analysis import experiment_metrics, kinematics, smoothness, two_arm_metrics
from bilateral_rl.analysis.goals import from_centimeters, in_centimeters
from bilateral_rl.analysis.metric import IN, OF, ROLES, Better, GoalMetric, Metric, Part, Role, mean
from bilateral_rl.analysis.trial_parts import cued, over_reaches
from bilateral_rl.analysis.trial_plans import CONDITIONS
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.analysis.two_arm_metrics import TWO_ARMS
from bilateral_rl.envs.tasks import Task, TaskLike, make_task
from bilateral_rl.io.errors import UserError
from bilateral_rl.vocabulary import SIDES, Side

_REACH, _HOLD, _BOTH = ("reach",), ("hold",), ()
_KINDS: dict[str, Role] = {"goal_completion": "reach", "time_in_goal": "hold"}
"""What a task is, by what it is judged by."""
_HANDS: dict[str, tuple[Side, Role | None]] = {
    f"{hand}_{role}" if role else hand: (hand, role) for hand in SIDES for role in (None, *ROLES)
}
"""A hand, perhaps in one role, by how names of metrics end."""
_OF_BOTH_HANDS = "return_"
"""Beginning of metrics that a trial has one of, however many arms it has."""


def metrics_of(task: TaskLike, radii: Sequence[float]) -> list[Metric]:
    """Return all metrics that mean something in ``task``, each once; of mixed trials also those of each condition.

    Args:
        task: a task, or the name of one of those there are.
        radii: goal radii (m) at which the metrics of a goal are wanted.

    Raises:
        UserError: the task does not exist.
    """
    known = _known(task)
    at_radii = [metric.at(radius) for metric in _GOAL_METRICS.values() for radius in radii]
    by_name = {metric.name: metric for metric in (*at_radii, *_TRIAL_METRICS.values())}
    plain = [metric for metric in by_name.values() if means_something(metric, known)]
    plain += [metric.of(hand, role) for hand, role in _hands(known) for metric in plain if _is_of(metric, role)]
    of_any = [metric for metric in plain if "channel" not in metric.needs]
    return plain + [metric.within(condition) for condition in known.mixes for metric in of_any]


def means_something(metric: Metric, task: TaskLike) -> bool:
    """Return whether a task has what a metric needs. Raises UserError if the task does not exist."""
    known = _known(task)
    has = {*_roles(known), *known.features, *((TWO_ARMS, *SIDES) if known.n_arms > 1 else ())}
    return has.issuperset([*metric.needs, *filter(None, (metric.hand, metric.role))])


def find_metric(name: str) -> Metric:
    """Return the metric called ``name``.

    Raises:
        UserError: there is no such metric; the message names those there are.
    """
    plain, _, condition = name.rpartition(IN)
    if condition in CONDITIONS and plain:
        return find_metric(plain).within(condition)
    plain, _, hand = name.rpartition(OF)
    if hand in _HANDS and plain and not plain.startswith(_OF_BOTH_HANDS):
        return find_metric(plain).of(*_HANDS[hand])
    if name in _TRIAL_METRICS:
        return _TRIAL_METRICS[name]
    goal = re.fullmatch(r"(\w+)_(\d{1,99}(?:\.\d{1,99})?)cm", name)
    if goal and goal[1] in _GOAL_METRICS and from_centimeters(goal[2]) > 0:
        return _GOAL_METRICS[goal[1]].at(from_centimeters(goal[2]))
    with_radius = ", ".join(f"{start}_<radius>cm" for start in _GOAL_METRICS)
    raise UserError(
        f"Unknown metric {name!r}; choose from {', '.join(_TRIAL_METRICS)}, or with the goal's radius, as in "
        f"goal_completion_5cm, from {with_radius}; of trials in one condition alone, as in final_error_in_null, with "
        f"{', '.join(IN + condition for condition in CONDITIONS)}; of one hand of two, as in final_error_of_dominant, "
        f"with {', '.join(OF + hand for hand in _HANDS)}."
    )


def metric_name(start: str, radius: float) -> str:
    """Return the name of a metric at a goal of ``radius`` (m), as ``time_in_goal_4.5cm``; without a goal, ``start``.

    :func:`find_metric` finds the metric of every name, of whatever radius.
    """
    return f"{start}_{in_centimeters(radius)}cm" if start in _GOAL_METRICS else start


def preferred_metric(task: TaskLike, radius: float) -> str:
    """Return the name of what a task is judged by, at a goal of ``radius`` (m).

    That is the share of completed reaches, or the time in the goal in a hold, as the paper judges its own (section 7).
    Where trials are mixed it is that of the field's trials, or of those without a field or channel.

    Raises:
        UserError: the task does not exist.
    """
    known = _known(task)
    name = metric_name(known.judged_by, radius)
    return f"{name}{IN}{known.mixes[0]}" if known.mixes else name


def preferred_by_hand(task: TaskLike, radius: float) -> list[str]:
    """Return the names of what each hand of two is judged by in its roles, at a goal of ``radius`` (m).

    A hand that reaches is judged by the share of completed reaches, one that holds by its time in the goal.

    Raises:
        UserError: the task does not exist.
    """
    known = _known(task)
    judged = {role: find_metric(metric_name(start, radius)) for start, role in _KINDS.items()}
    return [judged[role or _roles(known)[0]].of(hand, role).name for hand, role in _hands(known)]


def preferred_among(names: Iterable[str], radius: float) -> str:
    """Return the one of several metrics that :func:`preferred_metric` would name for their task, which is not known.

    Raises:
        UserError: there is none among them.
    """
    there = list(names)
    for start in _KINDS:
        name = metric_name(start, radius)
        for candidate in (f"{name}{IN}field", f"{name}{IN}null", name):
            if candidate in there:
                return candidate
    raise UserError(f"None of the metrics says how well the task is done at {in_centimeters(radius)} cm: name one.")


def measure(record: TrialRecord, metrics: Iterable[Metric]) -> dict[str, float]:
    """Return the value of each of ``metrics`` over all trials of ``record``, by name."""
    parts: dict[Part, TrialRecord | None] = {}  # each is picked once: that takes longer than most metrics
    values = {}
    for metric in metrics:
        if metric.part not in parts:
            parts[metric.part] = metric.part.of(record)
        values[metric.name] = metric.value_in(parts[metric.part])
    return values


def _roles(task: Task) -> tuple[Role, ...]:
    """What the hands do in a task."""
    return tuple(role for role in ROLES if role in task.roles)


def _hands(task: Task) -> list[tuple[Side, Role | None]]:
    """The hands of a task of two arms, by role where both have either."""
    if task.n_arms == 1:
        return []
    return list(itertools.product(SIDES, ROLES if len(task.roles) > 1 else (None,)))


def _is_of(metric: Metric, role: Role | None) -> bool:
    """Whether a metric is told by hand, in a role."""
    return not metric.name.startswith(_OF_BOTH_HANDS) and (role is None or metric.part.role in (role, None))


def _known(task: TaskLike) -> Task:
    try:
        return make_task(task)
    except ValueError as error:
        raise UserError(str(error)) from None


def _of_measures(name: str, record: TrialRecord, radius: float) -> ArrayLike:
    """Return a field of :class:`~bilateral_rl.envs.measures.TrialMeasures` of the trials that have a cue."""
    values: ArrayLike = getattr(cued(record).measures(radius), name)
    return values


def _goal_metric(
    name: str, label: str, unit: str, scale: float, needs: tuple[str, ...], definition: str, better: Better = "higher"
) -> GoalMetric:
    return GoalMetric(name, label, unit, scale, needs, definition, functools.partial(_of_measures, name), better)


# fmt: off
_GOAL_METRICS: dict[str, GoalMetric] = {metric.start: metric for metric in (
    _goal_metric("goal_completion", "Goal completion within", "%", 100, _REACH,
                 "Share of trials whose hand comes within the goal's radius of the target and stays for three "
                 "consecutive steps (paper section 3)."),
    _goal_metric("speed_to_goal", "Speed to goal of", "cm/step", 100, _REACH,
                 "Distance from start to target over the steps until the goal is reached, in the trials that complete "
                 "it (paper section 3)."),
    _goal_metric("speed_to_third_step", "Speed to the third step within", "cm/step", 100, _REACH,
                 "Distance from start to target over the steps until the third one within the goal, in the trials that "
                 "complete it (paper section 3, which does not say at which of the three steps the goal is reached)."),
    _goal_metric("time_to_goal", "Time to goal of", "steps", 1, _REACH,
                 "Steps until the goal is reached, all of the trial's where it is not: the restricted mean time, which "
                 "no choice of trials biases (Royston & Parmar 2013, doi:10.1186/1471-2288-13-152).", "lower"),
    _goal_metric("time_in_goal", "Time within", "steps", 1, _BOTH,
                 "Steps after which the hand is within the goal's radius of the target (paper section 3)."),
    *experiment_metrics.GOAL_METRICS,
)}
# fmt: on
"""Metrics of a goal, by the start of their names."""


def _reach_metric(
    name: str, label: str, unit: str, needs: tuple[str, ...], better: Better, definition: str,
    of_reaches: Callable[[TrialRecord], ArrayLike], scale: float = 1.0,
) -> Metric:  # fmt: skip
    """Return the mean over the trials, each from its onset on."""
    return Metric(
        name, label, unit, needs, better, definition, lambda record: mean(over_reaches(record, of_reaches), scale)
    )


def _speed(record: TrialRecord) -> NDArray[np.float64]:
    return kinematics.hand_speed(record.hand, record.arm.timestep)


# fmt: off
_TRIAL_METRICS: dict[str, Metric] = {metric.name: metric for metric in (
    Metric("final_error", "Final error", "cm", _BOTH, "lower",
           "Distance from hand to target after the last step (paper section 3).",
           lambda record: mean(cued(record).distance[:, -1], 100)),
    Metric("end_point_variability", "End-point variability", "cm", _BOTH, "lower",
           "Root mean squared distance of the trials' end-point errors from their mean, the bivariate variable error "
           "(Hancock et al. 1995, doi:10.1080/00222895.1995.9941714).",
           lambda record: 100 * kinematics.end_point_variability(cued(record).hand, cued(record).target)),
    _reach_metric("path_length_ratio", "Path length ratio", "", _REACH, "lower",
                  "Length of the hand's path over the straight distance from start to target; 1 is straight, less "
                  "fell short (Coderre et al. 2010, doi:10.1177/1545968309356091).",
                  lambda record: kinematics.path_length_ratio(record.hand, record.target)),
    _reach_metric("perpendicular_deviation", "Maximal perpendicular deviation", "cm", _REACH, "lower",
                  "Largest distance of the hand from the line through start and target "
                  "(Atkeson & Hollerbach 1985, doi:10.1523/JNEUROSCI.05-09-02318.1985).",
                  lambda record: kinematics.perpendicular_deviation(record.hand, record.target), 100),
    _reach_metric("initial_direction_error", "Initial direction error", "deg", _REACH, "lower",
                  "Angle between the directions from the start to the target and to the hand at peak speed "
                  "(Krakauer et al. 2000, doi:10.1523/JNEUROSCI.20-23-08916.2000).",
                  lambda record: np.degrees(kinematics.initial_direction_error(record.hand, record.target))),
    _reach_metric("peak_speed", "Peak hand speed", "cm/s", _REACH, None,
                  "Speed of the hand in its fastest step (Coderre et al. 2010, doi:10.1177/1545968309356091).",
                  lambda record: kinematics.peak_speed(record.hand, record.arm.timestep), 100),
    _reach_metric("time_to_peak_speed", "Time to peak hand speed", "ms", _REACH, None,
                  "Time from the start of the trial to the middle of the hand's fastest step "
                  "(Messier & Kalaska 1999, doi:10.1007/s002210050669).",
                  lambda record: kinematics.time_to_peak_speed(record.hand, record.arm.timestep), 1000),
    _reach_metric("sparc", "Smoothness (SPARC)", "", _REACH, "higher",
                  "Spectral arc length of the hand's speed over the whole trial "
                  "(Balasubramanian et al. 2015, doi:10.1186/s12984-015-0090-9).",
                  lambda record: smoothness.sparc(_speed(record), record.arm.timestep)),
    _reach_metric("ldlj", "Smoothness (LDLJ)", "", _REACH, "higher",
                  "Log dimensionless jerk of the hand's speed over the whole trial "
                  "(Balasubramanian et al. 2015, doi:10.1186/s12984-015-0090-9).",
                  lambda record: smoothness.ldlj(_speed(record), record.arm.timestep)),
    _reach_metric("hold_rms_error", "RMS error in hold", "cm", _HOLD, "lower",
                  "Root mean squared distance from hand to target after each step, from the first to the last (ours).",
                  lambda record: kinematics.rms_error(record.hand, record.target), 100),
    _reach_metric("hold_speed", "Hand speed in hold", "cm/s", _HOLD, "lower",
                  "Mean speed of the hand over all steps, the posture speed "
                  "(Coderre et al. 2010, doi:10.1177/1545968309356091).",
                  lambda record: kinematics.mean_speed(record.hand, record.arm.timestep), 100),
    Metric("effort", "Effort", "s", _BOTH, "lower",
           "Integral over the trial of the sum of the muscles' squared excitations "
           "(Pedotti et al. 1978, doi:10.1016/0025-5564(78)90018-4).",
           lambda record: mean(kinematics.effort(record.excitation, record.arm.timestep))),
    Metric("force_effort", "Effort scaled by maximal force", "s", _BOTH, "lower",
           "Integral over the trial of the sum of squares of the excitations, each times its muscle's maximal "
           "force over the mean maximal force "
           "(Pedotti et al. 1978, doi:10.1016/0025-5564(78)90018-4).",
           lambda record: mean(kinematics.force_effort(
               record.excitation, record.arm.max_isometric_force, record.arm.timestep))),
    Metric("return_dominant", "Return of the dominant reward", "", _BOTH, "higher",
           "Sum of the rewards that stand for the dominant loss (paper section 4).",
           lambda record: mean(record.vector_return[:, 0])),
    Metric("return_non_dominant", "Return of the non-dominant reward", "", _BOTH, "higher",
           "Sum of the rewards that stand for the non-dominant loss (paper section 4).",
           lambda record: mean(record.vector_return[:, 1])),
    *experiment_metrics.TRIAL_METRICS,
    *two_arm_metrics.TRIAL_METRICS,
)}
# fmt: on
