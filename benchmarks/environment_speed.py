"""Speed of stepping the environments, on one core."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from bilateral_rl.envs import ArmEnv, ArmVecEnv
from bilateral_rl.envs.experiments.experiment import Experiment
from bilateral_rl.envs.experiments.task import ExperimentTask
from bilateral_rl.envs.tasks import TaskLike

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


def alternately(steps: Sequence[Callable[[], object]], arms: int) -> list[float]:
    """Arm-steps per second of several things that are done in turn: of each the best of many rounds."""
    times = np.empty((ROUNDS, len(steps)))
    for row in times:
        for i, step in enumerate(steps):
            began = time.perf_counter()
            for _ in range(STEPS):
                step()
            row[i] = time.perf_counter() - began
    return (STEPS * arms / times.min(axis=0)).tolist()


def batched(task: TaskLike, n_envs: int = 1024) -> Callable[[], object]:
    env = ArmVecEnv(n_envs, task, seed=0, trial_length=STEPS)
    env.reset()
    action = np.random.default_rng(0).uniform(-1, 1, (n_envs, 6)).astype(np.float32)
    return lambda: env.step(action)


def single() -> Callable[[], object]:
    env = ArmEnv()
    env.reset(seed=0)
    action = np.random.default_rng(0).uniform(-1, 1, 6).astype(np.float32)

    def step() -> None:
        *_, truncated, _ = env.step(action)
        if truncated:
            env.reset()

    return step


if __name__ == "__main__":
    tasks: dict[str, TaskLike] = {
        "random_reach": "random_reach",
        "reach in a curl field": ExperimentTask(Experiment(**REACH, forces={"curl": 15})),
        "reaches with everything": ExperimentTask(Experiment(**EVERYTHING)),
    }
    plain, *others = alternately([batched(task) for task in tasks.values()], 1024)
    for name, rate in zip(tasks, [plain, *others], strict=True):
        print(f"ArmVecEnv.step, 1024 arms, {name + ':':24} {rate:>11,.0f} arm-steps/s, {rate / plain:.2f} of the first")
    print(f"ArmEnv.step, 1 arm: {alternately([single()], 1)[0]:>11,.0f} steps/s")
