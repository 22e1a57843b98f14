"""Env-steps per second of HemisphericSAC against stock SAC on the same arms with the same settings, turn about.

Stock SAC has an actor of two layers of ten units and two critics; ours has the callosal network, and two critics for
each of its two reward streams.
"""

from __future__ import annotations

import argparse
import statistics
import time

import torch
from stable_baselines3 import SAC
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import SACConfig
from bilateral_rl.envs import ArmVecEnv
from bilateral_rl.training.build import algorithm_arguments, build_algorithm


def ours(config: SACConfig) -> OffPolicyAlgorithm:
    """HemisphericSAC with the default settings."""
    algorithm = build_algorithm(config)
    assert isinstance(algorithm, OffPolicyAlgorithm)
    return algorithm


def stock(config: SACConfig) -> OffPolicyAlgorithm:
    """Stock SAC with the same arms, batches, updates and critic sizes."""
    given = config.sac
    buffer_size = algorithm_arguments(config)["buffer_size"]
    return SAC(
        "MlpPolicy",
        ArmVecEnv(config.n_envs, config.make_task(), seed=0),
        learning_starts=given.learning_starts,
        batch_size=given.batch_size,
        train_freq=given.train_freq,
        gradient_steps=given.gradient_steps,
        buffer_size=buffer_size,
        policy_kwargs={"net_arch": {"pi": [10, 10], "qf": list(config.network.critic_arch)}},
        device="cpu",
    )


def speed(algorithm: OffPolicyAlgorithm, timesteps: int) -> float:
    """Env-steps/s once updates have begun."""
    algorithm.learn(algorithm.learning_starts + 1, log_interval=10**9)
    before, began = algorithm.num_timesteps, time.perf_counter()
    algorithm.learn(timesteps, log_interval=10**9, reset_num_timesteps=False)
    return (algorithm.num_timesteps - before) / (time.perf_counter() - began)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--timesteps", type=int, default=30_000, help="a round")
    arguments = parser.parse_args()
    config = resolve("sac", "random_reach")
    assert isinstance(config, SACConfig)
    torch.set_num_threads(1)
    pairs = []
    for round_ in range(arguments.rounds):
        pairs.append((speed(ours(config), arguments.timesteps), speed(stock(config), arguments.timesteps)))
        print(f"round {round_}: HemisphericSAC {pairs[-1][0]:,.0f}, stock SAC {pairs[-1][1]:,.0f} env-steps/s")
    print(f"median ratio {statistics.median(a / b for a, b in pairs):.2f}")
