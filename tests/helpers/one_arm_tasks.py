"""The tasks of one arm, for tests of what two arms do not have."""

from bilateral_rl.envs.task_specs import TASK_SPECS

ONE_ARM_TASKS = [name for name, spec in TASK_SPECS.items() if spec.n_arms == 1]
