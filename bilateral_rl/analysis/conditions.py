"""The conditions of a test: the task and the trials' settings, those of the training or others."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bilateral_rl.config.bounds import check_trial
from bilateral_rl.config.catalogue import check_choice
from bilateral_rl.config.parse import flat, merge
from bilateral_rl.config.resolve import from_values
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.task_specs import TASK_SPECS
from bilateral_rl.envs.tasks import make_task
from bilateral_rl.io.errors import UserError

_OF_LOADS = ("trial.load", "trial.max_load")
"""Settings that act in tasks with a load alone."""
_SCALES = ("optimal_muscle_length", "normalized_max_velocity")
"""What muscle lengths and velocities are divided by before a policy sees them."""


@dataclass(frozen=True)
class Conditions:
    """Under what a run's policies are tested."""

    task: str
    """The task's id."""
    settings: TrialSettings
    """How trials run."""
    changed: Mapping[str, Any]
    """What differs from the training, by the name in config.yaml: ``{"trial.sensory_noise": 0.01}``."""
    notes: tuple[str, ...] = ()
    """Sentences on what these changes mean where that is easily missed."""


def conditions(config: TrainConfig, task: str | None = None, settings: Mapping[str, Any] | None = None) -> Conditions:
    """Return the conditions of a run's training, with another task or other settings of trials.

    Args:
        config: the run's configuration.
        task: another task; None for the run's.
        settings: nested dictionaries as in config.yaml, such as ``{"trial": {"sensory_noise": 0.01}}``.

    Raises:
        UserError: an unknown task, a setting that does not exist or is out of bounds, or one that changes nothing here.
    """
    if task is not None:
        check_choice("task", task, TASK_SPECS)
    settings = settings or {}
    for name, _ in flat(settings):
        if name.split(".")[0] != "trial":
            known = name in {field.name for field in dataclasses.fields(TrialSettings)}
            hint = f"did you mean trial.{name}?" if known else "such as trial.sensory_noise."
            raise UserError(f"{name} changes nothing in a test, which takes settings of trials alone: {hint}")
    changed_config = from_values(merge(config.to_values(), {**settings, "task": task or config.task}))
    check_trial(changed_config)
    _refuse_without_effect(config, changed_config, settings)
    changed = dict(_differences(config, changed_config))
    notes = tuple(_notes(config.trial, changed_config.trial))
    return Conditions(changed_config.task, changed_config.trial, changed, notes)


def _differences(config: TrainConfig, changed: TrainConfig) -> Iterator[tuple[str, Any]]:
    before, after = dict(flat(config.to_values())), dict(flat(changed.to_values()))
    return ((name, value) for name, value in after.items() if value != before[name])


def _refuse_without_effect(config: TrainConfig, changed: TrainConfig, settings: Mapping[str, Any]) -> None:
    """Raise a UserError for settings of loads in a task whose trials stay the same by them."""
    of_loads = [name for name, _ in flat(settings) if name in _OF_LOADS]
    if not of_loads:
        return
    task = make_task(changed.task)
    uniform = np.random.default_rng(0).random((16, task.n_uniform))
    small = task.trials(uniform, dataclasses.replace(changed.trial, load="axes", max_load=1.0))
    large = task.trials(uniform, dataclasses.replace(changed.trial, load="direction", max_load=2.0))
    if np.array_equal(small.load, large.load):
        raise UserError(f"{of_loads[0]} changes nothing in {changed.task}, which has no load: leave it out.")


def _notes(trained: TrialSettings, tested: TrialSettings) -> Iterator[str]:
    before, after = trained.arm, tested.arm
    if before.timestep != after.timestep:
        yield (
            f"A step is {1000 * after.timestep:g} ms here and was {1000 * before.timestep:g} ms in the training: a "
            f"trial of {tested.trial_length} steps lasts {tested.trial_length * after.timestep:g} s, and goals, delays "
            "and returns count steps."
        )
    if any(getattr(before, name) != getattr(after, name) for name in _SCALES):
        yield (
            "The policy sees muscle lengths and velocities in the optimal lengths and maximal velocities of this arm, "
            "not of the one that it learned with."
        )
    if before.link_length != after.link_length:
        yield (
            f"The policy sees hand and target within {sum(after.link_length):g} m of the shoulder, the reach of this "
            f"arm; it learned with one of {sum(before.link_length):g} m."
        )
