"""What a configuration can be: a number that cannot work is refused before anything is done with it."""

from __future__ import annotations

import dataclasses

from bilateral_rl.config.catalogue import MAX_SEEDS, check_choice, find_model
from bilateral_rl.config.schema import BPTTConfig, OnPolicyConfig, RLConfig, StreamConfig, TrainConfig
from bilateral_rl.config.sizes import check_sizes
from bilateral_rl.io.errors import UserError
from bilateral_rl.vocabulary import PENALTIES, PROFILES

MAX_ARMS, MAX_SIZE, MAX_CRITICS = 1_000_000, 10_000, 10
"""Bounds far beyond use, so that a slip of the finger is a sentence and not a full memory."""
MAX_SEED = 2**32 - 1


def check(config: TrainConfig) -> None:
    """Raise a UserError for a number that cannot work, saying which would."""
    _check_range("seed", config.seed, 0, MAX_SEED)
    _check_range("trial.trial_length", config.trial.trial_length, 1, MAX_SIZE)
    _check_range("network.units", config.network.units, 1, MAX_SIZE)
    _check_range("network.layers", config.network.layers, 1, MAX_SIZE)
    check_sizes(config)
    if config.device != "cpu" and not config.device.startswith("cuda"):
        raise UserError(f"Unknown device {config.device!r}; choose cpu or cuda.")
    _check_network(config)
    if isinstance(config, RLConfig):
        _check_rl(config)
    if isinstance(config, BPTTConfig):
        _check_bptt(config)


def _check_network(config: TrainConfig) -> None:
    """Refuse sizes that the architecture cannot have, without building it: that would draw random weights."""
    architecture, units, layers = find_model(config.model).architecture, config.network.units, config.network.layers
    trouble = None
    if architecture != "unilateral" and units % 2:
        trouble = f"a {architecture} network splits its units over two sides, and network.units = {units} is odd"
    elif architecture == "callosal" and units < 4:
        trouble = f"a callosal network pools two units a side, so network.units must be at least 4, got {units}"
    elif architecture == "callosal" and layers < 2:
        trouble = f"a callosum lies between hidden layers, so network.layers must be at least 2, got {layers}"
    if trouble is not None:
        raise UserError(f"The model {config.model} cannot be built: {trouble}.")


def _check_rl(config: RLConfig) -> None:
    for name in ("timesteps", "threads"):
        _check_at_least(name, getattr(config, name), 1)
    for name in ("every", "checkpoint_every"):
        _check_at_least(f"evaluation.{name}", getattr(config.evaluation, name), 1)
    _check_range("evaluation.seed", config.evaluation.seed, 0, MAX_SEED)
    _check_range("n_envs", config.n_envs, 1, MAX_ARMS)
    _check_range("evaluation.trials", config.evaluation.trials, 1, MAX_ARMS)
    critic_arch = config.network.critic_arch
    if not critic_arch or min(critic_arch) < 1 or max(critic_arch) > MAX_SIZE:
        raise UserError(f"network.critic_arch needs layers of 1 to {MAX_SIZE:,} units, got {list(critic_arch)}.")
    _check_at_least("evaluation.lesion_probe_every", config.evaluation.lesion_probe_every, 0)
    _check_hyperparameters(config.algo, config.hyperparameters, config.n_envs)


def _check_bptt(config: BPTTConfig) -> None:
    check_choice("profile", config.profile, PROFILES)
    check_choice("bptt.penalty", config.penalty, PENALTIES)
    _check_range("seeds", config.seeds, 1, MAX_SEEDS)
    _check_range("the last seed, seed + seeds - 1,", config.seed + config.seeds - 1, 0, MAX_SEED)
    _check_at_least("epochs", config.epochs, 1)
    _check_range("threads", config.threads, 0, MAX_SIZE)
    settings, trial = config.bptt, config.trial
    _check_at_least("bptt.patience", settings.patience, 1)
    for name in ("batch_size", "trials", "validation_trials"):
        _check_range(f"bptt.{name}", getattr(settings, name), 1, MAX_ARMS)
    if settings.trials % settings.batch_size:
        raise UserError(
            f"bptt.trials must be a multiple of bptt.batch_size, got {settings.trials} and {settings.batch_size}."
        )
    for name in ("learning_rate", "epsilon", "clip_norm"):
        if not getattr(settings, name) > 0:
            raise UserError(f"bptt.{name} must be positive, got {getattr(settings, name)}.")
    if config.penalty_coefficient < 0:
        raise UserError(f"bptt.penalty_coefficient must be at least 0, got {config.penalty_coefficient}.")
    if config.penalty != "weights":  # the others look at rates of change
        _check_range("trial.trial_length", trial.trial_length, 2, MAX_SIZE)
    if trial.noisy or trial.feedback_delay:
        raise UserError(
            "BPTT goes through an arm without noise or delay: leave out trial.sensory_noise, trial.motor_noise and "
            "trial.feedback_delay, or train with --algo ppo."
        )


_POSITIVE = (
    "learning_rate", "initial_ent_coef", "clip_range", "max_grad_norm", "reward_scale", "tau", "target_policy_noise",
    "target_noise_clip",
)  # fmt: skip
_AT_LEAST_ZERO = (
    "final_learning_rate", "ent_coef", "final_ent_coef", "vf_coef", "weight_penalty", "action_noise", "learning_starts",
    "critic_warm_up",
)  # fmt: skip
_FRACTIONS = ("gamma", "gae_lambda", "tau")
_AT_LEAST_ONE = ("n_steps", "n_epochs", "train_freq", "gradient_steps", "policy_delay", "buffer_size")


def _check_hyperparameters(algo: str, hyperparameters: StreamConfig, n_envs: int) -> None:
    values = {f.name: getattr(hyperparameters, f.name) for f in dataclasses.fields(hyperparameters)}
    given = {name: value for name, value in values.items() if value is not None}
    for name in _AT_LEAST_ONE:
        if name in given:
            _check_at_least(f"{algo}.{name}", given[name], 1)
    if "batch_size" in given:
        _check_range(f"{algo}.batch_size", given["batch_size"], 2, MAX_ARMS * MAX_SIZE)
    if "n_critics" in given:
        _check_range(f"{algo}.n_critics", given["n_critics"], 1, MAX_CRITICS)
    if isinstance(hyperparameters, OnPolicyConfig) and hyperparameters.n_steps * n_envs < 2:
        raise UserError(f"{algo}.n_steps times n_envs must be at least 2: one sample has no advantage to normalize.")
    for name in _POSITIVE:
        if name in given and not given[name] > 0:
            raise UserError(f"{algo}.{name} must be positive, got {given[name]}.")
    for name in _AT_LEAST_ZERO:
        if name in given and given[name] < 0:
            raise UserError(f"{algo}.{name} must be at least 0, got {given[name]}.")
    for name in _FRACTIONS:
        if name in given and not 0 <= given[name] <= 1:
            raise UserError(f"{algo}.{name} must lie between 0 and 1, got {given[name]}.")


def _check_at_least(name: str, value: int, least: int) -> None:
    if value < least:
        raise UserError(f"{name} must be at least {least}, got {value}.")


def _check_range(name: str, value: int, least: int, most: int) -> None:
    if not least <= value <= most:
        raise UserError(f"{name} must lie between {least} and {most:,}, got {value:,}.")
