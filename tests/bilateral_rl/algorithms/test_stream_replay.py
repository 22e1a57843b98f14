"""The replay buffer: every sample is one transition with its own stream rewards."""

import numpy as np
import pytest
import torch
from gymnasium import spaces
from hemispheric_models import RandomEnds, arm, collect, make_model
from hypothesis import given, settings
from hypothesis import strategies as st
from stable_baselines3 import SAC
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.vec_env import DummyVecEnv

from bilateral_rl.algorithms import HemisphericSAC
from bilateral_rl.algorithms.stream_replay import StreamReplayBuffer
from bilateral_rl.envs import ArmVecEnv

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


def saved_buffer(tmp_path, **settings):
    """The file of a buffer that has been filled."""
    collect(make_model(HemisphericSAC, **settings)).save_replay_buffer(tmp_path / "buffer.pkl")
    return tmp_path / "buffer.pkl"


OTHERS = {
    "another size": ({"buffer_size": 400}, "another size or loss: it has 500 steps, 4 environments, 2 streams"),
    "another number of environments": ({"env": arm(2)}, "another size or loss"),
    "another loss": (
        {"loss": "combined"},
        "it has .* 2 streams, and the model's has .* 1 streams",
    ),
    "other traces": ({"action_traces": (0.5,)}, r"traces of decays \(\), and action_traces is \(0.5,\)"),
    "another environment": ({"env": DummyVecEnv([RandomEnds] * 4)}, "of another environment: its observation_space"),
    "another arm": ({"env": ArmVecEnv(4, arm={"link_length": (0.3, 0.4)})}, "of another environment"),
}


@pytest.mark.parametrize(("settings", "reason"), OTHERS.values(), ids=OTHERS)
def test_a_buffer_of_another_model_is_refused_and_the_present_one_stays(settings, reason, tmp_path):
    path = saved_buffer(tmp_path)
    model = make_model(HemisphericSAC, **settings)
    present = model.replay_buffer
    with pytest.raises(ValueError, match=reason):
        model.load_replay_buffer(path)
    assert model.replay_buffer is present


def test_what_is_no_buffer_of_ours_is_refused(tmp_path):
    model, path = make_model(HemisphericSAC), tmp_path / "buffer.pkl"
    present = model.replay_buffer
    SAC("MlpPolicy", arm(), buffer_size=400, device="cpu").save_replay_buffer(path)
    with pytest.raises(ValueError, match="the file holds a ReplayBuffer, not the replay buffer of a hemispheric"):
        model.load_replay_buffer(path)
    path.write_bytes(saved_buffer(tmp_path).read_bytes()[:1000])
    with pytest.raises(ValueError, match=r"buffer\.pkl holds no replay buffer"):
        model.load_replay_buffer(path)
    spoiled = collect(make_model(HemisphericSAC))
    spoiled.replay_buffer.rewards[3] = np.nan
    spoiled.save_replay_buffer(path)
    with pytest.raises(ValueError, match="the replay buffer has rewards that are not finite"):
        model.load_replay_buffer(path)
    with pytest.raises(FileNotFoundError):
        model.load_replay_buffer(tmp_path / "none.pkl")
    assert model.replay_buffer is present


def test_rewards_that_are_kept_follow_the_scale(tmp_path):
    path = saved_buffer(tmp_path, reward_scale=2.0)
    model = make_model(HemisphericSAC, reward_scale=0.5)
    model.load_replay_buffer(path)
    unscaled = collect(make_model(HemisphericSAC)).replay_buffer.rewards
    np.testing.assert_allclose(model.replay_buffer.rewards, 0.5 * unscaled, rtol=1e-6)
    model.reward_scale = 4.0
    model._setup_learn(1)
    np.testing.assert_allclose(model.replay_buffer.rewards, 4 * unscaled, rtol=1e-6)
