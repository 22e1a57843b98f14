"""What is recorded of trials of a trained policy, and what they come to."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from bilateral_rl.analysis.goals import REPORTED_RADII, distinct_radii
from bilateral_rl.analysis.trial_plans import TrialPlan
from bilateral_rl.envs.arm import ArmParameters
from bilateral_rl.envs.body_frame import in_body_frame, vectors_between_frames
from bilateral_rl.envs.measures import TrialMeasures, trial_measures
from bilateral_rl.envs.tasks import NEVER
from bilateral_rl.vocabulary import SIDES

Float32 = NDArray[np.float32]

OF_REACHES = ("goal_completion_percent", "speed_to_goal_cm_per_step")
"""Means that say something of reaches alone."""


@dataclass(frozen=True)
class TrialRecord:
    """``n`` trials of ``T`` steps, in float32.

    Of two arms there is a row a hand: ``n`` is the number of hands, the dominant and the non-dominant one of each trial
    in turn (``plan.trial``, ``plan.hand``, ``plan.role``). Positions and forces are in the frame of the hand's own arm,
    in which the non-dominant arm is the mirror image of the dominant one; :meth:`body_positions` and
    :meth:`body_vectors` turn them into the frame of the body, in which people see both.
    """

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
    """(n, T, 16), of two arms (n, T, 20): what the policy saw of the hand's arm before each step, in the units of
    :class:`~bilateral_rl.envs.ArmEnv`."""
    excitation: Float32
    """(n, T, 6): commands to the muscles in each step, in [0, 1]."""
    activation: Float32
    """(n, T, 6): activation of the muscles after each step, in [0, 1]."""
    vector_return: Float32
    """(n, 2): sum of the rewards over the trial, dominant and non-dominant; of two arms, of both together."""
    plan: TrialPlan
    """What sets the trials apart: when cues and pulses come, the trial's condition, which of the targets it has."""
    arm: ArmParameters
    """The arm that moved; ``arm.timestep`` is the length of a step (s)."""
    shoulder_distance: float | None = None
    """Distance of the shoulders (m); None where there is one arm."""
    spring_force: Float32 | None = None
    """(n, T + 1, 2): force of the spring on the hand at the start and after each step, which acts in the next one (N);
    None where there is one arm."""

    @property
    def n_arms(self) -> int:
        """How many arms a trial has, and rows."""
        return 1 if self.shoulder_distance is None else len(SIDES)

    def body_positions(self, positions: Float32) -> Float32:
        """Return positions (n, …, 2) (m), a row a hand, in the frame of the body; of one arm they stay as they are."""
        if self.shoulder_distance is None:
            return positions
        return self._own_arm(in_body_frame(_of_either_arm(positions), self.shoulder_distance))

    def body_vectors(self, vectors: Float32) -> Float32:
        """Return vectors (n, …, 2), such as forces, a row a hand, in the frame of the body; of one arm as they are."""
        if self.shoulder_distance is None:
            return vectors
        return self._own_arm(vectors_between_frames(_of_either_arm(vectors)))

    def _own_arm(self, values: NDArray[np.float64]) -> Float32:
        """Pick from (n, …, 2 arms, 2) the values of each row's arm."""
        is_dominant = (self.plan.hand == SIDES[0]).reshape(-1, *[1] * (values.ndim - 2))
        return np.where(is_dominant, values[..., 0, :], values[..., 1, :]).astype(np.float32)

    def measures(self, radius: float, rows: slice | NDArray[np.bool_] = slice(None)) -> TrialMeasures:
        """Return the measures of the trials, or of some ``rows`` of them, at a goal of ``radius`` (m)."""
        onset = np.minimum(self.plan.onset, self.distance.shape[1])[rows]
        return trial_measures(self.distance[rows], self.start_distance[rows], radius, onset)

    def summary(self, radius: float) -> dict[str, float]:
        """Return means over the trials at a goal of ``radius`` (m), in people's units: percent, cm, steps.

        Trials without a cue, which have nothing to reach for, count in the returns alone. Where none has a cue, the
        goal's measures are NaN, and the final error is from where the hand was to stay. Of two arms the means are over
        the hands; where some reach and others hold, completion and speed are of those that reach.
        """
        dominant, non_dominant = self.vector_return.mean(axis=0)
        comes = self._is_cued
        means = self.measures(radius, comes if comes.any() else slice(None)).means()
        reaches = comes & (self.plan.role == "reach")
        if self.n_arms > 1 and reaches.any():
            means |= {
                name: value for name, value in self.measures(radius, reaches).means().items() if name in OF_REACHES
            }
        if not comes.any():
            means |= dict.fromkeys((name for name in means if "goal" in name), float("nan"))
        return means | {
            "return_dominant": float(dominant),
            "return_non_dominant": float(non_dominant),
        }

    def numbers_by_hand(self, radius: float) -> dict[str, float]:
        """Return :meth:`summaries_by_hand` by name, ``final_error_cm_of_dominant_hold``; of one arm nothing."""
        if self.n_arms == 1:
            return {}
        by_hand = self.summaries_by_hand(radius).items()
        return {f"{name}_of_{hand}_{role}": value for (hand, role), means in by_hand for name, value in means.items()}

    def summaries_by_hand(self, radius: float) -> dict[tuple[str, str], dict[str, float]]:
        """Return by hand and role what :meth:`summary` has of hands; of hands that hold, no completion and no speed."""
        found: dict[tuple[str, str], dict[str, float]] = {}
        for hand, role in itertools.product(SIDES, ("reach", "hold")):
            rows = self._is_cued & (self.plan.hand == hand) & (self.plan.role == role)
            if rows.any():
                means = self.measures(radius, rows).means()
                found[hand, role] = {name: means[name] for name in means if role == "reach" or name not in OF_REACHES}
        return found

    @property
    def _is_cued(self) -> NDArray[np.bool_]:
        """(n,): whether there is anything to reach for: a cue that comes, or a target from the start."""
        return np.asarray(self.plan.onset < self.distance.shape[1])

    def table(self, radius: float) -> pd.DataFrame:
        """Return a table with a row a trial, at a goal of ``radius`` (m), in SI units.

        Of two arms it has a row a hand, with columns ``hand`` and ``role``, and positions and loads are in the frame of
        the body.
        """
        measures, plan = self.measures(radius), self.plan
        columns: dict[str, Any] = {"trial": plan.trial} | (
            {"hand": plan.hand, "role": plan.role} if self.n_arms > 1 else {}
        )
        columns |= {
            "threshold_m": radius,
            "goal_completion": measures.goal_completion,
            "speed_to_goal_m_per_step": measures.speed_to_goal,
            "time_in_goal_steps": measures.time_in_goal,
            "final_error_m": measures.final_error,
            "start_distance_m": self.start_distance,
            "return_dominant": self.vector_return[:, 0],
            "return_non_dominant": self.vector_return[:, 1],
        }
        places = {"start": self.body_positions(self.hand[:, 0]), "target": self.body_positions(self.target)}
        for name, values in (*places.items(), ("load", self.body_vectors(self.load))):
            unit = "N" if name == "load" else "m"
            columns |= {f"{name}_{axis}_{unit}": values[:, i] for i, axis in enumerate("xy")}
        if plan.is_of_experiment:
            onset = plan.onset.astype(np.float64)
            columns |= {
                "condition": plan.written_condition,
                "target_index": plan.target_index,
                "onset_step": np.where(onset < NEVER, onset, np.nan),
            }
        return pd.DataFrame(columns)


def summaries(record: TrialRecord, own_radius: float) -> dict[float, dict[str, float]]:
    """Return :meth:`TrialRecord.summary` by goal radius (m): at each reported one, and at the run's own."""
    return {radius: record.summary(radius) for radius in reported_radii(own_radius)}


def reported_radii(own_radius: float) -> list[float]:
    """Return the radii of the goal (m) that evaluations report: the usual ones, and a run's own."""
    return distinct_radii([*REPORTED_RADII, own_radius])


def _of_either_arm(values: Float32) -> Float32:
    """Return (n, …, 2) as (n, …, 2 arms, 2), the same for both arms."""
    return np.stack([values, values], axis=-2)
