"""Which algorithm, policy and environment a configuration stands for."""

from __future__ import annotations

import dataclasses
import math
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.noise import NormalActionNoise

from bilateral_rl.algorithms import ALGORITHM_CLASSES, Hemispheric
from bilateral_rl.config.catalogue import find_model
from bilateral_rl.config.schema import OffPolicyConfig, OnPolicyConfig, PPOConfig, RLConfig, SACConfig, TD3Config
from bilateral_rl.envs import ArmVecEnv
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.runs.policies import policy_arguments
from bilateral_rl.training.session import check_device


def build_algorithm(config: RLConfig) -> Hemispheric:
    """The algorithm, its environment and its policy, untrained. Raises UserError for a device that is not there."""
    check_device(config.device)
    warnings.filterwarnings("ignore", "You have specified a mini-batch size")  # the parts are as equal as can be
    torch.set_num_threads(config.threads)
    trial = {name: getattr(config.trial, name) for name in config.trial.__dataclass_fields__}
    env = ArmVecEnv(config.n_envs, config.task, device=config.device, **trial)
    algorithm_class = ALGORITHM_CLASSES[config.algo]
    algorithm = algorithm_class(
        algorithm_class.POLICY_CLASS,
        env,
        loss=find_model(config.model).loss,
        **algorithm_arguments(config),
        stats_window_size=max(100, config.n_envs),
        policy_kwargs=policy_arguments(config),
        seed=config.seed,
        device=config.device,
    )
    # SB3 has seeded arm i with seed + i, which neighboring seeds would share.
    env.seed_arms(np.random.SeedSequence(config.seed).generate_state(config.n_envs).tolist())
    return algorithm


def algorithm_arguments(config: RLConfig) -> dict[str, Any]:
    """The hyperparameters as the algorithm takes them."""
    given = config.hyperparameters
    arguments = {f.name: getattr(given, f.name) for f in dataclasses.fields(given)}
    arguments["learning_rate"] = linear_schedule(given.learning_rate, arguments.pop("final_learning_rate"))
    if isinstance(given, OnPolicyConfig):
        arguments["ent_coef"] = linear_schedule(given.ent_coef, arguments.pop("final_ent_coef"))
    if isinstance(given, PPOConfig):
        arguments["batch_size"] = _even_batch(given.batch_size, given.n_steps * config.n_envs)
    if isinstance(given, OffPolicyConfig):
        del arguments["n_critics"]  # the policy's
    if isinstance(given, SACConfig):
        initial = arguments.pop("initial_ent_coef")
        arguments["ent_coef"] = f"auto_{initial}" if given.ent_coef is None else given.ent_coef
        arguments["target_entropy"] = "auto" if given.target_entropy is None else given.target_entropy
    if isinstance(given, TD3Config):
        noise = np.full(N_MUSCLES, given.action_noise)
        arguments["action_noise"] = NormalActionNoise(np.zeros(N_MUSCLES), noise)
    return arguments


def _even_batch(largest: int, samples: int) -> int:
    """The minibatch size that splits ``samples`` into the fewest, most equal parts of at most ``largest``."""
    return math.ceil(samples / math.ceil(samples / largest))


@dataclass(frozen=True)
class linear_schedule:  # noqa: N801 - used as a function; a class so that SB3 can pickle it
    """Goes linearly from ``initial`` to ``final``, by the remaining progress (1 to 0)."""

    initial: float
    final: float

    def __call__(self, remaining: float) -> float:
        return self.final + (self.initial - self.final) * max(remaining, 0.0)
