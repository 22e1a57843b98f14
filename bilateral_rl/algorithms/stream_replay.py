"""SB3's replay buffer with one reward per stream, and traces of the actions before each step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium import Space
from numpy.typing import NDArray
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.vec_env import VecNormalize
from torch import Tensor

from bilateral_rl.algorithms.action_traces import ActionTraces


class StreamSamples(NamedTuple):
    """A batch of ``b`` steps."""

    observations: Tensor
    """(b, *observation shape)."""
    actions: Tensor
    """(b, n_actions), in [-1, 1]."""
    next_observations: Tensor
    """(b, *observation shape)."""
    dones: Tensor
    """(b, 1): 1 where the step ended its trial; a time limit is no end."""
    rewards: Tensor
    """(b, n_streams)."""
    traces: Tensor
    """(b, n): traces of the actions before the step; n is 0 without traces."""
    next_traces: Tensor
    """(b, n): the same after the step, also where it was the last of its trial."""


class StreamReplayBuffer(ReplayBuffer):
    """SB3's replay buffer, but rewards are (buffer_size, n_envs, n_streams) and are not normalized.

    Args:
        *args: arguments of SB3's ``ReplayBuffer``.
        n_streams: number of reward streams.
        action_traces: decays of the traces of past actions.
        **kwargs: further arguments of SB3's ``ReplayBuffer``.

    Attributes:
        next_rewards: (n_envs, n_streams), the rewards that the next ``add`` stores; it ignores the scalar reward.
        next_traces: (n_envs, n), the traces before the step that the next ``add`` stores.
        traces: (buffer_size, n_envs, n), those of all steps; None without traces.

    Raises:
        ValueError: ``optimize_memory_usage``, or decays that are not in [0, 1).
    """

    next_rewards: NDArray[np.float32]
    next_traces: NDArray[np.float32]
    traces: NDArray[np.float32] | None = None  # of buffers that were saved before there were any
    reward_scale: float | None = None  # likewise: by what the algorithm has scaled the rewards

    def __init__(self, *args: Any, n_streams: int = 1, action_traces: Sequence[float] = (), **kwargs: Any) -> None:
        if kwargs.get("optimize_memory_usage"):
            raise ValueError("a StreamReplayBuffer keeps next observations: leave optimize_memory_usage out.")
        super().__init__(*args, **kwargs)
        self.rewards = np.zeros((self.buffer_size, self.n_envs, n_streams), dtype=np.float32)
        self.action_traces = ActionTraces(action_traces, self.action_dim)
        size = self.action_traces.size
        self.traces = np.zeros((self.buffer_size, self.n_envs, size), dtype=np.float32) if size else None

    def scale_to(self, reward_scale: float) -> None:
        """Let all rewards, also those that are kept, be scaled by ``reward_scale``."""
        if self.reward_scale not in (None, reward_scale):
            self.rewards *= reward_scale / self.reward_scale
        self.reward_scale = reward_scale

    def add(
        self,
        obs: NDArray[Any],
        next_obs: NDArray[Any],
        action: NDArray[Any],
        reward: NDArray[Any],
        done: NDArray[Any],
        infos: list[dict[str, Any]],
    ) -> None:
        """Store one step of every environment with :attr:`next_rewards` and :attr:`next_traces`."""
        if self.traces is not None:
            self.traces[self.pos] = self.next_traces
        super().add(obs, next_obs, action, self.next_rewards, done, infos)

    def sample(self, batch_size: int, env: VecNormalize | None = None) -> StreamSamples:  # type: ignore[override]
        """Draw ``batch_size`` steps of those kept."""
        return super().sample(batch_size, env)  # type: ignore[return-value]

    def _get_samples(self, batch_inds: NDArray[np.intp], env: VecNormalize | None = None) -> StreamSamples:  # type: ignore[override]
        # The columns of SB3's samples, but for rewards (b, n_streams). A time limit is no end: the value goes on.
        envs = np.random.randint(0, self.n_envs, size=len(batch_inds))  # noqa: NPY002 - SB3's random stream
        return self._columns(batch_inds, envs, env)

    def kept(self, at_most: int, env: VecNormalize | None = None) -> StreamSamples:
        """Return the first steps that are kept, of all environments, no more than about ``at_most``."""
        rows = min(self.size(), max(at_most // self.n_envs, 1))
        steps, envs = np.divmod(np.arange(rows * self.n_envs), self.n_envs)
        return self._columns(steps, envs, env)

    def _columns(self, steps: NDArray[np.intp], envs: NDArray[np.intp], env: VecNormalize | None) -> StreamSamples:
        ended = self.dones[steps, envs] * (1 - self.timeouts[steps, envs])
        actions = self.actions[steps, envs]
        before = np.zeros((len(steps), 0), np.float32) if self.traces is None else self.traces[steps, envs]
        columns = (
            self._normalize_obs(self.observations[steps, envs], env),
            actions,
            self._normalize_obs(self.next_observations[steps, envs], env),
            ended[:, None],
            self.rewards[steps, envs],
            before,
            # Computed anew as it was when the step was taken, which halves what the traces take of the memory.
            before if self.traces is None else self.action_traces.advance(before, actions),
        )
        return StreamSamples(*(self.to_torch(column) for column in columns))  # type: ignore[arg-type]


def check_fits(
    buffer: object,
    spaces: tuple[Space[Any], Space[Any]],
    shape: tuple[int, int, int],
    decays: Sequence[float],
) -> None:
    """Refuse a buffer that a model cannot go on with.

    Args:
        buffer: what a file holds.
        spaces: of the model's observations and actions.
        shape: (buffer_size, n_envs, n_streams) of the model's.
        decays: of the traces that the model's critics see.

    Raises:
        ValueError: what is no such buffer, or one of another environment, loss, size, or of other traces.
    """
    if not isinstance(buffer, StreamReplayBuffer):
        raise ValueError(
            f"the file holds a {type(buffer).__name__}, not the replay buffer of a hemispheric algorithm, which has "
            "the rewards of every stream."
        )
    theirs = buffer.action_traces.decays if hasattr(buffer, "action_traces") else ()
    if theirs != tuple(decays):
        raise ValueError(f"the replay buffer holds traces of decays {theirs}, and action_traces is {tuple(decays)}.")
    for what, own in zip(("observation_space", "action_space"), spaces, strict=True):
        if getattr(buffer, what) != own:
            raise ValueError(
                f"the replay buffer is of another environment: its {what} is {getattr(buffer, what)}, not {own}."
            )
    for what in ("observations", "next_observations", "actions", "rewards"):
        kept = getattr(buffer, what)[: buffer.size()]
        if kept.dtype.kind == "f" and not np.isfinite(kept).all():
            raise ValueError(f"the replay buffer has {what} that are not finite.")
    if buffer.rewards.shape != shape:
        found, wanted = ("{:,} steps, {} environments, {} streams".format(*s) for s in (buffer.rewards.shape, shape))
        raise ValueError(
            f"the replay buffer is of another size or loss: it has {found}, and the model's has {wanted}; load it into "
            "a model of the same buffer_size, number of environments and loss."
        )
