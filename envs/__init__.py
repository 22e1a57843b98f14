"""The world: the arm, its tasks, and the environments that face it.

``import bilateral_rl`` registers ``bilateral_rl/RandomReach-v0`` and the other tasks with Gymnasium.
The names below are imported when they are first used, so that settings can be read without Warp, torch and SB3.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bilateral_rl.envs.arm import MUSCLE_NAMES, Arm, ArmParameters, ArmState
    from bilateral_rl.envs.arm_env import ArmEnv
    from bilateral_rl.envs.arm_vec_env import ArmVecEnv
    from bilateral_rl.envs.arm_vector_env import ArmVectorEnv
    from bilateral_rl.envs.experiments.experiment import Experiment
    from bilateral_rl.envs.experiments.files import ExperimentError, experiment_from_file, experiment_named
    from bilateral_rl.envs.experiments.task import ExperimentTask
    from bilateral_rl.envs.kinematics import hand_position, inverse_kinematics
    from bilateral_rl.envs.registration import ENVIRONMENT_IDS
    from bilateral_rl.envs.settings import TrialSettings
    from bilateral_rl.envs.task import Task, Trials
    from bilateral_rl.envs.tasks import TASKS, HoldPosition, RandomReach, ReachAndHold, TwoHolds, TwoReaches
    from bilateral_rl.envs.trials import TrialBatch
    from bilateral_rl.envs.two_arms import SpringSettings, TwoArmSettings
    from bilateral_rl.envs.vec_vector_reward import VecVectorReward
    from bilateral_rl.envs.vector_reward import Transition, VectorReward

_NAMES = {
    "arm": ("MUSCLE_NAMES", "Arm", "ArmParameters", "ArmState"),
    "arm_env": ("ArmEnv",),
    "arm_vec_env": ("ArmVecEnv",),
    "arm_vector_env": ("ArmVectorEnv",),
    "experiments.experiment": ("Experiment",),
    "experiments.files": ("ExperimentError", "experiment_from_file", "experiment_named"),
    "experiments.task": ("ExperimentTask",),
    "kinematics": ("hand_position", "inverse_kinematics"),
    "registration": ("ENVIRONMENT_IDS",),
    "settings": ("TrialSettings",),
    "task": ("Task", "Trials"),
    "tasks": ("TASKS", "HoldPosition", "RandomReach", "ReachAndHold", "TwoHolds", "TwoReaches"),
    "two_arms": ("SpringSettings", "TwoArmSettings"),
    "vec_vector_reward": ("VecVectorReward",),
    "trials": ("TrialBatch",),
    "vector_reward": ("Transition", "VectorReward"),
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names}

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
    "Experiment",
    "ExperimentError",
    "ExperimentTask",
    "HoldPosition",
    "RandomReach",
    "ReachAndHold",
    "SpringSettings",
    "Task",
    "Transition",
    "TrialBatch",
    "TrialSettings",
    "Trials",
    "TwoArmSettings",
    "TwoHolds",
    "TwoReaches",
    "VecVectorReward",
    "VectorReward",
    "experiment_from_file",
    "experiment_named",
    "hand_position",
    "inverse_kinematics",
]

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = globals()[name] = getattr(importlib.import_module(f"{__name__}.{_MODULES[name]}"), name)
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
