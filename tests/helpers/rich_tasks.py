"""Tasks whose trials have what the paper's do not: timelines and forces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from bilateral_rl.envs import Task, Trials, TrialSettings
from bilateral_rl.envs.task import NEVER, HandForces, Spring, Timeline

RICH_SETTINGS: dict[str, Any] = {
    "length_noise": 0.01,
    "velocity_noise": 0.02,
    "vision_noise": 0.003,
    "motor_noise": 0.02,
    "proprioception_delay": 2,
    "vision_delay": 5,
    "losses": {
        "dominant": {"cartesian_2": 5.0, "activation": 2.0, "excitation_change": 0.3, "muscle_force": 0.2},
        "non_dominant": {"cartesian_1": 5.0, "hand_speed": 0.4},
        "last_steps": 4,
    },
}
"""Every sense and every loss by itself."""


def no_forces(**others: Any) -> HandForces:
    """Forces of one row that do nothing, but for ``others``."""
    nothing: dict[str, Any] = {
        "velocity_gain": np.zeros((2, 2)),
        "position_gain": np.zeros((2, 2)),
        "center": np.zeros(2),
        "pulse": np.zeros(2),
        "pulse_window": (0, 0),
        "walls": np.zeros(2),
    }
    return HandForces(**nothing | others)


@dataclass
class Fixed(Task):
    """The same trial every time."""

    start: Any = (0.6, 1.5)
    goal: Any = (1.0, 1.2)
    load: Any = (0.0, 0.0)
    timeline: Timeline | None = None
    forces: HandForces | None = None

    id = "fixed"
    n_uniform = 0

    def __post_init__(self) -> None:
        self.has_timeline, self.has_forces = self.timeline is not None, self.forces is not None

    def trials(self, uniform: Any, settings: TrialSettings) -> Trials:
        return Trials(self.start, self.goal, self.load, self.timeline, self.forces)


class Rich(Task):
    """Random reaches with loads, a cue that may not come, a target that may jump, and every force."""

    id = "rich"
    n_uniform = 16
    has_timeline = True
    has_forces = True

    def trials(self, uniform: Any, settings: TrialSettings) -> Trials:
        u, n = uniform, len(uniform)
        lower, upper = np.array(settings.arm.joint_lower_limit), np.array(settings.arm.joint_upper_limit)
        start, goal, jump_goal = (lower + u[:, i : i + 2] * (upper - lower) for i in (0, 2, 4))
        go = np.where(u[:, 6] < 0.2, NEVER, (4 * u[:, 7]).astype(int))
        jump = np.where(u[:, 8] < 0.5, NEVER, np.minimum(go + (4 * u[:, 9]).astype(int), NEVER))
        field, channel = (u[:, 10] < 0.5)[:, None, None], (u[:, 10] > 0.8)[:, None]
        first = (4 * u[:, 11]).astype(int)
        forces = HandForces(
            velocity_gain=field * np.array([[0.0, 15.0], [-15.0, 0.0]]),
            position_gain=field * np.array([[30.0, 5.0], [-5.0, 20.0]]),
            center=u[:, 12:14] - 0.5,
            pulse=10 * (u[:, 14:16] - 0.5),
            pulse_window=np.stack([first, first + 3], axis=1),
            walls=channel * np.array([2000.0, 60.0]),
        )
        return Trials(start, goal, np.full((n, 2), (1.0, -2.0)), Timeline(go, jump, jump_goal), forces)


@dataclass
class RichPair(Task):
    """What ``Rich`` is to one arm, to two: each is drawn as if it were alone, in the frame of the body."""

    stiffness: float = 60.0
    damping: float = 3.0

    id = "rich_pair"
    n_arms = 2
    n_uniform = 2 * Rich.n_uniform
    has_timeline = True
    has_forces = True

    def trials(self, uniform: Any, settings: TrialSettings) -> Trials:
        arms = [Rich().trials(part, settings) for part in np.split(uniform, 2, axis=1)]
        start, goal, load = (np.stack([arm[i] for arm in arms], axis=1) for i in range(3))
        timelines, forces = ([getattr(arm, name) for arm in arms] for name in ("timeline", "forces"))
        return Trials(
            start,
            goal,
            load,
            Timeline(*(np.stack(both, axis=1) for both in zip(*timelines, strict=True))),
            HandForces(*(np.stack(both, axis=1) for both in zip(*forces, strict=True))),
            Spring(np.full(len(uniform), self.stiffness), np.full(len(uniform), self.damping)),
        )
