"""Settings of loads where a task draws none, so that they would change nothing."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from bilateral_rl.config.parse import flat
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.io.errors import UserError

_OF_LOADS = ("trial.load", "trial.max_load")


def check_loads(settings: Mapping[str, Any], config: TrainConfig) -> None:
    """Raise a UserError for ``settings`` of loads, chosen for one task, whose trials stay the same by them.

    It is asked where a single task is chosen, and not of files, whose settings may serve several.
    """
    of_loads = [name for name, _ in flat(settings) if name in _OF_LOADS]
    if not of_loads:
        return
    import numpy as np  # takes a while

    task = config.make_task()
    uniform = np.random.default_rng(0).random((16, task.n_uniform))
    small = task.trials(uniform, dataclasses.replace(config.trial, load="axes", max_load=1.0))
    large = task.trials(uniform, dataclasses.replace(config.trial, load="direction", max_load=2.0))
    if np.array_equal(small.load, large.load):
        raise UserError(f"{of_loads[0]} changes nothing in {config.task}, which draws no load: leave it out.")
