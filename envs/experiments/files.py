"""Experiments in YAML: those of users, and the paradigms that ship, with errors that name the line and the field."""

from __future__ import annotations

import difflib
import functools
import importlib.resources
import os
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from bilateral_rl.envs.experiments.effects import without_effect
from bilateral_rl.envs.experiments.experiment import Experiment
from bilateral_rl.envs.quantities import STRICT
from bilateral_rl.envs.refusals import first_error, refusal, shown
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.task_specs import ALIASES, PARADIGMS, TASK_SPECS
from bilateral_rl.io import files
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.yaml_files import LARGEST_SETTINGS, Lines, parse_with_lines

T = TypeVar("T")
SUFFIXES = (".yaml", ".yml")
"""How files of experiments end."""


class ExperimentError(UserError, ValueError):
    """A file that holds no experiment; the sentence names the file, the line and the field."""


def experiment_from_file(path: str | PathLike[str]) -> Experiment:
    """Read an experiment from a YAML file, or from the ``config.yaml`` of a run that learned one.

    Raises:
        ExperimentError: the file cannot be read, or holds no experiment that its arm and trials allow.
    """
    path = Path(path)
    try:
        if path.is_dir():
            raise ExperimentError(f"{path} is a folder, and an experiment is a YAML file.")
        text = files.read(path, LARGEST_SETTINGS).decode("utf-8")
    except FileNotFoundError:
        raise ExperimentError(f"There is no experiment {path}: the file does not exist.") from None
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise ExperimentError(f"{path}, line {line}: it is not written in UTF-8.") from None
    except UserError as error:
        raise ExperimentError(error.on_command_line) from None
    return _parse(text, path.stem, str(path))


@functools.cache
def experiment_named(name: str) -> Experiment:
    """Return the paradigm called ``name`` that ships with the toolkit.

    Raises:
        ExperimentError: there is none; the sentence names those there are.
    """
    name = ALIASES.get(name, name)
    if name not in PARADIGMS:
        raise ExperimentError(f"Unknown experiment {shown(name)}; choose from {', '.join(PARADIGMS)}.")
    return _parse(*_shipped(name))


def find_experiment(experiment: str | PathLike[str] | Experiment) -> Experiment:
    """Return an experiment: one that is given, that of a YAML file, or a paradigm by its name.

    Raises:
        ExperimentError: there is none of that name, or a file that holds none.
        TypeError: something else.
    """
    if isinstance(experiment, Experiment):
        return experiment
    if not isinstance(experiment, (str, PathLike)):
        raise TypeError(f"task must be a name, a Task or an Experiment, got {type(experiment).__name__}.")
    if is_file(experiment):
        return experiment_from_file(experiment)
    name = str(experiment)
    if ALIASES.get(name, name) in PARADIGMS:
        return experiment_named(name)
    raise ExperimentError(unknown_task(name))


def is_file(task: str | PathLike[str]) -> bool:
    """Whether words for a task are the path of a file."""
    return not isinstance(task, str) or task.lower().endswith(SUFFIXES) or os.sep in task


def unknown_task(task: str) -> str:
    """Say that there is no such task, and what there is."""
    names = [*TASK_SPECS, *PARADIGMS]
    near = difflib.get_close_matches(task, names, n=1)
    hint = f"; you may have meant {near[0]}" if near else ""
    return f"Unknown task {shown(task)}; choose from {', '.join(names)}, or give the .yaml file of an experiment{hint}."


def paradigms() -> dict[str, str]:
    """Return what each experiment that ships is about, by its name."""
    return {name: _read(*_shipped(name))[0].description for name in PARADIGMS}


def _shipped(name: str) -> tuple[str, str, str]:
    file = importlib.resources.files("bilateral_rl.envs.experiments").joinpath("paradigms", f"{name}.yaml")
    return file.read_text(encoding="utf-8"), name, str(file)


def _parse(text: str, name: str, source: str) -> Experiment:
    experiment, settings, lines = _read(text, name, source)
    _check_effects(experiment, lines, source)
    _check_fit(experiment, settings, lines, source)
    return experiment


def _read(text: str, name: str, source: str) -> tuple[Experiment, TrialSettings, Lines]:
    try:
        values, lines = parse_with_lines(text)
    except ValueError as error:
        raise ExperimentError(f"{source}, {error}.") from None
    if not isinstance(values, Mapping):
        kind = "is empty" if values is None else f"holds {shown(values)}"
        raise ExperimentError(f"{source}, line 1: it {kind}, and an experiment needs start and target by name.")
    if isinstance(values.get("experiment"), Mapping):  # the configuration of a run
        values, lines = values["experiment"], lines.within("experiment")
    experiment = _built(Experiment, {"name": name, **values}, lines, source)
    settings = _built(_TrialSection, {"trial": experiment.trial}, lines, source).trial
    return experiment, settings, lines


@dataclass(frozen=True, config=STRICT)
class _TrialSection:
    trial: TrialSettings


def _built(cls: type[T], values: Mapping[str, Any], lines: Lines, source: str) -> T:
    try:
        return TypeAdapter(cls).validate_python(values)
    except ValidationError as error:
        loc = [part for part in first_error(error)["loc"] if not str(part).startswith("<")]
        sentence = refusal(cls, error)
        named = sentence.partition(" ")[0].rstrip(":").split(".")  # which may be within what pydantic names
        raise ExperimentError(f"{source}, line {max(lines.of(loc), lines.of(named))}: {sentence}") from None


def _check_effects(experiment: Experiment, lines: Lines, source: str) -> None:
    for name, sentence in without_effect(experiment):
        raise ExperimentError(f"{source}, line {lines.of(name.split('.'))}: {name} {sentence}")


def _check_fit(experiment: Experiment, settings: TrialSettings, lines: Lines, source: str) -> None:
    from bilateral_rl.envs.experiments.checks import UnfitExperimentError, check_experiment  # numerical

    try:
        check_experiment(experiment, settings)
    except UnfitExperimentError as error:
        raise ExperimentError(f"{source}, line {lines.of(error.field.split('.'))}: {error}") from None
