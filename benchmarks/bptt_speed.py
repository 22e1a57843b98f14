"""Milliseconds of a BPTT update, 64 trials of 50 steps, stacked and alone, and against MotorNet's PyTorch arm.

Random reaches, and reaches around a center in a curl field, which MotorNet takes as a load computed anew every step;
and reaches of one hand while the other holds, tied to it by a spring, against as many trials of one arm.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable

import motornet
import numpy as np
import torch
from torch import Tensor

from bilateral_rl.bptt.history import history_columns
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.state import TrainingState
from bilateral_rl.bptt.trainer import Trainer
from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import BPTTConfig
from bilateral_rl.envs.kinematics import inverse_kinematics
from bilateral_rl.runs.policies import build_network

TRIALS, STEPS = 64, 50
PLAIN, FIELD, PAIR = "random_reach", "curl_field", "reach_and_hold"
CASES = [
    *(
        (model, seeds, PLAIN, 10)
        for model, seeds in (("cc_s", 10), ("cc_ns", 10), ("cc_s", 1), ("cc_ns", 1), ("uni_dl", 10))
    ),
    *((model, seeds, FIELD, 10) for model, seeds in (("cc_s", 10), ("cc_ns", 1))),
    *(("cc_s", 10, *case) for case in ((PAIR, 10), (PLAIN, 20), (PAIR, 20))),
]
CURL = 15.0
"""Of the field (N·s/m), as in the paradigm."""


def name_of(model: str, seeds: int, task: str, units: int) -> str:
    """What is printed of a case."""
    return f"{model}, {task}, {units} units, {seeds} seed(s)"


def ours(model: str, seeds: int, task: str, units: int) -> Callable[[], float]:
    """A function that runs an epoch, validation included, and gives the milliseconds of an update of one seed."""
    values = {"seeds": seeds, "trial": {"trial_length": STEPS}, "network": {"units": units}}
    config = resolve("bptt", task, [values], model=model)
    assert isinstance(config, BPTTConfig)
    networks = [build_network(config) for _ in range(seeds)]
    layout = Layout(networks[0])
    state = TrainingState.start(layout.pack([n.state_dict() for n in networks]), len(history_columns(config, layout)))
    trainer = Trainer(config, layout, state)
    state.best_loss[:] = -torch.inf  # nobody shall stop while we look on the clock

    def measure() -> float:
        state.waited[:] = -1_000_000
        began = time.perf_counter()
        trainer.run_epoch()
        return (time.perf_counter() - began) * 1e3 / trainer.updates_per_epoch / seeds

    return measure


def on_motornet(model: str, threads: int, task: str) -> Callable[[], float]:
    """A function that makes updates of the same network by torch on MotorNet's own arm, the combined loss."""
    config = resolve("bptt", "random_reach", model=model)
    network = build_network(config)
    muscle = motornet.muscle.RigidTendonHillMuscle()
    arm = motornet.effector.RigidTendonArm26(muscle, muscle_kwargs={"normalized_slack_muscle_length": 1.0})
    optimizer = torch.optim.Adam(network.parameters(), lr=1e-3)
    optimal = arm.muscle.l0_ce[0, 0]
    upper = torch.deg2rad(torch.tensor([135.0, 155.0]))
    center = torch.from_numpy(inverse_kinematics(np.array([[0.0, 0.4]]), config.trial.arm)).float()
    around = torch.arange(TRIALS) % 8 * torch.pi / 4
    field = CURL * torch.tensor([[0.0, 1.0], [-1.0, 0.0]])

    def reset(posture: Tensor) -> None:
        joint = torch.cat([posture, torch.zeros_like(posture)], dim=1)
        arm.reset(options={"batch_size": TRIALS, "joint_state": joint})

    def begin() -> Tensor:
        """Put the arms at their starts, and return the targets."""
        if task == FIELD:
            reset(center.expand(TRIALS, 2))
            return arm.states["cartesian"][:, :2] + 0.1 * torch.stack([around.cos(), around.sin()], dim=1)
        reset(torch.rand(TRIALS, 2) * upper)
        target = arm.states["cartesian"][:, :2].clone()
        reset(torch.rand(TRIALS, 2) * upper)
        return target

    def update() -> None:
        target = begin()
        loss = torch.zeros(())
        for _ in range(STEPS):
            muscle_state = arm.states["muscle"]
            seen = [muscle_state[:, 1] / optimal, muscle_state[:, 2] / (10 * optimal), arm.states["cartesian"][:, :2]]
            excitation = network.excitation(torch.cat([*seen, target], dim=1))
            load = {"endpoint_load": arm.states["cartesian"][:, 2:] @ field.T} if task == FIELD else {}
            arm.step(excitation, **load)
            error = arm.states["cartesian"][:, :2] - target
            loss = loss + 2.5 * error.abs().mean() + 25 * error.square().mean() + excitation.square().mean()
        optimizer.zero_grad()
        (loss / STEPS).backward()
        for parameter in network.parameters():
            torch.nn.utils.clip_grad_norm_([parameter], 1.0)
        optimizer.step()
        network.constrain()

    def measure(updates: int = 8) -> float:
        torch.set_num_threads(threads)
        began = time.perf_counter()
        for _ in range(updates):
            update()
        elapsed = (time.perf_counter() - began) * 1e3 / updates
        torch.set_num_threads(1)
        return elapsed

    return measure


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    measures = {name_of(*case): ours(*case) for case in CASES}
    baselines: dict[str, list[str]] = {PLAIN: [], FIELD: []}
    for task, names in baselines.items():
        for threads in sorted({1, os.cpu_count() or 1}):
            names.append(f"cc_ns, {task} on MotorNet's arm, 1 seed, {threads} torch thread(s)")
            measures[names[-1]] = on_motornet("cc_ns", threads, task)
    for measure in measures.values():
        measure()  # compiles, and fills the caches
    times: dict[str, list[float]] = {name: [] for name in measures}
    for _ in range(arguments.rounds):
        for name, measure in measures.items():
            times[name].append(measure())
    for name, values in times.items():
        print(f"{name}: {statistics.median(values):.2f} ms an update and seed ({min(values):.2f} to {max(values):.2f})")
    for task, names in baselines.items():
        fastest = min(names, key=lambda name: statistics.median(times[name]))
        ratios = [a / b for a, b in zip(times[fastest], times[name_of("cc_ns", 1, task, 10)], strict=True)]
        print(
            f"MotorNet's arm over ours, cc_ns, {task}, 1 seed: {statistics.median(ratios):.0f} times (its faster way)"
        )
    for units in (10, 20):
        two, one = (times[name_of("cc_s", 10, task, units)] for task in (PAIR, PLAIN))
        ratios = [a / b for a, b in zip(two, one, strict=True)]
        print(f"two arms with a spring over one, cc_s, {units} units, 10 seeds: {statistics.median(ratios):.2f} times")
