"""Trials of a trained policy, the same again and again."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.type_aliases import PolicyPredictor
from torch import Tensor

from bilateral_rl.analysis.both_ways import DrawnTrials, draw, fields_of_hands, hand_rows, target_indices, trial_seeds
from bilateral_rl.analysis.recording_fields import (
    FIELD_FORCE,
    HAND_FORCE,
    MEASURED,
    SEEN_TARGET,
    SPRING_FORCE,
    STEP,
    TARGET,
    TIME,
    Field,
)
from bilateral_rl.analysis.trial_plans import TrialPlan, plan_of
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.envs.doors import numbers
from bilateral_rl.envs.kinematics import hand_velocity
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.tasks import TaskLike, make_task
from bilateral_rl.envs.trials import TrialBatch
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.threads import one_torch_thread
from bilateral_rl.policies import MotorNetwork, MotorPolicy

Float32 = NDArray[np.float32]


class NotFiniteError(UserError, ValueError):
    """The numbers of a network or an arm grew out of range, so that nothing can be measured."""


class Evaluator:
    """The same trials, again and again: trial i is the first trial of seed ``seed + i``.

    Of two arms that holds for even i, and the next trial is the same with the arms exchanged, noise included, so that
    no hand has the easier trials: each hand does every part in them. A task whose hands do not have the same chances,
    as where a setting says which one reaches, has no such trials.

    Args:
        task: id of the task, or the task.
        settings: how trials run.
        trials: number of trials; an even one where arms are exchanged.
        seed: seed of the first trial.
        device: where the arms are simulated, "cpu" or a CUDA device.

    Raises:
        ValueError: an unknown task or device, a number below its least one, or an odd number of trials.
        TypeError: settings or numbers of another kind.
    """

    def __init__(
        self, task: TaskLike, settings: TrialSettings, trials: int, seed: int, device: str | torch.device = "cpu"
    ) -> None:
        self._batch = TrialBatch(make_task(task), settings, trials, device)
        self._seeds, self._exchanged = trial_seeds(self._batch.task, self._batch.settings, self._batch.n, seed)

    def run(self, policy: PolicyPredictor, deterministic: bool = True) -> TrialRecord:
        """Do every trial once.

        Args:
            policy: acts in all trials at once.
            deterministic: whether it acts without exploration.

        Raises:
            NotFiniteError: the policy's actions, or the arms' states, are not finite.
        """
        fields = [f for f in MEASURED if f.name != "joint_velocity" or self.has_forces]
        if self._batch.n_arms > 1:
            fields.append(SPRING_FORCE)
        arrays = self.record(policy, fields, deterministic)
        joint, activation = arrays.pop("joint_angle"), arrays.pop("activation")
        arrays.pop("joint_velocity", None)
        settings, n_arms = self._batch.settings, self._batch.n_arms
        arrays["observation"] = views(arrays["observation"], n_arms)
        return TrialRecord(
            **arrays,
            joint=joint,
            activation=activation[:, 1:],
            distance=self._batch.distance.copy(),
            start_distance=self._batch.start_distance.copy(),
            vector_return=np.repeat(self._batch.vector_return, n_arms, axis=0),
            plan=self.plan,
            arm=settings.arm,
            shoulder_distance=settings.two_arms.shoulder_distance if n_arms > 1 else None,
        )

    def record(
        self, policy: PolicyPredictor, fields: Sequence[Field], deterministic: bool = True
    ) -> dict[str, Float32]:
        """Do every trial once, and return by name what ``fields`` take from the arms, (n, …) each.

        Of two arms there is a row a hand, in the frame of its own arm, of what is a hand's: (2n, …). Observation,
        reward and the like have a row a trial.

        Args:
            policy: acts in all trials at once.
            fields: what is recorded, the observation among it; with the target also the seen ones, and with the force
                of a field also hand, joint angles and their velocities.
            deterministic: whether it acts without exploration.

        Raises:
            NotFiniteError: the policy's actions, or the arms' states, are not finite.
        """
        # Anything that predicts may be tested, also a policy of stable-baselines3, which has no network of ours.
        noise: contextlib.AbstractContextManager[None] = contextlib.nullcontext()
        if isinstance(policy, MotorPolicy):
            noise = policy.motor_network.noise.of_trials(self._seeds, self._exchanged.tolist())
        with one_torch_thread(), np.errstate(over="ignore", invalid="ignore"), noise:
            arrays = self._record(policy, fields, deterministic)
        # A hand that was ever out of range has a return that is.
        if not np.isfinite(self._batch.hand).all() or not np.isfinite(self._batch.vector_return).all():
            raise NotFiniteError("These trials cannot be measured: the arm that trial.arm describes leaves all bounds.")
        if TARGET in fields:
            arrays[TARGET.name] = arrays[SEEN_TARGET.name][:, -1].copy()
        if FIELD_FORCE in fields:
            arrays[FIELD_FORCE.name] = self._field_force(arrays)
        return arrays

    def hidden_noise(self, network: MotorNetwork) -> Tensor | None:
        """Return the noise of the network's hidden units in every step of its trials, (n, T, layers · sides, width).

        None for a network without noise.
        """
        steps = range(self._batch.settings.trial_length)
        with network.noise.of_trials(self._seeds, self._exchanged.tolist()):
            noise = [one for one in (network.noise.draw(self._batch.n) for _ in steps) if one is not None]
        return torch.stack(noise, dim=1) if noise else None

    @property
    def has_forces(self) -> bool:
        """Whether the trials have forces beside the load."""
        return self._batch.task.has_forces

    @functools.cached_property
    def plan(self) -> TrialPlan:
        """What sets the trials apart, of two arms with a row a hand."""
        drawn, batch = self._drawn, self._batch
        return plan_of(hand_rows(drawn, batch), target_indices(drawn, batch), batch.settings, batch.n_arms)

    @functools.cached_property
    def _drawn(self) -> DrawnTrials:
        """What the trials are made of, drawn once: seeding takes as long as moving the arms."""
        return draw(self._batch, self._seeds, self._exchanged)

    def _field_force(self, arrays: dict[str, Float32]) -> Float32:
        """The force B v + K (x₀ − x) of the field before each step, a row a hand, (n, T, 2) (N)."""
        batch, hand = self._batch, arrays["hand"][:, :-1]
        field = fields_of_hands(self._drawn, batch)
        if field is None:
            return np.zeros_like(hand)
        velocity = hand_velocity(arrays["joint_angle"], arrays["joint_velocity"], batch.settings.arm)[:, :-1]
        acts = ((field.velocity_gain, velocity), (field.position_gain, field.center[:, None] - hand))
        force = sum(np.einsum("nij,ntj->nti", gain, of) for gain, of in acts)
        return np.asarray(force, dtype=np.float32)

    def _record(self, policy: PolicyPredictor, fields: Sequence[Field], deterministic: bool) -> dict[str, Float32]:
        batch = self._batch
        length = batch.settings.trial_length
        batch.start(np.arange(batch.n, dtype=np.int32), self._drawn.trials, self._drawn.noise)
        taken = [(field, field.take, _room(field, batch)) for field in fields if field.take is not None]
        arrays = {field.name: array for field, _, array in taken}
        states = [(take, array) for field, take, array in taken if TIME in field.dims]
        changing = [one for one in taken if STEP in one[0].dims and not _stays(one[0], batch)]
        steps = [(take, array) for field, take, array in changing if not field.before]
        seen = [(take, array) for field, take, array in changing if field.before]
        for take, array in states:
            array[:, 0] = take(batch)
        for step in range(length):
            for take, array in seen:
                array[:, step] = take(batch)
            batch.step(_action(policy, batch.observation, deterministic))
            for take, array in steps:
                array[:, step] = take(batch)
            for take, array in states:
                array[:, step + 1] = take(batch)
        return arrays


def views(observation: Float32, n_arms: int) -> Float32:
    """Return what each arm's side of the observation shows, (n · arms, T, width), of observations (n, T, arms · width).

    An arm's view is in its own frame.
    """
    n, steps, width = observation.shape
    by_arm = observation.reshape(n, steps, n_arms, width // n_arms).swapaxes(1, 2)
    return by_arm.reshape(n * n_arms, steps, -1)


def _stays(field: Field, batch: TrialBatch) -> bool:
    """Whether what is taken in every step is the same throughout the trials of this task."""
    only_load = batch.n_arms == 1 and not batch.task.has_forces
    return (field == SEEN_TARGET and not batch.task.has_timeline) or (field == HAND_FORCE and only_load)


def _room(field: Field, batch: TrialBatch) -> Float32:
    """Return an array for ``field``; where it neither has a time nor a step, or stays as it is, already filled."""
    assert field.take is not None
    values, length = field.take(batch), batch.settings.trial_length
    if _stays(field, batch):
        return np.repeat(values[:, None], length, axis=1)
    if TIME not in field.dims and STEP not in field.dims:
        return values.copy()
    return np.empty((len(values), length + (TIME in field.dims), *values.shape[1:]), dtype=values.dtype)


def _action(policy: PolicyPredictor, observation: Float32, deterministic: bool) -> Float32:
    try:
        action, _ = policy.predict(observation, deterministic=deterministic)
    except ValueError as error:
        if "Normal" not in str(error):
            raise
        action = np.array(np.nan)  # torch's Gaussians refuse means that are not finite
    if not np.isfinite(numbers("actions", action)).all():
        raise NotFiniteError("This policy cannot be tested: its actions are not finite numbers.")
    return action
