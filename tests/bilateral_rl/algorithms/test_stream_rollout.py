"""Advantages of each stream, and the minibatches."""

import numpy as np
import pytest
import torch
from gymnasium import spaces
from hypothesis import given, settings
from hypothesis import strategies as st
from stable_baselines3.common.buffers import RolloutBuffer

from bilateral_rl.algorithms.stream_rollout import StreamRolloutBuffer, generalized_advantages

OBSERVATIONS, ACTIONS = spaces.Box(-1.0, 1.0, (4,)), spaces.Box(-1.0, 1.0, (2,))

fast = settings(max_examples=60, deadline=None)
discounts = st.floats(0.0, 1.0, width=32)


@st.composite
def episodes(draw):
    """Rollouts in which episodes end by truncation (with a value of the last observation) or termination (without)."""
    n_steps, n_envs, n_streams = draw(st.integers(1, 12)), draw(st.integers(1, 4)), draw(st.integers(1, 3))
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    ends = rng.choice(["no", "truncated", "terminated"], p=[0.6, 0.2, 0.2], size=(n_steps, n_envs))
    shape = (n_steps, n_envs, n_streams)
    return {
        "rewards": rng.normal(size=shape).astype(np.float32),
        "values": rng.normal(size=shape).astype(np.float32),
        "last_values": rng.normal(size=shape[1:]).astype(np.float32),
        "terminal_values": rng.normal(size=shape).astype(np.float32),
        "ends": ends,
    }


def brute_force_advantages(episode, gamma, gae_lambda):
    """Each advantage by itself, as the discounted sum of the temporal differences until its episode's end."""
    values, ends = episode["values"].astype(float), episode["ends"]
    n_steps = len(values)

    def value_after(t, i):
        if ends[t, i] == "terminated":
            return 0.0
        if ends[t, i] == "truncated":
            return episode["terminal_values"][t, i].astype(float)
        return values[t + 1, i] if t + 1 < n_steps else episode["last_values"][i].astype(float)

    advantages = np.zeros_like(values)
    for t, i in np.ndindex(ends.shape):
        for k in range(t, n_steps):
            difference = episode["rewards"][k, i] + gamma * value_after(k, i) - values[k, i]
            advantages[t, i] += (gamma * gae_lambda) ** (k - t) * difference
            if ends[k, i] != "no":
                break
    return advantages


def bootstrapped_rewards(episode, gamma):
    """Rewards with the discounted value of the last observation where a time limit ended the episode."""
    return np.where(
        (episode["ends"] == "truncated")[..., None],
        episode["rewards"] + np.float32(gamma) * episode["terminal_values"],
        episode["rewards"],
    )


@fast
@given(episode=episodes(), gamma=discounts, gae_lambda=discounts)
def test_advantages_are_the_sums_of_temporal_differences_stream_by_stream(episode, gamma, gae_lambda):
    advantages = generalized_advantages(
        bootstrapped_rewards(episode, gamma),
        episode["values"],
        episode["last_values"],
        episode["ends"] != "no",
        gamma,
        gae_lambda,
    )
    np.testing.assert_allclose(advantages, brute_force_advantages(episode, gamma, gae_lambda), rtol=1e-4, atol=1e-4)


@fast
@given(episode=episodes(), gamma=discounts, gae_lambda=discounts)
def test_one_stream_gets_the_advantages_and_returns_of_sb3s_buffer(episode, gamma, gae_lambda):
    n_steps, n_envs, n_streams = episode["values"].shape
    rewards, dones = bootstrapped_rewards(episode, gamma), episode["ends"] != "no"
    rollout = StreamRolloutBuffer(
        n_steps, OBSERVATIONS, ACTIONS, "cpu", gae_lambda, gamma, n_envs=n_envs, n_streams=n_streams
    )
    nothing, log_probs = np.zeros((n_envs, 4), dtype=np.float32), np.zeros(n_envs, dtype=np.float32)
    for step in range(n_steps):
        assert not rollout.full
        rollout.begin_step(nothing, nothing[:, :0])
        rollout.add(nothing[:, :2], rewards[step], dones[step], log_probs)
    assert rollout.full
    rollout.compute_returns_and_advantage(episode["values"], episode["last_values"])
    for stream in range(n_streams):
        buffer = RolloutBuffer(n_steps, OBSERVATIONS, ACTIONS, "cpu", gae_lambda, gamma, n_envs)
        buffer.rewards[:], buffer.values[:] = rewards[..., stream], episode["values"][..., stream]
        buffer.episode_starts[1:] = dones[:-1]
        buffer.compute_returns_and_advantage(torch.from_numpy(episode["last_values"][:, stream]), dones[-1])
        np.testing.assert_allclose(rollout.advantages[..., stream], buffer.advantages, rtol=1e-5, atol=1e-5)
        np.testing.assert_allclose(rollout.returns[..., stream], buffer.returns, rtol=1e-5, atol=1e-5)


def numbered_rollout(n_steps=7, n_envs=3, n_streams=2):
    """A rollout whose every number tells the sample it belongs to and its column."""
    rollout = StreamRolloutBuffer(n_steps, OBSERVATIONS, ACTIONS, "cpu", n_envs=n_envs, n_streams=n_streams)
    sample = np.arange(n_steps * n_envs, dtype=np.float32).reshape(n_steps, n_envs)
    rollout.log_probs[:] = sample
    rollout.values, rollout.advantages, rollout.returns = (np.zeros_like(rollout.rewards) for _ in range(3))
    names = ("observations", "latent_actions", "values", "advantages", "returns")
    for offset, name in enumerate(names, start=1):
        array = getattr(rollout, name)
        array[:] = sample[..., None] + 100 * offset + 1000 * np.arange(array.shape[2])
    return rollout


@pytest.mark.parametrize("batch_size", [4, 64])
def test_minibatches_hold_every_sample_once_with_its_own_numbers(batch_size):
    batches = list(numbered_rollout().get(batch_size))
    samples = torch.cat([batch.old_log_prob for batch in batches])
    assert sorted(samples.tolist()) == list(range(21))
    assert [len(batch.old_log_prob) for batch in batches[:-1]] == [batch_size] * (len(batches) - 1)
    widths = {"observations": 4, "latent_actions": 2, "old_values": 2, "advantages": 2, "returns": 2}
    for offset, (name, width) in enumerate(widths.items(), start=1):
        got = torch.cat([getattr(batch, name) for batch in batches])
        expected = samples[:, None] + 100 * offset + 1000 * torch.arange(width)
        assert torch.equal(got, expected), name


def test_each_pass_shuffles_anew():
    rollout = numbered_rollout()
    passes = [next(rollout.get(21)).old_log_prob for _ in range(2)]
    assert not torch.equal(passes[0], torch.arange(21.0))
    assert not torch.equal(passes[0], passes[1])
