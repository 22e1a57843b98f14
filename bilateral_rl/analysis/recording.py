"""Recordings: trials of trained networks with everything that moved in them, as arrays, tables and files."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray
from torch import Tensor

from bilateral_rl.analysis import recording_files
from bilateral_rl.analysis.conditions import Conditions
from bilateral_rl.analysis.modulation import contributions
from bilateral_rl.analysis.recording_arms import by_arm
from bilateral_rl.analysis.recording_fields import (
    CONTRIBUTION,
    FIELD_FORCE,
    HAND_VELOCITY,
    HIDDEN,
    LABEL_NAMES,
    OBSERVATION,
    STEP,
    TIME,
    Field,
    fields_of,
)
from bilateral_rl.analysis.trial_plans import TrialPlan
from bilateral_rl.analysis.trials import Evaluator, NotFiniteError
from bilateral_rl.envs.kinematics import hand_velocity
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.tasks import NEVER
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


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """``n`` trials, of one network or of several, one after another.

    ``recording["hand"]`` is an array (n, T + 1, 2): its dimensions are a trial, then those of its field. States are
    recorded at the start and after each of the T steps. What belongs to a step (observation, hidden activity,
    excitation, reward) stands at the step's number, from 0: step k begins at moment k and ends at moment k + 1.
    """

    fields: tuple[Field, ...]
    """What is recorded, with unit, dimensions and description."""
    arrays: Mapping[str, NDArray[Any]]
    """The values by the name of their field, in float32; which network, lesion and trial each row is of, as labels."""
    timestep: float
    """Length of a step (s)."""
    metadata: Mapping[str, Any]
    """Where the trials come from: run, task, settings, versions and more, ready for JSON."""

    def __repr__(self) -> str:
        names = ", ".join(field.name for field in self.quantities)
        return f"<Recording of {len(self):,} trials of {len(self.time) - 1} steps: {names}>"

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.arrays[name]

    def __len__(self) -> int:
        """Number of trials, over all networks and lesions."""
        return len(self.arrays["trial"])

    @property
    def time(self) -> NDArray[np.float64]:
        """(T + 1,): the moments at which states are recorded (s)."""
        return np.arange(self.arrays["hand"].shape[1], dtype=np.float64) * self.timestep

    @property
    def labels(self) -> tuple[Field, ...]:
        """The fields that say which trial of which network this is."""
        return tuple(field for field in self.fields if field.name in LABEL_NAMES)

    @property
    def quantities(self) -> tuple[Field, ...]:
        """The fields that are numbers of the trials, without the labels."""
        return tuple(field for field in self.fields if field.name not in LABEL_NAMES)

    def frame(self) -> pd.DataFrame:
        """Return a table with a row for each trial and moment, T + 1 a trial.

        The row of moment k has the states at it and what belongs to the step that begins then, which in the last row of
        a trial is NaN. Columns carry their unit, such as ``hand_x_m``.
        """
        moments, n = len(self.time), len(self)
        labels = {name: np.repeat(values, moments) for name, values in self.label_columns().items()}
        clock = {"step": np.tile(np.arange(moments), n), "time_s": np.tile(self.time, n)}
        numbers = pd.DataFrame(self.rows().reshape(n * moments, -1), columns=self.columns())
        return pd.concat([pd.DataFrame(labels | clock), numbers], axis=1)

    def label_columns(self) -> dict[str, NDArray[Any]]:
        """Return the labels of each trial, (n,) each, by the names of their columns."""
        columns: dict[str, NDArray[Any]] = {}
        for field in self.labels:
            values = self.arrays[field.name]
            columns |= dict(zip(field.columns(values.shape), values.reshape(len(self), -1).T, strict=True))
        return columns

    def columns(self) -> list[str]:
        """Return the names of the columns of :meth:`rows`."""
        return [name for field in self.quantities for name in field.columns(self.arrays[field.name].shape)]

    def rows(self) -> Float32:
        """Return all quantities side by side, (n, T + 1, columns); NaN in the last moment of what belongs to steps."""
        moments = len(self.time)
        blocks = []
        for field in self.quantities:
            values = self.arrays[field.name]
            if STEP in field.dims:
                values = values.reshape(len(self), moments - 1, -1)
                values = np.concatenate([values, np.full_like(values[:, :1], np.nan)], axis=1)
            elif TIME not in field.dims:
                values = np.repeat(values[:, None], moments, axis=1)
            blocks.append(values.reshape(len(self), moments, -1))
        return np.concatenate(blocks, axis=2)

    def save(self, path: str | Path) -> None:
        """Write a file, whole or not at all: CSV, NPZ, Parquet or NetCDF, as its name ends (.csv, .npz, .parquet, .nc).

        Raises:
            UserError: another ending, a file that cannot be written, or a library that is missing.
        """
        recording_files.write(Path(path), [self], len(self))

    @classmethod
    def join(cls, parts: Iterable[Recording]) -> Recording:
        """Return recordings of the same kind as one, one after another; the metadata are those of the first."""
        parts = list(parts)
        first = parts[0]
        arrays = {name: np.concatenate([part.arrays[name] for part in parts]) for name in first.arrays}
        return cls(first.fields, arrays, first.timestep, first.metadata)


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
