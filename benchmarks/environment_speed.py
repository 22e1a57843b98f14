"""Speed of stepping the environments, on one core."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from bilateral_rl.envs import ArmEnv, ArmVecEnv

ROUNDS = 5


def best_rate(step: Callable[[], None], steps: int, arms: int) -> float:
    """Arm-steps per second, the best of a few rounds: what the code can do when the machine lets it."""
    rates = []
    for _ in range(ROUNDS):
        began = time.perf_counter()
        for _ in range(steps):
            step()
        rates.append(steps * arms / (time.perf_counter() - began))
    return max(rates)


def batched(n_envs: int = 1024) -> float:
    env = ArmVecEnv(n_envs, seed=0)
    env.reset()
    action = np.random.default_rng(0).uniform(-1, 1, (n_envs, 6)).astype(np.float32)
    return best_rate(lambda: env.step(action) and None, 500, n_envs)


def single() -> float:
    env = ArmEnv()
    env.reset(seed=0)
    action = np.random.default_rng(0).uniform(-1, 1, 6).astype(np.float32)

    def step() -> None:
        *_, truncated, _ = env.step(action)
        if truncated:
            env.reset()

    return best_rate(step, 10_000, 1)


if __name__ == "__main__":
    print(f"ArmVecEnv.step, 1024 arms: {batched():>12,.0f} arm-steps/s")
    print(f"ArmEnv.step, 1 arm:        {single():>12,.0f} steps/s")
