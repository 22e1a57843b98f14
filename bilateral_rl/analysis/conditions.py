"""The conditions of a test: the task and the trials' settings, those of the training or others."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from bilateral_rl.config.bounds import check_fit, check_roles, check_trial
from bilateral_rl.config.by_hand import check_by_hand
from bilateral_rl.config.code_tasks import allow_code
from bilateral_rl.config.parse import Values, flat, merge, plain_values
from bilateral_rl.config.resolve import difference, from_values
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.config.tasks import TaskChoice, TaskWords, choose_task
from bilateral_rl.envs.experiments.forces import Forces
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.io.errors import UserError

_SCALES = ("optimal_muscle_length", "normalized_max_velocity")
"""What muscle lengths and velocities are divided by before a policy sees them."""


@dataclass(frozen=True)
class Conditions:
    """Under what a run's policies are tested."""

    config: TrainConfig
    """The run's configuration, with the task and the trials of the test."""
    changed: Mapping[str, Any]
    """What differs from the training, by the name in config.yaml: ``{"trial.sensory_noise": 0.01}``.

    Of another task it is the task, and what differs from the settings that this has by itself, be it from the training.
    """
    notes: tuple[str, ...] = ()
    """Sentences on what these changes mean where that is easily missed."""

    @property
    def task(self) -> str:
        """The task's name."""
        return self.config.task

    @property
    def settings(self) -> TrialSettings:
        """How trials run."""
        return self.config.trial


def conditions(
    config: TrainConfig, task: TaskWords | None = None, settings: Mapping[str, Any] | None = None
) -> Conditions:
    """Return the conditions of a run's training, with another task or other settings of trials.

    Args:
        config: the run's configuration.
        task: another task, an experiment or its file; None for the run's. Its settings of trials go over the run's, and
            those that the run has from its own task, such as a spring, stay behind with it.
        settings: nested dictionaries as in config.yaml, such as ``{"trial": {"sensory_noise": 0.01}}``, or changes of
            the experiment, such as ``{"experiment": {"forces": {"curl": 10}}}``.

    Raises:
        UserError: an unknown task, a setting that does not exist or is out of bounds, or one that changes nothing here.
    """
    allow_code([task])
    settings = settings or {}
    for name, _ in flat(settings):
        _check_changes(name)
    values = config.to_values()
    trained = TaskChoice(config.task, config.experiment)
    found = choose_task(None if task == config.task else task, [values, settings], config.task)
    experiment = None if found.experiment is None else plain_values(found.experiment)
    of_task: Mapping[str, Any] = {}
    if found.task != config.task or found.trial != trained.trial:  # as of an experiment that was edited since
        values |= {"trial": difference(values["trial"], trained.trial)}
        of_task = {"trial": found.trial}
    over = {**merge(of_task, settings), "task": found.task}
    changed_config = from_values(merge(values, over) | {"experiment": experiment})
    _check_arms(config, changed_config)
    check_trial(changed_config)
    check_fit(changed_config)
    check_roles(settings, changed_config)
    check_by_hand(settings, changed_config)
    own = choose_task(task, [values], config.task)
    changed = _differences(config, changed_config, own if own.task == found.task else found)
    notes = tuple(_notes(config.trial, changed_config.trial))
    return Conditions(changed_config, changed, notes)


def _check_changes(name: str) -> None:
    """Raise a UserError for a setting that changes nothing in any test."""
    first, _, rest = name.partition(".")
    if first not in ("trial", "experiment"):
        known = first in {field.name for field in dataclasses.fields(TrialSettings)}
        hint = f"did you mean trial.{name}?" if known else "such as trial.sensory_noise."
        raise UserError(f"{name} changes nothing in a test, which takes settings of trials alone: {hint}")
    if name in ("experiment.name", "experiment.description"):
        raise UserError(f"{name} changes nothing in a test: leave it out.")
    if rest.startswith("losses.") and rest.endswith(".penalty"):
        raise UserError(f"{name} changes nothing in a test, as no reward has the penalty: leave it out.")


def _check_arms(config: TrainConfig, changed: TrainConfig) -> None:
    """Raise a UserError for a task of another number of arms than the run's networks have."""
    if changed.n_arms != config.n_arms:
        arms = {1: "one arm", 2: "two arms"}
        raise UserError(
            f"This run's networks have learned to move {arms[config.n_arms]}, and {changed.task} is a task of "
            f"{arms[changed.n_arms]}: test them in another one."
        )


def _differences(config: TrainConfig, changed: TrainConfig, own: TaskChoice) -> dict[str, Any]:
    """Return what differs by its name: from the training or, in another task, from what that has by itself.

    The ``trial`` section of an experiment is not told: what it does is, as settings of trials.
    """
    usual = config.to_values()
    if changed.task != config.task:
        experiment = None if own.experiment is None else plain_values(own.experiment)
        usual = from_values(changed.to_values() | {"trial": own.trial, "experiment": experiment}).to_values()
        usual["task"] = config.task  # which is told as a change
    known = dict(flat(_with_all_forces(usual)))
    return {
        name: value
        for name, value in flat(_with_all_forces(changed.to_values()))
        if (name not in known or value != known[name]) and not name.startswith("experiment.trial.")
    }


def _with_all_forces(values: Values) -> Values:
    """Return the values of a configuration with all forces named where there are none: one added is one change."""
    experiment = values["experiment"]
    if experiment is None:
        return values
    none = plain_values(Forces())
    arms = experiment.get("arms") or {}
    named = {hand: arm | {"forces": arm.get("forces") or none} for hand, arm in arms.items()}
    own = {"arms": named} if arms else {"forces": experiment.get("forces") or none}
    return values | {"experiment": experiment | own}


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
