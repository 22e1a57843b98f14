"""The replay buffer: every sample is one transition with its own stream rewards."""

import numpy as np
import pytest
import torch
from gymnasium import spaces
from hypothesis import given, settings
from hypothesis import strategies as st
from stable_baselines3.common.buffers import ReplayBuffer

from bilateral_rl.algorithms.stream_replay import StreamReplayBuffer

OBSERVATIONS, ACTIONS = spaces.Box(-np.inf, np.inf, (3,)), spaces.Box(-1.0, 1.0, (2,))


def make_buffer(rows, n_envs, n_streams=2):
    return StreamReplayBuffer(rows * n_envs, OBSERVATIONS, ACTIONS, "cpu", n_envs=n_envs, n_streams=n_streams)


def fill(buffer, n_steps, rng):
    """Stores transitions whose every number tells which one it belongs to; gives how each ended, by number."""
    ends = {}
    n_envs, n_streams = buffer.rewards.shape[1:]
    for t in range(n_steps):
        number = (t * n_envs + np.arange(n_envs, dtype=np.float32))[:, None]
        done, truncated = rng.random((2, n_envs)) < 0.4
        buffer.next_rewards = number + 0.25 * np.arange(n_streams, dtype=np.float32)
        infos = [{"TimeLimit.truncated": bool(d and c)} for d, c in zip(done, truncated, strict=True)]
        buffer.add(number + np.zeros(3), number + np.full(3, 0.5), -number + np.zeros(2), np.zeros(n_envs), done, infos)
        ends |= dict(zip(number[:, 0].tolist(), (done & ~truncated).tolist(), strict=True))
    return ends


@settings(max_examples=60, deadline=None)
@given(
    rows=st.integers(1, 6),
    n_envs=st.integers(1, 4),
    n_streams=st.integers(1, 3),
    n_steps=st.integers(1, 20),
    seed=st.integers(0, 2**16),
)
def test_samples_are_whole_transitions_of_those_kept(rows, n_envs, n_streams, n_steps, seed):
    buffer = make_buffer(rows, n_envs, n_streams)
    ends = fill(buffer, n_steps, np.random.default_rng(seed))
    np.random.seed(seed)  # noqa: NPY002 - SB3's random stream
    batch = buffer.sample(400)
    number = batch.observations[:, 0]
    kept = set(list(ends)[-min(rows, n_steps) * n_envs :])
    assert set(number.tolist()) == kept, "400 samples miss none of at most 24"
    assert torch.equal(batch.rewards, number[:, None] + 0.25 * torch.arange(n_streams))
    assert torch.equal(batch.next_observations, number[:, None] + torch.full((3,), 0.5))
    assert torch.equal(batch.actions, -number[:, None].expand(-1, 2))
    assert batch.dones[:, 0].tolist() == [float(ends[n]) for n in number.tolist()], "time limits end no episode"


def test_one_stream_samples_as_sb3s_buffer_does():
    ours = make_buffer(8, 3, n_streams=1)
    fill(ours, 11, np.random.default_rng(0))
    stock = ReplayBuffer(24, OBSERVATIONS, ACTIONS, "cpu", n_envs=3)
    for name in ("observations", "next_observations", "actions", "dones", "timeouts"):
        getattr(stock, name)[:] = getattr(ours, name)
    stock.rewards[:] = ours.rewards[..., 0]
    stock.pos, stock.full = ours.pos, ours.full
    batches = []
    for buffer in (ours, stock):
        np.random.seed(0)  # noqa: NPY002
        batches.append(buffer.sample(50))
    for name in ("observations", "actions", "next_observations", "dones", "rewards"):
        assert torch.equal(*(getattr(batch, name) for batch in batches)), name


def test_memory_optimization_is_refused():
    with pytest.raises(ValueError, match="leave optimize_memory_usage out"):
        StreamReplayBuffer(
            8, OBSERVATIONS, ACTIONS, optimize_memory_usage=True, handle_timeout_termination=False, n_streams=2
        )
