"""From what a user gives to a whole configuration: tuned defaults as data, layers over them, and a check."""

from __future__ import annotations

import dataclasses
import importlib.resources
from collections.abc import Mapping, Sequence
from typing import Any

import yaml

from bilateral_rl.config.catalogue import check_names
from bilateral_rl.config.checks import check
from bilateral_rl.config.parse import Values, build, merge
from bilateral_rl.config.schema import CONFIGS, TrainConfig
from bilateral_rl.io.errors import UserError


def resolve(
    algo: str | None, task: str | None, layers: Sequence[Mapping[str, Any]] = (), model: str | None = None
) -> TrainConfig:
    """Build the configuration: the tuned defaults of the algorithm and task, then each of ``layers`` over it.

    Args:
        algo: an algorithm, or None for what the layers say.
        task: a task, or None likewise.
        layers: nested dictionaries, later ones win.
        model: a model, or None likewise.

    Raises:
        UserError: an unknown name or key, a value of the wrong type, or a number that cannot work.
    """
    values: Values = {}
    for layer in layers:
        values = merge(values, layer)
    values |= {k: v for k, v in (("algo", algo), ("task", task), ("model", model)) if v is not None}
    names = {name: values.get(name, getattr(TrainConfig, name)) for name in ("algo", "model", "task")}
    check_names(**{name: str(value) for name, value in names.items()})
    config = from_values(merge(tuned_defaults(names["algo"], names["task"]), values))
    check(config)
    return config


def tuned_defaults(algo: str, task: str) -> Values:
    """What ``defaults.yaml`` holds for an algorithm and a task."""
    text = importlib.resources.files("bilateral_rl.config").joinpath("defaults.yaml").read_text(encoding="utf-8")
    table: Values = yaml.safe_load(text).get(algo, {})
    return merge(table.get("any_task") or {}, table.get(task) or {})


def from_values(values: Mapping[str, Any]) -> TrainConfig:
    """The inverse of :meth:`TrainConfig.to_values`. Raises UserError for unknown keys and wrong types."""
    algo = values.get("algo", TrainConfig.algo)
    cls = CONFIGS[algo]
    others = set().union(*map(_names, CONFIGS.values())) - _names(cls)
    foreign = [name for name in values if name in others]
    if foreign:
        raise UserError(
            f"{foreign[0]} is a setting of another algorithm than {algo}; leave it out or choose the --algo."
        )
    config = build(cls, values)
    assert isinstance(config, TrainConfig)
    return config


def _names(cls: type[TrainConfig]) -> set[str]:
    return {f.name for f in dataclasses.fields(cls)}
