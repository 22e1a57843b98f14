"""Rollouts with one reward, value, advantage and return per stream."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from torch import Tensor

Float = NDArray[np.float32]


class StreamBatch(NamedTuple):
    """A minibatch of ``b`` samples."""

    observations: Tensor
    """(b, n_observed)."""
    latent_actions: Tensor
    """(b, n_actions): the actions before the squashing."""
    old_log_prob: Tensor
    """(b,): their Gaussian log probability when they were taken."""
    old_values: Tensor
    """(b, n_streams)."""
    advantages: Tensor
    """(b, n_streams)."""
    returns: Tensor
    """(b, n_streams)."""


def generalized_advantages(
    rewards: Float, values: Float, last_values: Float, dones: NDArray[np.bool_], gamma: float, gae_lambda: float
) -> Float:
    """Generalized advantage estimation (Schulman et al. 2016, arXiv 1506.02438), each stream by itself.

    Args:
        rewards: (T, n_envs, n_streams); where a time limit ended an episode, the discounted value of its last
            observation has been added.
        values: (T, n_envs, n_streams), of the observations acted on.
        last_values: (n_envs, n_streams), of the observation after the last step.
        dones: (T, n_envs), whether each step ended an episode.
        gamma: discount.
        gae_lambda: trade-off of bias and variance.

    Returns:
        (T, n_envs, n_streams).
    """
    advantages = np.empty_like(rewards)
    running = np.zeros_like(last_values)
    next_values = last_values
    for t in reversed(range(len(rewards))):
        goes_on = (1.0 - dones[t].astype(np.float32))[:, None]
        delta = rewards[t] + gamma * goes_on * next_values - values[t]
        running = delta + gamma * gae_lambda * goes_on * running
        advantages[t] = running
        next_values = values[t]
    return advantages


class StreamRollout:
    """Storage for ``n_steps`` of ``n_envs`` environments.

    Attributes:
        observations: (n_steps, n_envs, n_observed) float32.
        latent_actions: (n_steps, n_envs, n_actions) float32.
        log_prob: (n_steps, n_envs) float32.
        rewards, values, advantages, returns: (n_steps, n_envs, n_streams) float32.
        dones: (n_steps, n_envs) bool.
    """

    def __init__(
        self,
        n_steps: int,
        n_envs: int,
        observation_space: spaces.Space[object],
        action_space: spaces.Space[object],
        n_streams: int,
    ) -> None:
        n_observed, n_actions = spaces.flatdim(observation_space), spaces.flatdim(action_space)
        shape = (n_steps, n_envs)
        self.observations = np.zeros((*shape, n_observed), dtype=np.float32)
        self.latent_actions = np.zeros((*shape, n_actions), dtype=np.float32)
        self.log_prob = np.zeros(shape, dtype=np.float32)
        self.dones = np.zeros(shape, dtype=np.bool_)
        self.rewards = np.zeros((*shape, n_streams), dtype=np.float32)
        self.values = np.zeros_like(self.rewards)
        self.advantages = np.zeros_like(self.rewards)
        self.returns = np.zeros_like(self.rewards)

    def finish(self, last_values: Float, gamma: float, gae_lambda: float) -> None:
        """Fill ``advantages`` and ``returns`` from rewards, values and dones."""
        self.advantages = generalized_advantages(self.rewards, self.values, last_values, self.dones, gamma, gae_lambda)
        self.returns = self.advantages + self.values

    def minibatches(self, batch_size: int, device: torch.device) -> Iterator[StreamBatch]:
        """One pass over all samples in random order."""
        n = self.log_prob.size
        columns = [
            torch.from_numpy(array.reshape(n, *array.shape[2:])).to(device)
            for array in (
                self.observations, self.latent_actions, self.log_prob, self.values, self.advantages, self.returns,
            )
        ]  # fmt: skip
        for rows in torch.randperm(n, device=device).split(batch_size):
            yield StreamBatch(*(column[rows] for column in columns))
