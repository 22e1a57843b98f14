"""What sets the trials of a record apart before anything moves: targets, cues, jumps, pulses, and the conditions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.kinematics import hand_position
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.tasks import NEVER, HandForces, Trials
from bilateral_rl.vocabulary import SIDES

Float32 = NDArray[np.float32]
Int32 = NDArray[np.int32]

CONDITIONS = ("field", "null", "channel", "no_go", "jump", "pulse")
"""What a trial's condition is made of: the field is on; there is neither a field nor a channel, as in a trial whose
field is off; the hand is in a channel; no go cue comes; the target jumps; a pulse comes."""


NULL_FIELD = "null_field"
"""What tables write for "null", which much software reads as nothing."""


@dataclass(frozen=True, eq=False)
class TrialPlan:
    """Of ``n`` trials; steps count from 0, and ``NEVER`` stands for one that does not come.

    Trials of two arms have a row a hand, ``n`` is their number then, and positions are in the frame of the hand's arm.
    """

    trial: Int32
    """(n,): number of the trial, from 0."""
    hand: NDArray[np.str_]
    """(n,): whose hand it is, "dominant" or "non_dominant"."""
    start: Float32
    """(n, 2): hand position at the start (m)."""
    goal: Float32
    """(n, 2): hand position of the goal, the target from the go cue on until it jumps (m)."""
    go: Int32
    """(n,): step from which on the goal is the target; 0 where it is there from the start."""
    jump: Int32
    """(n,): step from which on the target is another one."""
    pulse: Int32
    """(n, 2): first step of the pulse, and first step after it; ``NEVER`` twice where there is none."""
    pulse_force: Float32
    """(n, 2): force of the pulse (N); 0 where there is none."""
    condition: NDArray[np.str_]
    """(n,): one of :data:`CONDITIONS`, or several joined by "+" as in "field+jump"; "null" is said of trials alone in
    which there is nothing else."""
    target_index: Int32
    """(n,): which of the listed targets it is, from 0; -1 where the targets are no list."""
    target_angle: Float32
    """(n,): direction from the hand at the start to the goal, from the x axis counterclockwise (rad), in (-π, π]; NaN
    where both are one place."""
    forces: HandForces | None = None
    """Fields, pulses and channels, (n, …) each, which videos draw; None in a task without."""
    is_of_experiment: bool = False
    """Whether such things set trials of the task apart: cues, forces, or which of several targets it is."""

    @property
    def onset(self) -> Int32:
        """(n,): step at which the last target began, from which on reaching is measured; ``NEVER`` without a cue."""
        return np.where(self.jump < NEVER, self.jump, self.go).astype(np.int32)

    @property
    def role(self) -> NDArray[np.str_]:
        """(n,): "hold" of hands whose goal is where they start, "reach" of all others."""
        return np.where(np.isnan(self.target_angle), "hold", "reach")

    @property
    def written_condition(self) -> NDArray[np.str_]:
        """(n,): the condition as tables have it."""
        return np.where(self.condition == "null", NULL_FIELD, self.condition)

    def has(self, condition: str) -> NDArray[np.bool_]:
        """(n,): whether ``condition``, one of :data:`CONDITIONS`, is among those of each trial."""
        if condition == "null":
            return ~(self.has("field") | self.has("channel"))
        return np.array([condition in joined.split("+") for joined in self.condition], dtype=np.bool_)


def plan_of(trials: Trials, target_index: Int32, settings: TrialSettings, n_arms: int = 1) -> TrialPlan:
    """Return the plan of checked trials.

    Args:
        trials: (n, …) each, a row a hand.
        target_index: (n,).
        settings: how they run; a cue or jump at the end of a trial, or later, does not come.
        n_arms: of each trial.
    """
    n, length = len(trials.start), settings.trial_length
    start, goal = (hand_position(angles, settings.arm) for angles in (trials.start, trials.goal))
    go, jump = np.zeros(n, dtype=np.int32), np.full(n, NEVER, dtype=np.int32)
    pulse, pulse_force = np.full((n, 2), NEVER, dtype=np.int32), np.zeros((n, 2), dtype=np.float32)
    if trials.timeline is not None:
        go, jump = (_coming(steps, length) for steps in (trials.timeline.go, trials.timeline.jump))
    if trials.forces is not None:
        window = np.minimum(trials.forces.pulse_window, length)
        pushes = trials.forces.pulse.any(axis=1) & (window[:, 0] < window[:, 1])
        pulse = np.where(pushes[:, None], window, NEVER).astype(np.int32)
        pulse_force = np.where(pushes[:, None], trials.forces.pulse, 0).astype(np.float32)
    along = goal - start
    apart = np.linalg.norm(along, axis=1) > 0
    angle = np.where(apart, np.arctan2(along[:, 1], along[:, 0]), np.nan)
    return TrialPlan(
        trial=np.arange(n, dtype=np.int32) // n_arms,
        hand=np.resize(SIDES[:n_arms], n),
        start=start.astype(np.float32),
        goal=goal.astype(np.float32),
        go=go,
        jump=jump,
        pulse=pulse,
        pulse_force=pulse_force,
        condition=_conditions(trials, go, jump, pulse),
        target_index=target_index,
        target_angle=angle.astype(np.float32),
        is_of_experiment=trials.timeline is not None or trials.forces is not None or bool((target_index >= 0).any()),
        forces=trials.forces,
    )


def _coming(steps: Int32, length: int) -> Int32:
    return np.where(steps < length, steps, NEVER).astype(np.int32)


def _conditions(trials: Trials, go: Int32, jump: Int32, pulse: Int32) -> NDArray[np.str_]:
    """Join what each trial has, the force on the hand first."""
    n, forces = len(go), trials.forces
    in_channel = in_field = np.zeros(n, dtype=np.bool_)
    if forces is not None:
        in_channel = np.asarray(forces.walls.any(axis=1))
        in_field = np.asarray(forces.velocity_gain.any(axis=(1, 2)) | forces.position_gain.any(axis=(1, 2)))
    has = {
        "channel": in_channel,
        "field": in_field & ~in_channel,
        "no_go": go == NEVER,
        "jump": jump < NEVER,
        "pulse": pulse[:, 0] < NEVER,
    }
    joined = ["+".join(name for name, of in has.items() if of[i]) or "null" for i in range(n)]
    return np.array(joined, dtype=f"U{len('+'.join(has))}")  # of one length, whichever trials are there
