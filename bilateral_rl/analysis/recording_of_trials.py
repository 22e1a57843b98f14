"""Recordings of networks as they do trials: part by part, so that memory is bounded."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from bilateral_rl.analysis.conditions import Conditions
from bilateral_rl.analysis.modulation import contributions
from bilateral_rl.analysis.recording import Recording
from bilateral_rl.analysis.recording_arms import by_arm
from bilateral_rl.analysis.recording_fields import (
    CONTRIBUTION,
    FIELD_FORCE,
    HAND_VELOCITY,
    HIDDEN,
    OBSERVATION,
    fields_of,
)
from bilateral_rl.analysis.trial_plans import TrialPlan
from bilateral_rl.analysis.trials import Evaluator, NotFiniteError
from bilateral_rl.envs.kinematics import hand_velocity
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.task import NEVER
from bilateral_rl.envs.trial_arrays import N_SENSED
from bilateral_rl.io.threads import one_torch_thread
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.policies.lesions import Lesion
from bilateral_rl.policies.motor_network import MotorNetwork
from bilateral_rl.policies.networks import BilateralNetwork

Float32 = NDArray[np.float32]

TRIALS_AT_ONCE = 1024
"""Trials that are done, and kept in memory, at a time."""
NUMBERS_AT_ONCE = 2**24
"""Numbers that are kept in memory at a time, which are fewer trials where these are long or networks large."""


def record(
    policies: Mapping[int, MotorPolicy],
    lesions: Mapping[str, Lesion],
    conditions: Conditions,
    trials: int,
    seed: int,
    metadata: Mapping[str, Any],
) -> Iterator[Recording]:
    """Yield recordings of the same trials by every network with every lesion, part by part, so that memory is bounded.

    Args:
        policies: by the seed of their network.
        lesions: by name.
        conditions: task and settings.
        trials: number of trials of each network with each lesion.
        seed: seed of the first trial; trial i is the first one of ``seed + i``.
        metadata: what a file says of where it comes from.

    Raises:
        NotFiniteError: a policy's actions, or the arms' states, are not finite.
    """
    names = np.array(list(lesions))
    network = next(iter(policies.values())).motor_network
    n_arms = network.n_arms
    parts = list(_parts(trials, trials_at_once(network, conditions.settings), n_arms))
    evaluator = None
    for i, (number, policy) in itertools.product(range(len(names)), policies.items()):
        for first, n in parts:
            if evaluator is None or len(parts) > 1:
                evaluator = Evaluator(conditions.config.make_task(), conditions.settings, n, seed + first)
            with policy.motor_network.lesioned(lesions[names[i]]):
                arrays = _arrays(evaluator, policy, conditions.settings)
            labels = {"seed": np.full(n, number), "lesion": np.repeat(names[[i]], n), "trial": first + np.arange(n)}
            arrays = labels | arrays
            fields = tuple(f for f in fields_of(policy.motor_network) if f.name in arrays)
            if n_arms > 1:
                fields = tuple(field.of_two_arms for field in fields)
            yield Recording(fields, arrays, conditions.settings.arm.timestep, metadata)


def trials_at_once(network: MotorNetwork, settings: TrialSettings) -> int:
    """Return how many trials are done at a time."""
    numbers = (
        settings.trial_length * (100 * network.n_arms + network.layers * network.units)
        + max(settings.delays) * N_SENSED
    )
    return max(1, min(TRIALS_AT_ONCE, NUMBERS_AT_ONCE // numbers))


def _parts(trials: int, at_once: int, n_arms: int) -> Iterator[tuple[int, int]]:
    """Yield the first trial of each part, and how many there are in it: of two arms pairs that exchange the arms."""
    at_once += -at_once % n_arms
    for first in range(0, trials, at_once):
        yield first, min(at_once, trials - first)


def _arrays(evaluator: Evaluator, policy: MotorPolicy, settings: TrialSettings) -> dict[str, NDArray[Any]]:
    """Do the trials, and return every quantity by name, in the order of tables."""
    network = policy.motor_network
    fields = fields_of(network)
    arrays: dict[str, NDArray[Any]] = dict(
        evaluator.record(policy, [f for f in fields if f != FIELD_FORCE or evaluator.has_forces])
    )
    for name, values in arrays.items():
        if not np.isfinite(values).all():  # at its limits a joint stays where it is, however its velocity explodes
            raise NotFiniteError(f"These trials cannot be recorded: {name} leaves all bounds in the arm of trial.arm.")
    arrays[HAND_VELOCITY.name] = hand_velocity(arrays["joint_angle"], arrays["joint_velocity"], settings.arm)
    arrays |= _of_plan(evaluator.plan, network.n_arms)
    observation = arrays.pop(OBSERVATION.name)
    if network.n_arms > 1:
        distance = settings.two_arms.shoulder_distance
        each = [field for field in fields if field.of == "arm" and field.name in arrays]
        arrays |= {field.name: by_arm(arrays[field.name], field, distance) for field in each}
    arrays |= _of_network(network, observation, evaluator.hidden_noise(network))
    each_view = (network.n_arms, -1) if network.n_arms > 1 else (-1,)
    arrays[OBSERVATION.name] = observation.reshape(*observation.shape[:2], *each_view)
    return {field.name: arrays[field.name] for field in fields if field.name in arrays}


def _of_network(network: MotorNetwork, observation: Float32, noise: Tensor | None) -> dict[str, Float32]:
    """Return the hidden activity and the sides' contributions, as far as the network tells them."""
    arrays = {}
    if network.hidden_layers(torch.from_numpy(observation[:1, :1])):
        arrays[HIDDEN.name] = hidden_activity(network, observation, noise)
    if isinstance(network, BilateralNetwork):
        added = np.stack(contributions(network, observation, noise), axis=2)
        each = (network.n_arms, -1) if network.n_arms > 1 else (-1,)
        arrays[CONTRIBUTION.name] = added.reshape(*added.shape[:3], *each)
    return arrays


def _of_plan(plan: TrialPlan, n_arms: int) -> dict[str, NDArray[Any]]:
    """Return what sets trials apart, (n,) each: of experiments with NaN for cues and jumps that never come."""
    arrays: dict[str, NDArray[Any]] = {} if n_arms == 1 else {"role": plan.role}
    if not plan.is_of_experiment:
        return arrays
    steps = {"go": plan.go, "jump": plan.jump}
    arrays |= {name: np.where(step < NEVER, step, np.nan).astype(np.float32) for name, step in steps.items()}
    labels = {"condition": plan.written_condition, "target_index": plan.target_index}
    return arrays | labels | {"target_angle": plan.target_angle}


def hidden_activity(network: MotorNetwork, observation: Float32, noise: Tensor | None = None) -> Float32:
    """Return the hidden activity on observations (n, T, 16), with the present lesion.

    With noise (n, T, layers · sides, width), that is in it. It is (n, T, L, 2, U/2), or (n, T, L, U) of a network
    without sides.
    """
    with one_torch_thread(), torch.no_grad():
        layers = network.hidden_layers(torch.from_numpy(observation), noise)
        stacked = torch.stack([torch.stack(sides, dim=-2) for sides in layers], dim=2)
    activity: Float32 = stacked.numpy()
    return activity if isinstance(network, BilateralNetwork) else activity[:, :, :, 0]
