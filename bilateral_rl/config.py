"""The configuration of a training: typed fields, tuned defaults as data, and what can work."""

from __future__ import annotations

import dataclasses
import importlib.resources
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import yaml

from bilateral_rl.catalogue import check_names, find_model
from bilateral_rl.envs.trials import TrialSettings
from bilateral_rl.errors import UserError
from bilateral_rl.policies.networks import make_network
from bilateral_rl.settings import Values, build, merge, plain

MAX_ARMS, MAX_SIZE = 1_000_000, 10_000
"""Bounds far beyond use, so that a slip of the finger is a sentence and not a full memory."""


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
    """Arguments of ``HemisphericPPO``; the tuned values are in ``defaults.yaml``."""

    learning_rate: float = 3e-4
    final_learning_rate: float = 0.0
    """Reached linearly at the last step."""
    n_steps: int = 50
    """Steps per arm between updates."""
    batch_size: int = 5120
    n_epochs: int = 5
    gamma: float = 0.99
    gae_lambda: float = 0.95
    clip_range: float = 0.2
    ent_coef: float = 0.0
    """Too little, and the exploration narrows before the hand finds its way."""
    final_ent_coef: float = 0.0
    """Reached linearly at the last step."""
    vf_coef: float = 0.5
    max_grad_norm: float = 0.5
    """Of each parameter group."""
    weight_penalty: float = 0.001
    """λ of paper section 4."""
    reward_scale: float = 1.0


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
    timesteps: int = 12_000_000
    """Environment steps, over all arms."""
    seed: int = 0
    n_envs: int = 1024
    """Arms simulated at once."""
    device: str = "cpu"
    """Where arms and networks are computed: "cpu" or "cuda"."""
    threads: int = 1
    """CPU threads of torch. A second one gains a fifth on an idle machine and loses half on a busy one."""
    network: NetworkConfig = field(default_factory=NetworkConfig)
    ppo: PPOConfig = field(default_factory=PPOConfig)
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)
    trial: TrialSettings = field(default_factory=TrialSettings)

    def to_values(self) -> Values:
        """Nested dictionaries of plain numbers, strings and lists."""
        return typing.cast(Values, plain(dataclasses.asdict(self)))


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


def from_values(values: Mapping[str, Any]) -> TrainConfig:
    """The inverse of :meth:`TrainConfig.to_values`. Raises UserError for unknown keys and wrong types."""
    config = build(TrainConfig, values)
    assert isinstance(config, TrainConfig)
    return config


def check(config: TrainConfig) -> None:
    """Raise a UserError for a number that cannot work, saying which would."""
    for name in ("timesteps", "n_envs", "threads"):
        _check_at_least(name, getattr(config, name), 1)
    for name in ("every", "trials", "checkpoint_every"):
        _check_at_least(f"evaluation.{name}", getattr(config.evaluation, name), 1)
    for name, value, most in (
        ("seed", config.seed, 2**32 - 1),
        ("evaluation.seed", config.evaluation.seed, 2**32 - 1),
        ("n_envs", config.n_envs, MAX_ARMS),
        ("evaluation.trials", config.evaluation.trials, MAX_ARMS),
        ("trial.trial_length", config.trial.trial_length, MAX_SIZE),
        ("network.units", config.network.units, MAX_SIZE),
        ("network.layers", config.network.layers, MAX_SIZE),
        ("network.critic_arch", max(config.network.critic_arch, default=0), MAX_SIZE),
    ):
        if not 0 <= value <= most:
            raise UserError(f"{name} must lie between 0 and {most:,}, got {value:,}.")
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
    for name in ("final_learning_rate", "ent_coef", "final_ent_coef", "vf_coef", "weight_penalty"):
        if getattr(ppo, name) < 0:
            raise UserError(f"ppo.{name} must be at least 0, got {getattr(ppo, name)}.")
    for name in ("gamma", "gae_lambda"):
        if not 0 <= getattr(ppo, name) <= 1:
            raise UserError(f"ppo.{name} must lie between 0 and 1, got {getattr(ppo, name)}.")


def _check_at_least(name: str, value: int, least: int) -> None:
    if value < least:
        raise UserError(f"{name} must be at least {least}, got {value}.")
