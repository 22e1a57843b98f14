"""The world: the arm, its tasks, and the environments that face it.

Importing this package registers ``bilateral_rl/RandomReach-v0`` and ``bilateral_rl/HoldPosition-v0`` with Gymnasium.
"""

from gymnasium.envs.registration import register, registry

from bilateral_rl.envs.arm import MUSCLE_NAMES, Arm, ArmParameters, ArmState
from bilateral_rl.envs.arm_env import ArmEnv
from bilateral_rl.envs.arm_vec_env import ArmVecEnv
from bilateral_rl.envs.arm_vector_env import ArmVectorEnv
from bilateral_rl.envs.tasks import TASKS, HoldPosition, RandomReach, Task, Trials
from bilateral_rl.envs.trials import TrialSettings
from bilateral_rl.envs.vector_reward import Transition, VectorReward

ENVIRONMENT_IDS = {"random_reach": "bilateral_rl/RandomReach-v0", "hold_position": "bilateral_rl/HoldPosition-v0"}
"""Gymnasium's name of each task."""

for _task, _id in ENVIRONMENT_IDS.items():
    if _id not in registry:
        register(
            id=_id,
            entry_point="bilateral_rl.envs.arm_env:ArmEnv",
            vector_entry_point="bilateral_rl.envs.arm_vector_env:ArmVectorEnv",
            kwargs={"task": _task},
        )

__all__ = [
    "ENVIRONMENT_IDS",
    "MUSCLE_NAMES",
    "TASKS",
    "Arm",
    "ArmEnv",
    "ArmParameters",
    "ArmState",
    "ArmVecEnv",
    "ArmVectorEnv",
    "HoldPosition",
    "RandomReach",
    "Task",
    "Transition",
    "TrialSettings",
    "Trials",
    "VectorReward",
]  # fmt: skip
