"""What is recorded of trials of a trained policy, and what they come to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from bilateral_rl.analysis.goals import REPORTED_RADII, distinct_radii
from bilateral_rl.analysis.trial_plans import TrialPlan
from bilateral_rl.envs.arm import ArmParameters
from bilateral_rl.envs.measures import TrialMeasures, trial_measures
from bilateral_rl.envs.tasks import NEVER

Float32 = NDArray[np.float32]


@dataclass(frozen=True)
class TrialRecord:
    """``n`` trials of ``T`` steps, in float32."""

    joint: Float32
    """(n, T + 1, 2): angles of shoulder and elbow at the start and after each step (rad)."""
    hand: Float32
    """(n, T + 1, 2): position of the hand at the start and after each step (m), the shoulder at the origin."""
    target: Float32
    """(n, 2): position of the last target (m): the goal, or where it jumped to; the start where no cue came."""
    seen_target: Float32
    """(n, T, 2): position of the target that is seen before each step (m)."""
    load: Float32
    """(n, 2): constant force on the hand (N)."""
    force: Float32
    """(n, T, 2): whole force on the hand in each step (N): load, fields, pulse and channel."""
    field_force: Float32
    """(n, T, 2): force that the field of the experiment has for the hand's position and velocity before each step (N),
    also in trials in which it is off, or a channel takes its place; 0 without a field."""
    distance: Float32
    """(n, T): distance after each step from the hand to the target that is seen before it (m)."""
    start_distance: Float32
    """(n,): distance from hand to target (m) when the last target began: at the start, the go cue, or the jump."""
    observation: Float32
    """(n, T, 16): what the policy saw before each step, in the units of :class:`~bilateral_rl.envs.ArmEnv`."""
    excitation: Float32
    """(n, T, 6): commands to the muscles in each step, in [0, 1]."""
    activation: Float32
    """(n, T, 6): activation of the muscles after each step, in [0, 1]."""
    vector_return: Float32
    """(n, 2): sum of the rewards over the trial, dominant and non-dominant."""
    plan: TrialPlan
    """What sets the trials apart: when cues and pulses come, the trial's condition, which of the targets it has."""
    arm: ArmParameters
    """The arm that moved; ``arm.timestep`` is the length of a step (s)."""

    def measures(self, radius: float, rows: slice | NDArray[np.bool_] = slice(None)) -> TrialMeasures:
        """Return the measures of the trials, or of some ``rows`` of them, at a goal of ``radius`` (m)."""
        onset = np.minimum(self.plan.onset, self.distance.shape[1])[rows]
        return trial_measures(self.distance[rows], self.start_distance[rows], radius, onset)

    def summary(self, radius: float) -> dict[str, float]:
        """Return means over the trials at a goal of ``radius`` (m), in people's units: percent, cm, steps.

        Trials without a cue, which have nothing to reach for, count in the returns alone. Where none has a cue, the
        goal's measures are NaN, and the final error is from where the hand was to stay.
        """
        dominant, non_dominant = self.vector_return.mean(axis=0)
        comes = self.plan.onset < self.distance.shape[1]
        means = self.measures(radius, comes if comes.any() else slice(None)).means()
        if not comes.any():
            means |= dict.fromkeys((name for name in means if "goal" in name), float("nan"))
        return means | {
            "return_dominant": float(dominant),
            "return_non_dominant": float(non_dominant),
        }

    def table(self, radius: float) -> pd.DataFrame:
        """Return a table with a row a trial, at a goal of ``radius`` (m), in SI units."""
        measures = self.measures(radius)
        columns: dict[str, Any] = {
            "trial": np.arange(len(self.target)),
            "threshold_m": radius,
            "goal_completion": measures.goal_completion,
            "speed_to_goal_m_per_step": measures.speed_to_goal,
            "time_in_goal_steps": measures.time_in_goal,
            "final_error_m": measures.final_error,
            "start_distance_m": self.start_distance,
            "return_dominant": self.vector_return[:, 0],
            "return_non_dominant": self.vector_return[:, 1],
        }
        for name, values in (("start", self.hand[:, 0]), ("target", self.target), ("load", self.load)):
            unit = "N" if name == "load" else "m"
            columns |= {f"{name}_{axis}_{unit}": values[:, i] for i, axis in enumerate("xy")}
        if self.plan.is_of_experiment:
            onset = self.plan.onset.astype(np.float64)
            columns |= {
                "condition": self.plan.written_condition,
                "target_index": self.plan.target_index,
                "onset_step": np.where(onset < NEVER, onset, np.nan),
            }
        return pd.DataFrame(columns)


def summaries(record: TrialRecord, own_radius: float) -> dict[float, dict[str, float]]:
    """Return :meth:`TrialRecord.summary` by goal radius (m): at each reported one, and at the run's own."""
    return {radius: record.summary(radius) for radius in distinct_radii([*REPORTED_RADII, own_radius])}
