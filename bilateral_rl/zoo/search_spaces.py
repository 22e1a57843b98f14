"""The hyperparameters that rl_zoo3's ``--optimize`` searches, for each hemispheric algorithm.

The sizes of the network are not among them: they belong to the model.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import optuna
from stable_baselines3.common.noise import NormalActionNoise

from bilateral_rl.zoo.hyperparameters import parse_schedule

Values = dict[str, Any]
Sampler = Callable[[optuna.Trial, int, int, Values], Values]


_TRACES = {"none": [], "short": [0.5], "short and long": [0.5, 0.8]}
"""Decays of action traces by what a search calls them."""


def _every_algorithm(trial: optuna.Trial) -> None:
    trial.suggest_float("learning_rate", 1e-4, 3e-2, log=True)
    trial.suggest_float("one_minus_gamma", 0.003, 0.1, log=True)
    trial.suggest_float("reward_scale", 0.1, 10.0, log=True)
    trial.suggest_categorical("action_traces", list(_TRACES))


def _on_policy(trial: optuna.Trial) -> None:
    _every_algorithm(trial)
    trial.suggest_categorical("n_steps", [5, 10, 25, 50, 100])
    trial.suggest_float("gae_lambda", 0.9, 1.0)
    trial.suggest_float("ent_coef", 1e-4, 3e-2, log=True)
    trial.suggest_float("max_grad_norm", 0.3, 10.0, log=True)


def _off_policy(trial: optuna.Trial) -> None:
    _every_algorithm(trial)
    trial.suggest_categorical("batch_size", [128, 256, 512, 1024, 2048])
    trial.suggest_float("tau", 0.001, 0.08, log=True)
    trial.suggest_categorical("train_freq", [1, 2, 5, 10])
    trial.suggest_categorical("gradient_steps", [1, 2, 5, 10])
    trial.suggest_categorical("standardize_inputs", [False, True])
    trial.suggest_categorical("actor_value", ["min", "mean", "first"])
    trial.suggest_categorical("normalize_streams", [False, True])
    trial.suggest_categorical("policy_delay", [1, 2, 4])


def _ppo(trial: optuna.Trial) -> None:
    _on_policy(trial)
    trial.suggest_categorical("batch_size", [640, 1280, 2560, 5120, 10240])
    trial.suggest_categorical("n_epochs", [1, 3, 5, 10])
    trial.suggest_categorical("clip_range", [0.1, 0.2, 0.3, 0.4])


def _a2c(trial: optuna.Trial) -> None:
    _on_policy(trial)
    trial.suggest_categorical("normalize_advantage", [False, True])
    trial.suggest_categorical("use_rms_prop", [False, True])


def _td3(trial: optuna.Trial) -> None:
    _off_policy(trial)
    trial.suggest_float("noise_std", 0.02, 0.5)


_SPACES: dict[str, Callable[[optuna.Trial], None]] = {
    "hemispheric_ppo": _ppo,
    "hemispheric_a2c": _a2c,
    "hemispheric_sac": _off_policy,
    "hemispheric_td3": _td3,
}


def _on_policy_hyperparameters(params: Values) -> Values:
    """A trial's parameters in rl_zoo3's form; learning rate and entropy bonus decay to zero."""
    decaying = {name: f"lin_{params[name]}" for name in ("learning_rate", "ent_coef")}
    return _hyperparameters(params) | decaying


def _hyperparameters(params: Values) -> Values:
    """A trial's parameters in rl_zoo3's form."""
    values = dict(params)
    values["gamma"] = 1 - values.pop("one_minus_gamma")
    values["action_traces"] = list(_TRACES[values["action_traces"]])
    if "noise_std" in values:
        values["noise_type"] = "normal"
    return values


CONVERTERS: dict[str, Callable[[Values], Values]] = {
    "hemispheric_ppo": _on_policy_hyperparameters,
    "hemispheric_a2c": _on_policy_hyperparameters,
    "hemispheric_sac": _hyperparameters,
    "hemispheric_td3": _hyperparameters,
}
"""Functions from a trial's parameters to hyperparameters in rl_zoo3's form, in which schedules are text."""


def _sampler(algo: str) -> Sampler:
    def sample(trial: optuna.Trial, n_actions: int, n_envs: int, additional_args: Values) -> Values:
        """Draw the hyperparameters of a trial, as arguments of the algorithm."""
        _SPACES[algo](trial)
        values = CONVERTERS[algo](trial.params)
        if values.pop("noise_type", None):
            std = np.full(n_actions, values.pop("noise_std"))
            values["action_noise"] = NormalActionNoise(np.zeros(n_actions), std)
        return {name: (isinstance(value, str) and parse_schedule(value)) or value for name, value in values.items()}

    return sample


SAMPLERS: dict[str, Sampler] = {algo: _sampler(algo) for algo in _SPACES}
