"""SB3's replay buffer with one reward per stream."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from stable_baselines3.common.vec_env import VecNormalize


class StreamReplayBuffer(ReplayBuffer):
    """SB3's replay buffer, but rewards are (buffer_size, n_envs, n_streams) and are not normalized.

    Args:
        *args: arguments of SB3's ``ReplayBuffer``.
        n_streams: number of reward streams.
        **kwargs: further arguments of SB3's ``ReplayBuffer``.

    Attributes:
        next_rewards: (n_envs, n_streams), the rewards that the next ``add`` stores; it ignores the scalar reward.

    Raises:
        ValueError: ``optimize_memory_usage``.
    """

    next_rewards: NDArray[np.float32]

    def __init__(self, *args: Any, n_streams: int = 1, **kwargs: Any) -> None:
        if kwargs.get("optimize_memory_usage"):
            raise ValueError("a StreamReplayBuffer keeps next observations: leave optimize_memory_usage out.")
        super().__init__(*args, **kwargs)
        self.rewards = np.zeros((self.buffer_size, self.n_envs, n_streams), dtype=np.float32)

    def add(
        self,
        obs: NDArray[Any],
        next_obs: NDArray[Any],
        action: NDArray[Any],
        reward: NDArray[Any],
        done: NDArray[Any],
        infos: list[dict[str, Any]],
    ) -> None:
        """Store one step of every environment with :attr:`next_rewards`."""
        super().add(obs, next_obs, action, self.next_rewards, done, infos)

    def _get_samples(self, batch_inds: NDArray[np.intp], env: VecNormalize | None = None) -> ReplayBufferSamples:
        # The columns of SB3's samples, but for rewards (b, n_streams). A time limit is no end: the value goes on.
        envs = np.random.randint(0, self.n_envs, size=len(batch_inds))  # noqa: NPY002 - SB3's random stream
        ended = self.dones[batch_inds, envs] * (1 - self.timeouts[batch_inds, envs])
        columns = (
            self._normalize_obs(self.observations[batch_inds, envs], env),
            self.actions[batch_inds, envs],
            self._normalize_obs(self.next_observations[batch_inds, envs], env),
            ended[:, None],
            self.rewards[batch_inds, envs],
        )
        return ReplayBufferSamples(*(self.to_torch(column) for column in columns))  # type: ignore[arg-type]
