"""The configuration of a training: typed fields, defaults as data, files and ``key=value`` overrides."""

from __future__ import annotations

import contextlib
import dataclasses
import importlib.resources
import math
import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from bilateral_rl.catalogue import check_names, find_model
from bilateral_rl.envs.arm import ArmParameters
from bilateral_rl.envs.trials import TrialSettings
from bilateral_rl.errors import UserError
from bilateral_rl.policies.networks import make_network

Values = dict[str, Any]


@dataclass(frozen=True)
class NetworkConfig:
    """The actor network and its critics."""

    units: int = 10
    """Units per hidden layer of the actor, over both sides."""
    layers: int = 2
    """Hidden layers of the actor."""
    critic_arch: tuple[int, ...] = (64, 64)
    """Units of each hidden layer of a critic."""
    log_std_init: float = -0.5
    """Log of the initial standard deviation of the action, before its squashing."""


@dataclass(frozen=True)
class PPOConfig:
    """Arguments of ``HemisphericPPO``."""

    learning_rate: float = 0.01
    final_learning_rate: float = 0.0
    """Reached linearly at the last step."""
    n_steps: int = 50
    """Steps per arm between updates."""
    batch_size: int = 5120
    n_epochs: int = 5
    gamma: float = 0.95
    gae_lambda: float = 0.9
    clip_range: float = 0.2
    ent_coef: float = 0.0
    vf_coef: float = 0.5
    max_grad_norm: float = 0.5
    """Of each parameter group."""
    weight_penalty: float = 0.001
    """λ of paper section 4."""
    reward_scale: float = 0.1


@dataclass(frozen=True)
class EvaluationConfig:
    """Evaluations and saved weights along the way."""

    every: int = 500_000
    """Environment steps between evaluations, whatever ``n_envs`` is."""
    trials: int = 256
    """Trials of an evaluation, the same ones each time, by the deterministic policy."""
    checkpoint_every: int = 2_500_000
    """Environment steps between saved weights."""
    seed: int = 1_000_000
    """Of the evaluation's trials; arm i uses seed + i."""


@dataclass(frozen=True)
class TrainConfig:
    """Everything that sets one training apart."""

    algo: str = "ppo"
    model: str = "cc_s"
    task: str = "random_reach"
    timesteps: int = 10_000_000
    """Environment steps, over all arms."""
    seed: int = 0
    n_envs: int = 1024
    """Arms simulated at once."""
    device: str = "cpu"
    """Where arms and networks are computed: "cpu" or "cuda"."""
    threads: int = 1
    """CPU threads of torch; more rarely pay for networks this small."""
    network: NetworkConfig = field(default_factory=NetworkConfig)
    ppo: PPOConfig = field(default_factory=PPOConfig)
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)
    trial: TrialSettings = field(default_factory=TrialSettings)

    def to_values(self) -> Values:
        """Nested dictionaries of plain numbers, strings and lists."""
        return typing.cast(Values, _plain(dataclasses.asdict(self)))


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
    text = importlib.resources.files("bilateral_rl").joinpath("defaults.yaml").read_text(encoding="utf-8")
    table: Values = yaml.safe_load(text)[algo]
    return merge(table.get("any_task") or {}, table.get(task) or {})


def merge(base: Mapping[str, Any], over: Mapping[str, Any]) -> Values:
    """``base`` with the entries of ``over``, nested dictionaries merged."""
    merged = dict(base)
    for key, value in over.items():
        both = isinstance(value, Mapping) and isinstance(merged.get(key), Mapping)
        merged[key] = merge(merged[key], value) if both else value
    return merged


def from_values(values: Mapping[str, Any]) -> TrainConfig:
    """The inverse of :meth:`TrainConfig.to_values`. Raises UserError for unknown keys and wrong types."""
    config = _build(TrainConfig, values, prefix="")
    assert isinstance(config, TrainConfig)
    return config


def load_file(path: Path) -> Values:
    """Settings from a YAML or JSON file, read without executing anything in it. Raises UserError."""
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"Cannot read the configuration {path}: {error}.") from None
    except yaml.YAMLError as error:
        raise UserError(f"The configuration {path} is neither YAML nor JSON: {_one_line(error)}.") from None
    if not isinstance(values, dict):
        raise UserError(f"The configuration {path} must hold settings by name, as `bilateral-rl train` writes them.")
    return values


def parse_overrides(items: Sequence[str]) -> Values:
    """``["ppo.learning_rate=0.003"]`` as nested dictionaries. Raises UserError for text of another form."""
    values: Values = {}
    for item in items:
        key, equals, text = item.partition("=")
        if not equals or not key:
            raise UserError(f"--set takes key=value, such as ppo.learning_rate=0.003, not {item!r}.")
        try:
            value = yaml.safe_load(text)
        except yaml.YAMLError:
            raise UserError(f"The value in --set {item!r} is neither a number, a word nor a list.") from None
        for part in reversed(key.split(".")):
            value = {part: value}
        values = merge(values, value)
    return values


def check(config: TrainConfig) -> None:
    """Raise a UserError for a number that cannot work, saying which would."""
    for name in ("timesteps", "n_envs", "threads"):
        _check_at_least(name, getattr(config, name), 1)
    for name in ("every", "trials", "checkpoint_every"):
        _check_at_least(f"evaluation.{name}", getattr(config.evaluation, name), 1)
    if config.seed < 0 or config.evaluation.seed < 0:
        raise UserError("A seed must be at least 0.")
    if config.device != "cpu" and not config.device.startswith("cuda"):
        raise UserError(f"Unknown device {config.device!r}; choose cpu or cuda.")
    _check_ppo(config.ppo, config.n_envs)
    network = config.network
    if not network.critic_arch or min(network.critic_arch) < 1:
        raise UserError(f"network.critic_arch needs a layer or more of a unit or more, got {network.critic_arch}.")
    try:
        make_network(find_model(config.model).architecture, 1, 1, network.units, network.layers)
    except ValueError as error:
        raise UserError(f"The model {config.model} cannot be built: {error}") from None


def _check_ppo(ppo: PPOConfig, n_envs: int) -> None:
    for name in ("n_steps", "n_epochs"):
        _check_at_least(f"ppo.{name}", getattr(ppo, name), 1)
    _check_at_least("ppo.batch_size", ppo.batch_size, 2)
    if ppo.n_steps * n_envs < 2:
        raise UserError("ppo.n_steps times n_envs must be at least 2: one sample has no advantage to normalize.")
    for name in ("learning_rate", "clip_range", "max_grad_norm", "reward_scale"):
        if not getattr(ppo, name) > 0:
            raise UserError(f"ppo.{name} must be positive, got {getattr(ppo, name)}.")
    for name in ("final_learning_rate", "ent_coef", "vf_coef", "weight_penalty"):
        if getattr(ppo, name) < 0:
            raise UserError(f"ppo.{name} must be at least 0, got {getattr(ppo, name)}.")
    for name in ("gamma", "gae_lambda"):
        if not 0 <= getattr(ppo, name) <= 1:
            raise UserError(f"ppo.{name} must lie between 0 and 1, got {getattr(ppo, name)}.")


def _check_at_least(name: str, value: int, least: int) -> None:
    if value < least:
        raise UserError(f"{name} must be at least {least}, got {value}.")


def _build(cls: type[Any], values: Mapping[str, Any], prefix: str) -> Any:
    if not isinstance(values, Mapping):
        raise UserError(f"{prefix.rstrip('.')} must hold settings by name, got {values!r}.")
    hints = typing.get_type_hints(cls)
    names = [f.name for f in dataclasses.fields(cls)]
    arguments = {}
    for name, value in values.items():
        if name not in names:
            place = f"in {prefix.rstrip('.')}" if prefix else "among the settings"
            raise UserError(f"Unknown setting {name!r} {place}; choose from {', '.join(names)}.")
        arguments[name] = _convert(hints[name], value, f"{prefix}{name}")
    try:
        return cls(**arguments)
    except ValueError as error:
        raise UserError(f"{prefix}{error}") from None


def _convert(hint: Any, value: Any, name: str) -> Any:
    if dataclasses.is_dataclass(hint):
        return _build(typing.cast(type[Any], hint), value, f"{name}.")
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        return None if value is None else _convert(arguments[0], value, name)
    if origin is tuple:
        if not isinstance(value, (list, tuple)):
            raise UserError(f"{name} must be a list, got {value!r}.")
        return tuple(_convert(arguments[0], item, name) for item in value)
    return _convert_scalar(hint, value, name)


def _convert_scalar(hint: Any, value: Any, name: str) -> Any:
    if hint is str and isinstance(value, str):
        return value
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if isinstance(value, str) and hint in (int, float):
        # YAML reads 1e-3 as a word.
        with contextlib.suppress(ValueError):
            value, is_number = float(value), True
    if hint is float and is_number and math.isfinite(value):
        return float(value)
    if hint is int and is_number and math.isfinite(value) and value == int(value):
        return int(value)
    wanted = {int: "a whole number", float: "a finite number", str: "a word"}[hint]
    raise UserError(f"{name} must be {wanted}, got {value!r}.")


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(v) for v in value]
    return value


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


__all__ = ["ArmParameters", "EvaluationConfig", "NetworkConfig", "PPOConfig", "TrainConfig", "resolve"]
