"""The algorithm, policy and environment that a configuration stands for."""

from __future__ import annotations

import dataclasses
import warnings
from typing import Any

import numpy as np

from bilateral_rl.algorithms import ALGORITHM_CLASSES, Hemispheric
from bilateral_rl.config.schema import RLConfig
from bilateral_rl.envs import ArmVecEnv
from bilateral_rl.envs.doors import arguments_for
from bilateral_rl.io.threads import torch_threads
from bilateral_rl.runs.policies import policy_arguments
from bilateral_rl.vocabulary import group_penalties


def build_algorithm(config: RLConfig) -> Hemispheric:
    """Build the algorithm, its environment and its policy, untrained."""
    task = config.make_task()
    env = ArmVecEnv(config.n_envs, task, device=config.device, **arguments_for(task, config.trial))
    algorithm_class = ALGORITHM_CLASSES[config.algo]
    # The orthogonal initialization of critics rounds otherwise with another number of threads.
    with torch_threads(config.threads), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "You have specified a mini-batch size")  # the parts are as equal as can be
        algorithm = algorithm_class(
            algorithm_class.POLICY_CLASS,
            env,
            loss=config.spec.loss,
            frozen=config.frozen,
            penalty_weights=config.trial.losses.penalties,
            **algorithm_arguments(config) | _no_penalty(config),
            stats_window_size=max(100, config.n_envs),
            policy_kwargs=policy_arguments(config),
            seed=config.seed,
            device=config.device,
        )
    # SB3 has seeded arm i with seed + i, which neighboring seeds would share.
    env.seed_arms(np.random.SeedSequence(config.seed).generate_state(config.n_envs).tolist())
    return algorithm


def algorithm_arguments(config: RLConfig) -> dict[str, Any]:
    """Return the hyperparameters as the algorithm's constructor takes them."""
    hyperparameters = dataclasses.asdict(config.hyperparameters)
    algorithm = ALGORITHM_CLASSES[config.algo]
    return algorithm.constructor_arguments(hyperparameters, config.timesteps, config.n_envs, config.n_muscles)


def _no_penalty(config: RLConfig) -> dict[str, Any]:
    """Return the coefficient 0 of a penalty that weighs nothing in the model's loss, whatever the usual one is."""
    weights = group_penalties(config.spec.loss, weights=config.trial.losses.penalties)
    return {} if any(weights.values()) else {"weight_penalty": 0.0}
