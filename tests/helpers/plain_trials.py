"""What records of trials without cues and forces have in common."""

import dataclasses

import numpy as np

from bilateral_rl.analysis.trial_plans import TrialPlan
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.envs.arm import ArmParameters
from bilateral_rl.envs.tasks import NEVER
from bilateral_rl.vocabulary import SIDES


def plain_plan(start, goal) -> TrialPlan:
    """Return the plan of trials whose targets (n, 2) are there from the start (n, 2)."""
    n, along = len(goal), np.asarray(goal, dtype=np.float32) - start
    return TrialPlan(
        trial=np.arange(n, dtype=np.int32),
        hand=np.full(n, SIDES[0]),
        start=np.asarray(start, dtype=np.float32),
        goal=np.asarray(goal, dtype=np.float32),
        go=np.zeros(n, dtype=np.int32),
        jump=np.full(n, NEVER, dtype=np.int32),
        pulse=np.full((n, 2), NEVER, dtype=np.int32),
        pulse_force=np.zeros((n, 2), dtype=np.float32),
        condition=np.full(n, "null"),
        target_index=np.full(n, -1, dtype=np.int32),
        target_angle=np.where(along.any(axis=1), np.arctan2(along[:, 1], along[:, 0]), np.nan).astype(np.float32),
        is_of_experiment=False,
    )


def without_forces(hand, target, load) -> dict[str, np.ndarray]:
    """Return what a record says of targets, forces and plan, of hands (n, T + 1, 2), targets and loads (n, 2)."""
    n, steps = len(hand), np.shape(hand)[1] - 1
    return {
        "seen_target": np.repeat(np.asarray(target)[:, None], steps, axis=1),
        "force": np.repeat(np.asarray(load)[:, None], steps, axis=1),
        "field_force": np.zeros((n, steps, 2), dtype=np.float32),
        "plan": plain_plan(np.asarray(hand)[:, 0], target),
    }


def a_record(path, target, **plan) -> TrialRecord:
    """A record of paths (n, T + 1, 2) (m) of hands that had targets (n, 2), with what is given of their plan."""
    hand, target = np.asarray(path, dtype=np.float32), np.asarray(target, dtype=np.float32)
    n, steps = len(hand), hand.shape[1] - 1
    rest = without_forces(hand, target, np.zeros((n, 2), dtype=np.float32))
    plan = {name: np.asarray(values) for name, values in plan.items()}
    zeros = {name: np.zeros((n, steps, 6), dtype=np.float32) for name in ("excitation", "activation")}
    distance = np.linalg.norm(hand - target[:, None], axis=2)
    record = TrialRecord(
        **rest, **zeros, joint=np.zeros_like(hand), hand=hand, target=target,
        load=np.zeros((n, 2), dtype=np.float32), distance=distance[:, 1:], start_distance=distance[:, 0],
        observation=np.zeros((n, steps, 16), dtype=np.float32), vector_return=np.zeros((n, 2), dtype=np.float32),
        arm=ArmParameters(),
    )  # fmt: skip
    return dataclasses.replace(record, plan=dataclasses.replace(record.plan, **plan))


def two_hands() -> TrialRecord:
    """Two trials of 10 steps: the dominant hand reaches along x in the first, and keeps its place in the second.

    Reaches go 1 cm a step and are 1 cm off at their middle, holds are 1.5 cm off from the sixth step on.
    """
    path = np.zeros((11, 2))
    path[:, 0] = np.arange(11) / 100
    path[5, 1] = 0.01
    still = np.zeros((11, 2))
    still[6:, 1] = 0.015
    hand = np.stack([path, still, still, path])
    target = np.array([[0.0995, 0], [0, 0], [0, 0], [0.0995, 0]])
    record = a_record(hand, target, trial=[0, 0, 1, 1], hand=[*SIDES] * 2)
    return dataclasses.replace(record, shoulder_distance=0.36)
