"""Settings of trials that somebody chose for one task, and that change nothing in it.

It is asked where a single task is chosen, and not of files, whose settings may serve several, or be those of a run.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from bilateral_rl.config.bounds import refuse_without_effect
from bilateral_rl.config.code_tasks import is_code
from bilateral_rl.config.parse import flat
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.io.errors import UserError

_OF_LOADS = ("trial.load", "trial.max_load")


def check_by_hand(settings: Mapping[str, Any], config: TrainConfig) -> None:
    """Raise a UserError for ``settings`` of two arms, of a spring that is none, or of loads, without a use for them."""
    given = [name for name, _ in flat(settings)]
    if config.n_arms == 1 and not is_code(config.task) and any(name.startswith("trial.two_arms.") for name in given):
        refuse_without_effect(["two_arms"], config)  # be they as they are anyway
    spring = config.trial.two_arms.spring
    if "trial.two_arms.spring.kind" in given and not spring.stiffness and not spring.damping:
        raise UserError(
            "trial.two_arms.spring.kind changes nothing without a spring: give trial.two_arms.spring.stiffness too."
        )
    of_loads = [name for name in given if name in _OF_LOADS]
    if of_loads and not _draws_loads(config):
        raise UserError(f"{of_loads[0]} changes nothing in {config.task}, which draws no load: leave it out.")


def _draws_loads(config: TrainConfig) -> bool:
    """Return whether the task's trials are others by other loads."""
    import numpy as np  # takes a while

    task = config.make_task()
    uniform = np.random.default_rng(0).random((16, task.n_uniform))
    small = task.trials(uniform, dataclasses.replace(config.trial, load="axes", max_load=1.0))
    large = task.trials(uniform, dataclasses.replace(config.trial, load="direction", max_load=2.0))
    return not np.array_equal(small.load, large.load)
