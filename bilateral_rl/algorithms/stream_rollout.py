"""SB3's rollout buffer with one reward, value, advantage and return per stream."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.buffers import RolloutBuffer
from torch import Tensor

from bilateral_rl.algorithms.action_traces import ActionTraces


class StreamBatch(NamedTuple):
    """A minibatch of ``b`` samples."""

    observations: Tensor
    """(b, *observation shape)."""
    traces: Tensor
    """(b, n): traces of the actions before the step; n is 0 without traces."""
    hidden_noise: Tensor
    """(b, layers · sides, width): noise of the network's hidden units in the step; (b, 0, 0) without noise."""
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
    rewards: NDArray[np.float32],
    values: NDArray[np.float32],
    last_values: NDArray[np.float32],
    dones: NDArray[np.bool_],
    gamma: float,
    gae_lambda: float,
) -> NDArray[np.float32]:
    """Return the generalized advantages (Schulman et al. 2016, arXiv 1506.02438) of each stream by itself.

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
    # Temporal difference  δ_t = r_t + γ (1 - done_t) V_{t+1} - V_t
    # and advantage        A_t = δ_t + γ λ (1 - done_t) A_{t+1},  from the last step to the first.
    advantages = np.empty_like(rewards)
    running = np.zeros_like(last_values)  # A_{t+1}, (n_envs, n_streams)
    next_values = last_values  # V_{t+1}
    for t in reversed(range(len(rewards))):
        goes_on = (1.0 - dones[t].astype(np.float32))[:, None]  # (n_envs, 1): an episode ends for both streams
        delta = rewards[t] + gamma * goes_on * next_values - values[t]
        running = delta + gamma * gae_lambda * goes_on * running
        advantages[t] = running
        next_values = values[t]
    return advantages


class StreamRolloutBuffer(RolloutBuffer):
    """SB3's rollout buffer for rewards of several streams and actions stored before their squashing.

    Four things differ from SB3's flow. Observations are stored before they are acted on. Values are not added step by
    step but given at the end, since one batch of all observations costs a fraction of ``buffer_size`` small ones. The
    ends of episodes are stored instead of the starts. Minibatches come in the order of torch's random numbers, drawn
    on the device.

    Args:
        buffer_size: steps of each environment in a rollout.
        observation_space: a Box.
        action_space: a Box.
        device: where minibatches are.
        gae_lambda: trade-off of bias and variance of the advantages.
        gamma: discount.
        n_envs: number of environments.
        n_streams: number of reward streams.
        action_traces: decays of the traces of past actions.

    Attributes:
        observations: (buffer_size, n_envs, *observation shape) float32.
        traces: (buffer_size, n_envs, n) float32: of the actions before each step.
        hidden_noise: (buffer_size, n_envs, layers · sides, width) float32, after :meth:`keep_noise`.
        latent_actions: (buffer_size, n_envs, n_actions) float32.
        log_probs: (buffer_size, n_envs) float32.
        rewards: (buffer_size, n_envs, n_streams) float32.
        dones: (buffer_size, n_envs) bool.
        values, advantages, returns: (buffer_size, n_envs, n_streams) float32, once they have been computed.
    """

    latent_actions: NDArray[np.float32]
    dones: NDArray[np.bool_]

    def __init__(
        self,
        buffer_size: int,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        device: torch.device | str = "auto",
        gae_lambda: float = 1.0,
        gamma: float = 0.99,
        n_envs: int = 1,
        n_streams: int = 1,
        action_traces: Sequence[float] = (),
    ) -> None:
        super().__init__(buffer_size, observation_space, action_space, device, gae_lambda, gamma, n_envs)
        shape = (buffer_size, n_envs)
        self.observations = np.zeros((*shape, *self.obs_shape), dtype=np.float32)  # type: ignore[misc]
        self.traces = np.zeros((*shape, ActionTraces(action_traces, self.action_dim).size), dtype=np.float32)
        self.hidden_noise = np.zeros((*shape, 0, 0), dtype=np.float32)
        self.latent_actions = np.zeros((*shape, self.action_dim), dtype=np.float32)
        self.log_probs = np.zeros(shape, dtype=np.float32)
        self.rewards = np.zeros((*shape, n_streams), dtype=np.float32)
        self.dones = np.zeros(shape, dtype=np.bool_)

    def reset(self) -> None:
        """Start anew at the first step; SB3's buffer allocates all arrays again, this one overwrites them."""
        self.pos, self.full = 0, False

    def keep_noise(self, hidden_shape: tuple[int, int]) -> None:
        """Make room for the noise of a network with hidden units of ``hidden_shape``, (layers · sides, width)."""
        self.hidden_noise = np.zeros((self.buffer_size, self.n_envs, *hidden_shape), dtype=np.float32)

    def begin_step(
        self, obs: NDArray[np.floating[Any]], traces: NDArray[np.float32], noise: Tensor | None = None
    ) -> NDArray[np.float32]:
        """Store the observations that the next step acts on, and return the stored row.

        Args:
            obs: (n_envs, *observation shape).
            traces: (n_envs, n), of the actions before.
            noise: (n_envs, layers · sides, width), of the network's hidden units in the step; None if they have none.
        """
        self.observations[self.pos] = obs
        self.traces[self.pos] = traces
        if noise is not None:
            self.hidden_noise[self.pos] = noise.numpy()
        row: NDArray[np.float32] = self.observations[self.pos]
        return row

    def add(  # type: ignore[override] # other columns, as the class says
        self,
        latent_actions: NDArray[np.float32],
        rewards: NDArray[np.float32] | None,
        dones: NDArray[np.bool_],
        log_probs: NDArray[np.float32],
    ) -> None:
        """Store what came of the step that :meth:`begin_step` began.

        Args:
            latent_actions: (n_envs, n_actions), the actions before the squashing.
            rewards: (n_envs, n_streams); None where those of the whole rollout are put into :attr:`rewards`.
            dones: (n_envs,), whether the step ended an episode.
            log_probs: (n_envs,), Gaussian log probability of ``latent_actions``.
        """
        step = self.pos
        self.latent_actions[step] = latent_actions
        if rewards is not None:
            self.rewards[step] = rewards
        self.dones[step] = dones
        self.log_probs[step] = log_probs
        self.pos += 1
        self.full = self.pos == self.buffer_size

    def compute_returns_and_advantage(  # type: ignore[override] # values come at the end, as the class says
        self, values: NDArray[np.float32], last_values: NDArray[np.float32]
    ) -> None:
        """Compute the advantages and returns of a full buffer.

        Args:
            values: (buffer_size, n_envs, n_streams), of the stored observations.
            last_values: (n_envs, n_streams), of the observations after the last step.
        """
        self.values = values
        self.advantages = generalized_advantages(
            self.rewards, values, last_values, self.dones, self.gamma, self.gae_lambda
        )
        self.returns = self.advantages + values

    def get(self, batch_size: int | None = None) -> Generator[StreamBatch, None, None]:  # type: ignore[override]
        """Yield all samples once in random order, in minibatches of ``batch_size``, by default in one."""
        n = self.buffer_size * self.n_envs
        columns = [
            torch.from_numpy(array.reshape(n, *array.shape[2:])).to(self.device)
            for array in (
                self.observations, self.traces, self.hidden_noise, self.latent_actions, self.log_probs, self.values,
                self.advantages, self.returns,
            )
        ]  # fmt: skip
        for rows in torch.randperm(n, device=self.device).split(batch_size or n):
            yield StreamBatch(*(column[rows] for column in columns))
