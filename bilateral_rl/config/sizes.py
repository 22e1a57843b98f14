"""What a configuration comes to in memory and time: bounds far beyond use, so that nobody's settings take all of it."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator, Sequence
from typing import Any

from bilateral_rl.config.schema import (
    BPTTConfig,
    OffPolicyConfig,
    OnPolicyConfig,
    RLConfig,
    SupervisedConfig,
    TrainConfig,
)
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.io.errors import UserError

MOST_NUMBERS = 5 * 10**8
"""In any of the large arrays: 2 GB."""
MOST_PARAMETERS = 10**7
"""Of a network or a critic."""
MOST_STEPS, MOST_LAYERS, MOST_THREADS = 2_000, 100, 1_000
SMALLEST, LARGEST = 1e-9, 1e6
"""Of any number but 0 that describes a trial or an arm, whatever its unit."""

_OBSERVED = 16
_OF_A_STEP = 64
"""Numbers kept of a step of an arm."""
_OF_A_TRIAL = 16
"""Numbers that set a trial."""


def check_sizes(config: TrainConfig) -> None:
    """Raise a UserError for a setting that would take far more memory or time than any use of it."""
    trial = config.trial
    bounds = [
        ("trial.trial_length", trial.trial_length, MOST_STEPS),
        ("trial.feedback_delay", trial.feedback_delay, MOST_STEPS),
        ("threads", getattr(config, "threads", 0), MOST_THREADS),
        ("network.layers", config.network.layers, MOST_LAYERS),
        ("the number of parameters of the network", _parameters(_hidden(config)), MOST_PARAMETERS),
    ]
    if isinstance(config, RLConfig):
        critic = config.network.critic_arch
        bounds.append(("the number of layers in network.critic_arch", len(critic), MOST_LAYERS))
        bounds.append(("the number of parameters of a critic", _parameters(critic), MOST_PARAMETERS))
    for name, size, most in bounds:
        if size > most:
            raise UserError(f"{name} must be at most {most:,}, got {size:,}.")
    for name, size in _arrays(config):
        if size > MOST_NUMBERS:
            raise UserError(f"{name} would make an array of {size:,} numbers, and {MOST_NUMBERS:,} are the most.")
    for name, value in _numbers("trial", dataclasses.asdict(trial)):
        if value and not SMALLEST <= abs(value) <= LARGEST:
            raise UserError(f"{name} must lie between {SMALLEST:g} and {LARGEST:g} in size, got {value:g}.")


def _arrays(config: TrainConfig) -> Iterator[tuple[str, int]]:
    """The settings that make each of the large ones, and roughly how many numbers it holds."""
    steps = config.trial.trial_length + config.trial.feedback_delay
    supervised, seeds = SupervisedConfig(), 1  # of the retraining after a lesion
    if isinstance(config, BPTTConfig):
        supervised, seeds = config.bptt, config.seeds
    of_a_step = sum(_hidden(config)) + _OF_A_STEP
    yield "seeds and network", seeds * _parameters(_hidden(config))
    yield "bptt.batch_size, seeds, trial and network", seeds * supervised.batch_size * steps * of_a_step
    yield "bptt.validation_trials, seeds, trial and network", seeds * supervised.validation_trials * steps * of_a_step
    yield "bptt.trials and seeds", seeds * supervised.trials * _OF_A_TRIAL
    if isinstance(config, RLConfig):
        given = config.hyperparameters
        yield "n_envs and trial", config.n_envs * steps * _OF_A_STEP
        yield "evaluation.trials and trial", config.evaluation.trials * steps * _OF_A_STEP
        if isinstance(given, OnPolicyConfig):
            yield f"n_envs and {config.algo}.n_steps", config.n_envs * given.n_steps * _OF_A_STEP
        if isinstance(given, OffPolicyConfig):
            yield f"{config.algo}.buffer_size", given.buffer_size * _OF_A_STEP


def _hidden(config: TrainConfig) -> list[int]:
    return [config.network.units] * min(config.network.layers, MOST_LAYERS + 1)


def _parameters(widths: Sequence[int]) -> int:
    """Of a network with these hidden layers, roughly."""
    sizes = [_OBSERVED, *widths, N_MUSCLES]
    return sum(n * m + m for n, m in itertools.pairwise(sizes))


def _numbers(name: str, value: Any) -> Iterator[tuple[str, float]]:
    """Every number in nested settings, with where it stands."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _numbers(f"{name}.{key}", item)
    elif isinstance(value, tuple):
        for item in value:
            yield from _numbers(name, item)
    else:
        yield name, value
