"""Speed of stepping the environments, on one core."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bilateral_rl.envs import ArmEnv, ArmVecEnv
from bilateral_rl.envs.experiments.experiment import Experiment
from bilateral_rl.envs.experiments.task import ExperimentTask
from bilateral_rl.envs.tasks import TaskLike

Round = Callable[[], list[float]]
"""Does ``STEPS`` steps, and returns the seconds of each: on a busy machine more of them go by undisturbed."""
ROUNDS = 200
STEPS = 50
"""Of a round: a trial, and what it takes to begin the next one."""
REACH = {"name": "reach", "start": {"joints": "uniform"}, "target": {"joints": "uniform"}}
EVERYTHING = {
    "name": "everything",
    "start": {"hand": [0.0, 0.4]},
    "target": {"center_out": {"number": 8, "radius": 0.1}},
    "timeline": {"go": [5, 10], "jump": {"at": 10, "offset": [[0.03, 0.0], [-0.03, 0.0]], "share": 0.5}},
    "forces": {
        "curl": 15,
        "pulse": {"force": [5.0, 0.0], "at": 5, "steps": 5, "share": 0.5},
        "channel": {"share": 0.1},
    },
    "trial": {"vision_delay": 5, "losses": {"dominant": {"hand_speed": 0.1}}},
}


def alternately(rounds: Sequence[Round], arms: int) -> list[float]:
    """Arm-steps per second of several things that are done in turn, of each step of a round the best of many."""
    times = np.array([[seconds() for seconds in rounds] for _ in range(ROUNDS)])
    return (STEPS * arms / times.min(axis=0).sum(axis=1)).tolist()


def timed(step: Callable[[], object]) -> Round:
    """A round of ``step``."""

    def seconds() -> list[float]:
        moments = [time.perf_counter()]
        for _ in range(STEPS):
            step()
            moments.append(time.perf_counter())
        return np.diff(moments).tolist()

    return seconds


def batched(task: TaskLike, n_envs: int = 1024) -> Round:
    env = ArmVecEnv(n_envs, task, seed=0, trial_length=STEPS)
    env.reset()
    action = np.random.default_rng(0).uniform(-1, 1, (n_envs, *env.action_space.shape)).astype(np.float32)
    return timed(lambda: env.step(action))


def single() -> Round:
    env = ArmEnv()
    env.reset(seed=0)
    action = np.random.default_rng(0).uniform(-1, 1, 6).astype(np.float32)

    def step() -> None:
        *_, truncated, _ = env.step(action)
        if truncated:
            env.reset()

    return timed(step)


def elsewhere(checkout: Path) -> Round:
    """A round of 1024 single arms of another checkout, in a process of its own that waits between rounds."""
    command = [sys.executable, __file__, "--rounds-on-demand"]
    pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    process = subprocess.Popen(command, env=os.environ | {"PYTHONPATH": str(checkout)}, **pipes)

    def seconds() -> list[float]:
        assert process.stdin is not None
        assert process.stdout is not None
        print(file=process.stdin, flush=True)
        return [float(word) for word in process.stdout.readline().split()]

    return seconds


def experiments() -> None:
    tasks: dict[str, TaskLike] = {
        "random_reach": "random_reach",
        "reach in a curl field": ExperimentTask(Experiment(**REACH, forces={"curl": 15})),
        "reaches with everything": ExperimentTask(Experiment(**EVERYTHING)),
    }
    plain, *others = alternately([batched(task) for task in tasks.values()], 1024)
    for name, rate in zip(tasks, [plain, *others], strict=True):
        print(f"ArmVecEnv.step, 1024 arms, {name + ':':24} {rate:>11,.0f} arm-steps/s, {rate / plain:.2f} of the first")


def pairs() -> None:
    tasks = ("two_reaches", "reach_and_hold", "two_holds")
    single_arms, *others = alternately([batched("random_reach", 2048), *map(batched, tasks)], 2048)
    print(f"ArmVecEnv.step, 2048 single arms, random_reach:     {single_arms:>11,.0f} arm-steps/s")
    for name, rate in zip(tasks, others, strict=True):
        print(
            f"ArmVecEnv.step, 1024 pairs, {name + ':':23} {rate:>11,.0f} arm-steps/s, {rate / single_arms:.2f} of them"
        )


def against(checkout: Path) -> None:
    here, there = alternately([elsewhere(Path(__file__).parents[1]), elsewhere(checkout.resolve())], 1024)
    print(
        f"ArmVecEnv.step, 1024 arms, random_reach: {here:,.0f} arm-steps/s here, {there:,.0f} there: {here / there:.3f}"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path, help="another checkout, whose single arms step turn about with these")
    parser.add_argument("--rounds-on-demand", action="store_true", help="what --against starts")
    arguments = parser.parse_args()
    if arguments.rounds_on_demand:
        seconds = batched("random_reach")
        for _ in sys.stdin:
            print(*seconds(), flush=True)
    elif arguments.against:
        against(arguments.against)
    else:
        experiments()
        pairs()
        print(f"ArmEnv.step, 1 arm: {alternately([single()], 1)[0]:>11,.0f} steps/s")
