"""Gymnasium's registration of the environments; ``bilateral_rl`` imports it as soon as Gymnasium is imported."""

from gymnasium.envs.registration import register, registry

from bilateral_rl.envs.task_specs import EXPERIMENT_ID, PARADIGMS, TASK_SPECS

ENVIRONMENT_IDS = {task: spec.environment_id for task, spec in TASK_SPECS.items()} | PARADIGMS
"""Gymnasium's name of each task and of each experiment that ships."""

# Whoever makes an experiment has to say which: without a word, the empty name is refused.
for _task, _id in (*ENVIRONMENT_IDS.items(), ("", EXPERIMENT_ID)):
    if _id not in registry:
        register(
            id=_id,
            entry_point="bilateral_rl.envs.arm_env:make_arm_env",
            vector_entry_point="bilateral_rl.envs.arm_vector_env:ArmVectorEnv",
            kwargs={"task": _task},
        )
