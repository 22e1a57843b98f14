"""The metrics of what experiments have beyond the paper's tasks: cues, jumps, pulses, fields and channels, as data."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bilateral_rl.analysis import channels, responses
from bilateral_rl.analysis.metric import GoalMetric, Metric, mean
from bilateral_rl.analysis.trial_parts import chosen, over_reaches, since
from bilateral_rl.analysis.trial_records import TrialRecord

Float64 = NDArray[np.float64]
_CUE, _JUMP, _PULSE, _CHANNEL = ("cue",), ("jump",), ("pulse",), ("channel",)
_DEVIATION = ("reach", "field")


def _jump_latency(record: TrialRecord) -> Float64:
    shift = record.target - record.plan.goal
    return responses.jump_latency(record.hand, record.plan.jump, shift, record.arm.timestep)


def _pulse_latency(record: TrialRecord) -> Float64:
    plan = record.plan
    return responses.pulse_latency(record.hand, plan.pulse_force, plan.pulse[:, 0], record.arm.timestep)


def _on_walls(record: TrialRecord, measure: Callable[[TrialRecord], ArrayLike]) -> Float64:
    """(n,): a measure of channel trials from their cue on; NaN of others, and of those in which a pulse comes."""
    values = np.full(len(record.target), np.nan)
    plan = record.plan
    rows = plan.has("channel") & ~plan.has("pulse") & (plan.go < record.distance.shape[1])
    for step in np.unique(plan.go[rows]):
        at_once = rows & (plan.go == step)
        values[at_once] = measure(since(chosen(record, at_once), int(step)))
    return values


def _walls(record: TrialRecord) -> Float64:
    return np.asarray(record.force, dtype=np.float64) - record.load[:, None]


# fmt: off
GOAL_METRICS: tuple[GoalMetric, ...] = (
    GoalMetric("jump_return_time", "Time to stay, after the jump, within", "ms", 1000, _JUMP,
               "Time from the jump of the target until the hand stays within the goal's radius of it, all that is left "
               "where it does not (ours).",
               lambda record, radius: responses.return_time(
                   record.distance, record.plan.jump, radius, record.arm.timestep), "lower"),
    GoalMetric("pulse_return_time", "Time to stay, after the pulse, within", "ms", 1000, _PULSE,
               "Time from the beginning of the pulse until the hand stays within the goal's radius of the target, all "
               "that is left where it does not (ours).",
               lambda record, radius: responses.return_time(
                   record.distance, record.plan.pulse[:, 0], radius, record.arm.timestep), "lower"),
)
TRIAL_METRICS: tuple[Metric, ...] = (
    Metric("reaction_time", "Reaction time", "ms", _CUE, "lower",
           "Time from the cue to the first step in which the hand's speed exceeds a twentieth of its highest from the "
           "cue on (a threshold as reviewed by Botzer & Karniel 2009, doi:10.3389/neuro.20.002.2009).",
           lambda record: mean(responses.reaction_time(record.hand, record.plan.go, record.arm.timestep), 1000)),
    Metric("premature_movement", "Movement before the cue", "cm", _CUE, "lower",
           "Largest distance of the hand from its start before the cue, in the whole trial where none comes (ours).",
           lambda record: mean(responses.premature_movement(record.hand, record.plan.go), 100)),
    Metric("pre_cue_error", "Error before the cue", "cm", _CUE, "lower",
           "Mean distance of the hand from its start over the steps before the cue, over all where none comes (ours).",
           lambda record: mean(responses.hold_error(record.distance, record.plan.go), 100)),
    Metric("pre_cue_speed", "Hand speed before the cue", "cm/s", _CUE, "lower",
           "Mean speed of the hand over the steps before the cue, over all where none comes: the posture speed "
           "(Coderre et al. 2010, doi:10.1177/1545968309356091).",
           lambda record: mean(responses.hold_speed(record.hand, record.plan.go, record.arm.timestep), 100)),
    Metric("jump_latency", "Latency of the answer to the jump", "ms", _JUMP, "lower",
           "Time from the jump of the target until the hand's velocity along the jump has risen by a twentieth of what "
           "it rises by (on thresholds, Oostwoud Wijdenes et al. 2014, doi:10.3758/s13428-013-0349-7).",
           lambda record: mean(_jump_latency(record), 1000)),
    Metric("pulse_deviation", "Deviation after the pulse", "cm", _PULSE, "lower",
           "Largest distance of the hand, from the pulse on, from the line through start and goal, or from the goal in "
           "a hold (ours).",
           lambda record: mean(responses.pulse_deviation(record.hand, record.plan.goal, record.plan.pulse[:, 0]), 100)),
    Metric("pulse_latency", "Latency of the answer to the pulse", "ms", _PULSE, "lower",
           "Time from the beginning of the pulse until the hand no longer goes along with it: its velocity along the "
           "pulse is back at what it was before (ours).",
           lambda record: mean(_pulse_latency(record), 1000)),
    Metric("deviation_at_peak_speed", "Deviation at peak speed, left is positive", "cm", _DEVIATION, None,
           "Distance of the hand from the line through start and target at peak speed, positive to the left of the way "
           "there (Smith et al. 2006, doi:10.1371/journal.pbio.0040179).",
           lambda record: mean(over_reaches(
               record, lambda reach: channels.deviation_at_peak_speed(reach.hand, reach.target)), 100)),
    Metric("signed_deviation", "Largest deviation, left is positive", "cm", _DEVIATION, None,
           "Distance of the hand from the line through start and target where it is largest, positive to the left of "
           "the way there: after-effects lie opposite to what the field first did "
           "(Shadmehr & Mussa-Ivaldi 1994, doi:10.1523/JNEUROSCI.14-05-03208.1994).",
           lambda record: mean(over_reaches(
               record, lambda reach: channels.largest_deviation(reach.hand, reach.target)), 100)),
    Metric("channel_peak_force", "Peak force on the channel, left is positive", "N", _CHANNEL, None,
           "Force of the hand on the channel's wall where it is largest, positive to the left of the way to the target "
           "(Scheidt et al. 2000, doi:10.1152/jn.2000.84.2.853).",
           lambda record: mean(_on_walls(
               record, lambda reach: channels.peak_force(_walls(reach), reach.plan.start, reach.plan.goal)))),
    Metric("channel_compensation", "Share of the field compensated", "", (*_CHANNEL, "field"), "higher",
           "Regression coefficient of the force on the channel's wall on the force that would cancel the field at the "
           "hand's velocity; 1 is full compensation (Smith et al. 2006, doi:10.1371/journal.pbio.0040179).",
           lambda record: mean(_on_walls(
               record, lambda reach: channels.compensation(
                   _walls(reach), reach.field_force, reach.plan.start, reach.plan.goal)))),
)
# fmt: on
