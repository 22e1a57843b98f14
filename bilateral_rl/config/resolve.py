"""A whole configuration from what a user sets: the tuned defaults, layers of settings over them, and a check."""

from __future__ import annotations

import dataclasses
import functools
import importlib.resources
from collections.abc import Mapping, Sequence
from typing import Any

import yaml

from bilateral_rl.config.bounds import check, check_roles
from bilateral_rl.config.catalogue import check_names
from bilateral_rl.config.parse import Values, build, merge, plain_values
from bilateral_rl.config.schema import CONFIGS, BPTTConfig, RLConfig, SACConfig, TrainConfig
from bilateral_rl.config.tasks import TaskChoice, TaskWords, choose_task
from bilateral_rl.envs.task_specs import TASK_SPECS
from bilateral_rl.io.errors import UserError
from bilateral_rl.vocabulary import group_penalties


def resolve(
    algo: str | None,
    task: TaskWords | None,
    layers: Sequence[Mapping[str, Any]] = (),
    model: str | None = None,
) -> TrainConfig:
    """Build the configuration: the tuned defaults of the algorithm and task, then each of ``layers`` over it.

    A layer may be the whole configuration of another run. If that was of another algorithm or task, what it says only
    because it is the default there gives way to the defaults here. If it was of this one, what it does not say is a
    setting that an earlier version had not: it stays off, whatever is tuned for new trainings.

    Args:
        algo: an algorithm, or None for the one that the layers name.
        task: a task, an experiment or its file, or a class as ``module:Class``; None for the one that the layers name.
        layers: nested dictionaries of settings; later ones win.
        model: a model, or None for the one that the layers name.

    Raises:
        UserError: an unknown name or key, a value of the wrong type, or a number that cannot work.
    """
    chosen = {name: value for name, value in (("algo", algo), ("model", model)) if value is not None}
    names = _names_of({name: value for layer in (*layers, chosen) for name, value in layer.items()})
    check_names(**names)
    found = choose_task(task, layers, TrainConfig.task)
    values = _usual(names["algo"], found, _initial(layers))
    for layer in map(_without_what_is_gone, layers):
        if _is_whole(layer) and not _is_of_another(layer, names["algo"], found):
            values = {}
        values = merge(values, _without_defaults(layer) if _is_of_another(layer, names["algo"], found) else layer)
    experiment = None if found.experiment is None else plain_values(found.experiment)
    config = from_values(values | names | {"task": found.task, "experiment": experiment})
    check(config)
    for layer in layers:
        if not _is_whole(layer):
            _check_effect(layer, config)
    return config


def _check_effect(layer: Mapping[str, Any], config: TrainConfig) -> None:
    """Raise a UserError for what ``layer`` sets and another setting leaves without effect."""
    check_roles(layer, config)
    blocks = layer.get("blocks")
    if isinstance(blocks, Mapping) and blocks.keys() == {"trials"} and not config.blocks.every:
        raise UserError(
            "blocks.trials are of tests along an adaptation, of which there are none: give blocks.every too."
        )
    sac = layer.get("sac")
    if not isinstance(config, SACConfig) or config.sac.ent_coef is None or not isinstance(sac, Mapping):
        return
    for name in ("initial_ent_coef", "target_entropy"):
        if sac.get(name) is not None:
            raise UserError(
                f"sac.{name} is of a learned temperature, and sac.ent_coef gives one: leave one of them out."
            )


def check_penalty(layers: Sequence[Mapping[str, Any]], config: TrainConfig) -> None:
    """Raise a UserError for a weight penalty that one of ``layers`` sets and the loss of the model weighs by 0.

    It is asked where a single model is chosen: a study of many has one penalty for all, which some of them do without.
    """
    set_by_hand = any(
        isinstance(chosen := layer.get(config.algo), Mapping) and chosen.get("weight_penalty")
        for layer in layers
        if not _is_whole(layer)
    )
    if not set_by_hand or not isinstance(config, RLConfig):
        return
    if not any(group_penalties(config.spec.loss, weights=config.trial.losses.penalties).values()):
        raise UserError(
            f"{config.algo}.weight_penalty has no effect on {config.model}, whose loss weighs it by 0: leave it out, "
            "or give trial.losses a penalty."
        )


def _names_of(values: Mapping[str, Any]) -> dict[str, str]:
    return {name: str(values.get(name, getattr(TrainConfig, name))) for name in ("algo", "model")}


def _is_of_another(layer: Mapping[str, Any], algo: str, task: TaskChoice) -> bool:
    """Whether ``layer`` is the whole configuration of a run, but of another algorithm or task.

    Experiments are told by their names: what a run of one has changed is of that one.
    """
    return _is_whole(layer) and (layer["algo"], layer["task"]) != (algo, task.task)


def _is_whole(layer: Mapping[str, Any]) -> bool:
    """Whether ``layer`` is the whole configuration of a run, be it of an earlier version, which had fewer settings.

    Whoever writes settings by hand leaves out those that say nothing, such as ``init_from: null``.
    """
    algo, trial = str(layer.get("algo")), layer.get("trial")
    return (
        algo in CONFIGS
        and isinstance(layer.get("task"), str)
        and layer.keys() >= {*_OF_EVERY_RUN, algo}
        and isinstance(layer["network"], Mapping)
        and isinstance(trial, Mapping)
        and isinstance(arm := trial.get("arm"), Mapping)
        and arm.keys() >= _OF_EVERY_ARM
    )


_OF_EVERY_RUN = ("model", "seed", "device", "init_from", "network", "trial")
"""Names at the top of the configuration of a run of any version and algorithm."""
_OF_EVERY_ARM = {"timestep", "link_mass", "link_length", "max_isometric_force", "path_offset", "hill_a", "hill_b"}
"""Names of a few constants of the arm, all of which such a configuration states."""


def _without_what_is_gone(layer: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the whole configuration of a run without settings that did nothing and are no more; others as they are."""
    if not _is_whole(layer) or layer["algo"] != "td3":
        return layer
    # TD3 explores by its action_noise, and has no standard deviation to begin with.
    return {**layer, "network": {name: v for name, v in layer["network"].items() if name != "log_std_init"}}


def _without_defaults(layer: Mapping[str, Any]) -> Values:
    """Return what the configuration of a run sets beyond the tuned defaults of its own algorithm and task.

    Only that was somebody's choice: the rest was tuned for what it is no longer used for.
    """
    algo = layer["algo"]
    task = choose_task(None, [layer], TrainConfig.task)
    usual = from_values({"algo": algo} | _usual(algo, task, _initial([layer]))).to_values()
    return {name: value for name, value in difference(layer, usual).items() if name not in ("task", "experiment")}


def _initial(layers: Sequence[Mapping[str, Any]]) -> object:
    """Return the network that layers begin with; None for a fresh one."""
    return next((layer["init_from"] for layer in reversed(layers) if "init_from" in layer), None)


def _usual(algo: str, task: TaskChoice, init_from: object) -> Values:
    """Return the tuned defaults of an algorithm and a task, and the settings of trials that the task has.

    An experiment with a field has some of its own, and more where a network that has learned before adapts to it.
    """
    values = tuned_defaults(algo, task.tuned_as)
    if task.experiment is not None and task.experiment.has_field:
        table = _defaults_table()[algo]
        values = merge(values, table["in_field"])
        values = values if init_from is None else merge(values, table["adapting"])
    return merge(values, {"trial": task.trial} if task.trial else {})


def difference(values: Mapping[str, Any], base: Mapping[str, Any]) -> Values:
    """Return the entries of ``values`` that ``base`` does not have or has otherwise."""
    rest: Values = {}
    for key, value in values.items():
        if isinstance(value, Mapping) and isinstance(base.get(key), Mapping):
            if inner := difference(value, base[key]):
                rest[key] = inner
        elif key not in base or value != base[key]:
            rest[key] = value
    return rest


def tuned_defaults(algo: str, task: str) -> Values:
    """Return the settings that ``defaults.yaml`` holds for an algorithm and a task."""
    table = _defaults_table().get(algo, {})
    of_two_arms = table.get("two_arms") if TASK_SPECS[task].n_arms == 2 else None
    return merge(merge(table.get("any_task") or {}, of_two_arms or {}), table.get(task) or {})


def supervised(config: TrainConfig) -> BPTTConfig:
    """Return the supervised training by whose loss and settings the networks of a run adapt to a lesion.

    That is the run's own or, after training by rewards, the one that its task has by default.
    """
    if isinstance(config, BPTTConfig):
        return config
    usual = from_values({"algo": "bptt", **_usual("bptt", TaskChoice(config.task, config.experiment), None)})
    assert isinstance(usual, BPTTConfig)
    return usual


def quick_settings(algo: str) -> Values:
    """Return the settings that ``defaults.yaml`` holds for a preview of an algorithm; none if it holds none."""
    return dict(_defaults_table().get(algo, {}).get("quick") or {})


@functools.cache
def _defaults_table() -> Values:
    text = importlib.resources.files("bilateral_rl.config").joinpath("defaults.yaml").read_text(encoding="utf-8")
    table: Values = yaml.safe_load(text)
    return table


def from_values(values: Mapping[str, Any]) -> TrainConfig:
    """Build a configuration from what :meth:`TrainConfig.to_values` returned, or a part of it.

    Raises:
        UserError: an unknown name, a value of the wrong type or outside its bounds.
    """
    algo = values.get("algo", TrainConfig.algo)
    cls = CONFIGS[algo]
    others = set().union(*map(_names, CONFIGS.values())) - _names(cls)
    foreign = [name for name in values if name in others]
    if foreign:
        raise UserError(
            f"{foreign[0]} is a setting of another algorithm than {algo}; leave it out or choose the --algo."
        )
    return build(cls, values)


def _names(cls: type[TrainConfig]) -> set[str]:
    return {f.name for f in dataclasses.fields(cls)}
