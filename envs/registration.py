"""Gymnasium's registration of the environments; ``bilateral_rl`` imports it as soon as Gymnasium is imported."""

from gymnasium.envs.registration import register, registry

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
