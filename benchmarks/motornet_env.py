"""The smallest wrapper that lets stable-baselines3 train on MotorNet's own PyTorch arm: the benchmarks' baseline."""

from __future__ import annotations

from typing import Any

import gymnasium
import motornet
import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray

TRIAL_LENGTH = 50


class MotorNetReach(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """Random reaching with MotorNet's ``RigidTendonArm26``; the paper's slack length, the combined loss as reward."""

    def __init__(self) -> None:
        muscle = motornet.muscle.RigidTendonHillMuscle()
        self._arm = motornet.effector.RigidTendonArm26(muscle, muscle_kwargs={"normalized_slack_muscle_length": 1.0})
        self.observation_space = spaces.Box(-5.0, 5.0, (16,))
        self.action_space = spaces.Box(-1.0, 1.0, (6,))
        self._target = np.zeros(2, dtype=np.float32)
        self._steps = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        super().reset(seed=seed)
        upper = np.deg2rad([135.0, 155.0])
        start, goal = self.np_random.uniform(0, upper, (2, 2))
        self._arm.reset(options={"batch_size": 1, "joint_state": torch.tensor([[*goal, 0, 0]], dtype=torch.float32)})
        self._target = self._hand()
        self._arm.reset(options={"batch_size": 1, "joint_state": torch.tensor([[*start, 0, 0]], dtype=torch.float32)})
        self._steps = 0
        return self._observe(), {}

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        excitation = (np.clip(action, -1, 1) + 1) / 2
        with torch.no_grad():
            self._arm.step(torch.as_tensor(excitation, dtype=torch.float32)[None])
        self._steps += 1
        error = self._hand() - self._target
        loss = 2.5 * np.abs(error).mean() + 25 * np.square(error).mean() + np.square(excitation).mean()
        return self._observe(), -float(loss), False, self._steps >= TRIAL_LENGTH, {}

    def _hand(self) -> NDArray[np.float32]:
        return self._arm.states["cartesian"][0, :2].numpy()  # type: ignore[no-any-return]

    def _observe(self) -> NDArray[np.float32]:
        muscle = self._arm.states["muscle"][0]
        optimal = self._arm.muscle.l0_ce[0, 0]
        lengths, velocities = muscle[1] / optimal, muscle[2] / (10 * optimal)
        return np.concatenate([lengths.numpy(), velocities.numpy(), self._hand(), self._target]).astype(np.float32)
