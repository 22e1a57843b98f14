"""Networks that were trained on normalized observations, turned into networks of what the arm senses."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecNormalize
from torch import Tensor, nn

from bilateral_rl.envs import ArmVecEnv
from bilateral_rl.envs.doors import arguments_for
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.tasks import TaskLike, make_task
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies import BilateralActorCriticPolicy, MotorPolicy
from bilateral_rl.policies.off_policy import BilateralOffPolicyPolicy, BilateralTD3Policy

_TRIALS = 256
"""Trials in which it is looked how often normalization would have clipped an observation."""
_CLIPPED = 0.01
"""Largest share of steps in which it may have."""


@dataclass(frozen=True)
class Statistics:
    """What SB3's ``VecNormalize`` makes of an observation x: (x - mean) / std, no further from 0 than ``clip``."""

    mean: NDArray[np.float64]
    """(n_observed,)."""
    std: NDArray[np.float64]
    """(n_observed,), above 0."""
    clip: float

    @classmethod
    def load(cls, path: Path, n_observed: int) -> Statistics:
        """Read what ``VecNormalize.save`` wrote, which executes whatever code it holds.

        Raises:
            UserError: it holds no statistics of so many numbers.
        """
        try:
            saved = pickle.loads(path.read_bytes())
        except OSError as error:
            raise UserError(f"Cannot read {path}: {error.strerror or error}.") from None
        except Exception as error:  # pickles raise anything
            raise UserError(f"{path} holds no VecNormalize: {error!r}.") from None
        if not isinstance(saved, VecNormalize):
            raise UserError(f"{path} holds a {type(saved).__name__}, not a VecNormalize, as its method save writes.")
        if not saved.norm_obs:
            raise UserError(f"{path} is of a VecNormalize that left observations as they are: leave it out.")
        moments = saved.obs_rms
        if not isinstance(moments, RunningMeanStd) or moments.mean.shape != (n_observed,):
            raise UserError(f"{path} has statistics of other observations than the arm's {n_observed} numbers.")
        mean, std = np.asarray(moments.mean), np.sqrt(np.asarray(moments.var) + saved.epsilon)
        if not (np.isfinite(mean).all() and np.isfinite(std).all() and (std > 0).all()):
            raise UserError(f"The statistics in {path} are not finite numbers.")
        return cls(mean, std, float(saved.clip_obs))

    @torch.no_grad()
    def fold_into(self, policy: MotorPolicy) -> None:
        """Let ``policy`` do with observations what it did with normalized ones, where these were not clipped."""
        mean, std = torch.from_numpy(self.mean), torch.from_numpy(self.std)
        n = len(mean)
        for layer, seen in _first_layers(policy):
            # W (x - m) / s + b = (W / s) x + (b - (W / s) m). Critics see more than observations, in further columns.
            of_seen, weight = len(mean[seen]), layer.weight.double()
            weight[:, :of_seen] /= std[seen]
            layer.bias.copy_(layer.bias.double() - weight[:, :of_seen] @ mean[seen])
            layer.weight.copy_(weight)
        for input_mean, input_std in _standardizations(policy):
            # ((x - m) / s - M) / S = (x - (m + s M)) / (s S)
            input_mean[:n] = mean + std * input_mean[:n].double()
            input_std[:n] = std * input_std[:n].double()

    def clipped_share(self, policy: MotorPolicy, task: TaskLike, settings: TrialSettings) -> float:
        """Return in which share of the steps of trials normalization would have clipped an observation.

        In those the folded ``policy`` does not act as the model did.

        Raises:
            UserError: it is more than one in a hundred.
        """
        task = make_task(task)
        arms = ArmVecEnv(_TRIALS, task, seed=0, **arguments_for(task, settings))
        observations, clipped = arms.reset(), []
        for _ in range(settings.trial_length):
            assert isinstance(observations, np.ndarray)
            clipped.append((np.abs(observations - self.mean) > self.clip * self.std).any(axis=1).mean())
            actions, _ = policy.predict(observations, deterministic=True)
            observations, *_ = arms.step(actions)
        share = float(np.mean(clipped))
        if share > _CLIPPED:
            raise UserError(
                f"The model was trained on normalized observations that were clipped at {self.clip:g}, as happens in "
                f"{share:.0%} of the steps of its trials: no network of what the arm senses acts as it did; train it "
                "with a larger clip_obs, or without VecNormalize."
            )
        return share


def shows_normalization(last_observations: object) -> bool:
    """Whether the last observations that a model saw cannot be an arm's, as a muscle's length is never below 0."""
    if not isinstance(last_observations, np.ndarray) or last_observations.ndim != 2:
        return False
    for n_arms in (1, 2):
        low, _ = TrialSettings().observation_bounds(n_arms)
        if last_observations.shape[1] == len(low):
            return bool((last_observations[:, low == 0] < 0).any())
    return False


def _first_layers(policy: MotorPolicy) -> Iterator[tuple[nn.Linear, slice]]:
    """Yield every layer that sees observations as they come, and which of their numbers it sees."""
    networks, critics = [policy.motor_network], list[nn.Module]()
    if isinstance(policy, BilateralTD3Policy):
        networks.append(policy.actor_target.network)
    if isinstance(policy, BilateralActorCriticPolicy):
        critics += policy.mlp_extractor.critics  # type: ignore[arg-type]
    if isinstance(policy, BilateralOffPolicyPolicy) and not policy.standardize_inputs:
        critics += [*policy.critic.q_networks, *policy.critic_target.q_networks]
    for critic in critics:
        yield next(layer for layer in critic.modules() if isinstance(layer, nn.Linear)), slice(None)
    for network in networks:
        each = network.n_inputs_per_arm
        views = {
            "hidden": slice(None),
            "dominant": slice(0, each),
            "non_dominant": slice(network.n_inputs - each, None),
        }
        for stack, seen in views.items():
            if hasattr(network, stack):
                yield getattr(network, stack)[0], seen


def _standardizations(policy: MotorPolicy) -> Iterator[tuple[Tensor, Tensor]]:
    """Yield the mean and the standard deviation by which critics standardize what they see, if they do."""
    if isinstance(policy, BilateralOffPolicyPolicy) and policy.standardize_inputs:
        for critics in (policy.critic, policy.critic_target):
            yield critics.input_mean, critics.input_std
