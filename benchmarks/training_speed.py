"""Env-steps per second of training, end to end, against stock PPO on MotorNet's own arm, turn about in one run."""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from pathlib import Path

import torch
from motornet_env import MotorNetReach
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env

from bilateral_rl.config.resolve import resolve
from bilateral_rl.training.run import train


def ours(timesteps: int) -> float:
    """Steps/s of the default training with its logging, evaluations and saved weights."""
    with tempfile.TemporaryDirectory() as folder:
        outcome = train(resolve(None, None, [{"timesteps": timesteps}]), Path(folder))
    return outcome.done / outcome.seconds


def stock_on_motornet(timesteps: int) -> float:
    """Steps/s of stock PPO with a 10-10 actor, eight MotorNet arms, SB3's default minibatches and epochs."""
    torch.set_num_threads(2)
    env = make_vec_env(MotorNetReach, n_envs=8)
    n_steps = timesteps // 8
    model = PPO("MlpPolicy", env, n_steps=n_steps, policy_kwargs={"net_arch": {"pi": [10, 10], "vf": [64, 64]}})
    began = time.perf_counter()
    model.learn(n_steps * 8)
    return n_steps * 8 / (time.perf_counter() - began)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--timesteps", type=int, default=2_000_000, help="of ours, a round")
    arguments = parser.parse_args()
    pairs = []
    for round_ in range(arguments.rounds):
        pairs.append((ours(arguments.timesteps), stock_on_motornet(8192)))
        print(f"round {round_}: ours {pairs[-1][0]:,.0f}, stock PPO on MotorNet's arm {pairs[-1][1]:,.0f} env-steps/s")
    ratio = statistics.median(a / b for a, b in pairs)
    print(f"median: ours {statistics.median(a for a, _ in pairs):,.0f} env-steps/s, ratio {ratio:.0f}")
