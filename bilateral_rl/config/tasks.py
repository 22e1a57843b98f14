"""Which task a configuration is of, from layers of settings: a name, an experiment or its file, or a user's class."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any, Literal, TypeAlias

from bilateral_rl.config.code_tasks import code_task, is_allowed, is_code
from bilateral_rl.config.parse import Values, build, merge, plain_values
from bilateral_rl.envs.experiments.experiment import Experiment, is_complete
from bilateral_rl.envs.experiments.files import find_experiment
from bilateral_rl.envs.refusals import shown
from bilateral_rl.envs.task_specs import TASK_SPECS
from bilateral_rl.io.errors import UserError

TaskWords: TypeAlias = "str | PathLike[str] | Experiment"
"""How a task is named: by its name, its file, or as an experiment."""
JudgedBy = Literal["goal_completion", "time_in_goal"]


@dataclass(frozen=True)
class TaskChoice:
    """The task of a configuration."""

    task: str
    """Its name, or ``module:Class``."""
    experiment: Experiment | None = None
    """What it is, where that is data."""

    @property
    def judged_by(self) -> JudgedBy:
        """The measure that says how well it is done; of a class that nobody has named, completion."""
        if self.experiment is not None:
            return self.experiment.measure
        if self.task in TASK_SPECS:
            return TASK_SPECS[self.task].judged_by
        return code_task(self.task).judged_by if is_allowed(self.task) else "goal_completion"

    @property
    def n_arms(self) -> Literal[1, 2]:
        """How many arms it is for; of a class that nobody has named, 1."""
        if self.experiment is not None:
            return 1 if self.experiment.arms is None else 2
        if self.task in TASK_SPECS:
            return TASK_SPECS[self.task].n_arms
        return code_task(self.task).n_arms if is_allowed(self.task) else 1

    @property
    def trial(self) -> Mapping[str, Any]:
        """Settings of trials that it has where nobody says otherwise."""
        if self.experiment is not None:
            return self.experiment.trial
        if self.task in TASK_SPECS:
            return TASK_SPECS[self.task].trial
        return code_task(self.task).trial if is_allowed(self.task) else {}

    @property
    def tuned_as(self) -> str:
        """Whose tuned defaults it has: those of the first task of as many arms that is judged by the same measure."""
        if self.task in TASK_SPECS:
            return self.task
        kind = (self.n_arms, self.judged_by)
        return next(name for name, spec in TASK_SPECS.items() if (spec.n_arms, spec.judged_by) == kind)


def choose_task(task: object, layers: Sequence[Mapping[str, Any]], default: str) -> TaskChoice:
    """Return the task that is asked for.

    Args:
        task: a name, a path or an experiment; None for what the layers say.
        layers: nested dictionaries of settings; later ones win. They may hold whole experiments, or changes of one.
        default: a name, where nobody says anything.

    Raises:
        UserError: there is no such task, or changes that are of none.
    """
    words: object = default
    base: Experiment | None = None
    changes: Values = {}
    for layer in layers:
        given = layer.get("experiment")
        if isinstance(given, Mapping) and is_complete(given):
            words, base, changes = given["name"], build(Experiment, given, "experiment"), {}
        elif isinstance(given, Mapping):
            changes = merge(changes, given)
        elif given is not None:
            raise UserError(f"experiment must be settings by name, got {shown(given)}.")
        if "task" in layer and not (base is not None and layer["task"] == base.name):
            words, base = layer["task"], None
    if task is not None:
        words, base = task, None
    choice = _find(words) if base is None else TaskChoice(base.name, base)
    return _changed(choice, changes) if changes else choice


def _find(words: object) -> TaskChoice:
    if isinstance(words, str) and (words in TASK_SPECS or is_code(words)):
        return TaskChoice(words)
    if not isinstance(words, str | PathLike | Experiment):
        raise UserError(
            "A task is given by its name, as an Experiment or the file of one, or as a class by module:Class, not by "
            f"{shown(words)}."
        )
    experiment = find_experiment(words)
    return TaskChoice(experiment.name, experiment)


def _changed(choice: TaskChoice, changes: Values) -> TaskChoice:
    if choice.experiment is None:
        raise UserError(f"experiment.{next(iter(changes))} changes nothing: {choice.task} is no experiment.")
    if "trial" in changes:
        raise UserError("experiment.trial keeps what the experiment's file says: set trial itself, as trial.threshold.")
    experiment = build(Experiment, merge(plain_values(choice.experiment), changes), "experiment")
    return TaskChoice(experiment.name, experiment)
