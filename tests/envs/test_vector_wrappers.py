"""Gymnasium's stock wrappers for vector environments take ArmVectorEnv as they take its own environments."""

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import vector

from bilateral_rl.envs import ArmEnv, ArmVectorEnv

LENGTH, N = 4, 3
SAME, NEXT = AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP

HALF = spaces.Box(-0.5, 0.5, (16,))
ON_BOTH = {
    "RecordEpisodeStatistics": vector.RecordEpisodeStatistics,
    "NormalizeReward": vector.NormalizeReward,
    "ClipReward": lambda env: vector.ClipReward(env, -2.0, -0.5),
    "TransformReward": lambda env: vector.TransformReward(env, lambda reward: 2 * reward),
    "VectorizeTransformReward": lambda env: vector.VectorizeTransformReward(
        env, gymnasium.wrappers.TransformReward, func=lambda reward: reward - 1
    ),
    "ClipAction": vector.ClipAction,
    "RescaleAction": lambda env: vector.RescaleAction(env, 0.0, 1.0),
    "TransformAction": lambda env: vector.TransformAction(env, lambda action: action / 2),
    "DictInfoToList": vector.DictInfoToList,
}
"""Wrappers that take every mode."""
ON_NEXT = {
    "VectorizeTransformObservation": lambda env: vector.VectorizeTransformObservation(
        env, gymnasium.wrappers.TransformObservation, func=lambda seen: seen / 2, observation_space=HALF
    ),
    "NormalizeObservation": vector.NormalizeObservation,
    "TransformObservation": lambda env: vector.TransformObservation(env, lambda seen: seen + 1),
    "FlattenObservation": vector.FlattenObservation,
    "ReshapeObservation": lambda env: vector.ReshapeObservation(env, (4, 4)),
    "RescaleObservation": lambda env: vector.RescaleObservation(env, -1.0, 1.0),
    "DtypeObservation": lambda env: vector.DtypeObservation(env, np.float64),
}
"""Wrappers that refuse the same-step mode."""
WRAPPERS = ON_BOTH | ON_NEXT
CASES = [(name, NEXT) for name in WRAPPERS] + [(name, SAME) for name in ON_BOTH]


def batched(mode, **settings):
    return ArmVectorEnv(N, trial_length=LENGTH, autoreset_mode=mode, **settings)


def one_by_one(mode):
    return gymnasium.vector.SyncVectorEnv([lambda: ArmEnv(trial_length=LENGTH)] * N, autoreset_mode=mode)


def play(env, steps=3 * LENGTH):
    rng = np.random.default_rng(0)
    yield (*env.reset(seed=9),)
    for _ in range(steps):
        yield env.step(rng.uniform(0, 1, (N, 6)).astype(np.float32))


def assert_alike(mine, theirs):
    """Numbers within rounding; times, and what only the arms say of a trial's last step, aside."""
    if isinstance(theirs, dict):
        for key in set(theirs) - {"t"}:
            assert_alike(mine[key], theirs[key])
    elif isinstance(theirs, (list, tuple)) or (isinstance(theirs, np.ndarray) and theirs.dtype.hasobject):
        for one, other in zip(mine, theirs, strict=True):
            assert_alike(one, other)
    elif theirs is not None:
        np.testing.assert_allclose(mine, theirs, rtol=1e-5, atol=1e-6)


@pytest.mark.filterwarnings("ignore:.*Box (low|high)", "ignore:overflow encountered in cast")
@pytest.mark.parametrize(("name", "mode"), CASES, ids=lambda value: getattr(value, "value", value))
def test_what_comes_out_of_the_wrapper_is_what_comes_out_around_gymnasiums_own(name, mode):
    wrapped = [WRAPPERS[name](env(mode)) for env in (batched, one_by_one)]
    assert wrapped[0].observation_space == wrapped[1].observation_space
    assert wrapped[0].action_space == wrapped[1].action_space
    ended = 0
    for mine, theirs in zip(*map(play, wrapped), strict=True):
        over = len(theirs) == 5 and mode is SAME and theirs[3].any()  # of which the arms say more than Gymnasium's
        ended += over or (len(theirs) == 5 and theirs[3].any())
        for one, other in zip(mine, theirs, strict=True):
            if not (over and isinstance(other, (dict, list))):
                assert_alike(one, other)
    assert ended >= 2


@pytest.mark.parametrize("mode", [SAME, NEXT], ids=lambda mode: mode.value)
def test_episode_statistics_count_every_trial(mode):
    env = vector.RecordEpisodeStatistics(batched(mode))
    env.reset(seed=9)
    totals = []
    for k in range(3 * LENGTH + 2):
        if k % (LENGTH + (mode is NEXT)) == 0:
            totals.append(np.zeros(N))
        _, reward, _, truncated, infos = env.step(env.action_space.sample())
        totals[-1] += reward
        if truncated.all() and (mode is NEXT or k < LENGTH):  # Gymnasium 1.1 counts later same-step ones a step short
            np.testing.assert_array_equal(infos["episode"]["l"], [LENGTH] * N)
            np.testing.assert_allclose(infos["episode"]["r"], totals[-1], rtol=1e-5)
            assert infos["_episode"].all()
    assert env.episode_count == 3 * N


def test_torch_tensors_go_in_and_come_out():
    torch = pytest.importorskip("torch")
    pytest.importorskip("array_api_compat")  # which Gymnasium's conversions need
    env = vector.NumpyToTorch(batched(NEXT))
    observation, _ = env.reset(seed=9)
    observation, reward, *_ = env.step(torch.zeros(N, 6))
    assert isinstance(observation, torch.Tensor)
    expected = batched(NEXT)
    expected.reset(seed=9)
    np.testing.assert_array_equal(reward.numpy(), expected.step(np.zeros((N, 6), np.float32))[1])


def test_there_is_a_picture_of_every_arm_and_a_window_shows_them(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pytest.importorskip("pygame")
    arms = 17  # more than the 16 that a window of our own shows
    env = ArmVectorEnv(arms, trial_length=2, render_mode="rgb_array", autoreset_mode=NEXT)
    env.reset(seed=9)
    assert len(env.render()) == arms
    pytest.importorskip("cv2")  # with which Gymnasium scales them
    env = vector.HumanRendering(env, screen_size=(480, 480))
    env.reset(seed=9)
    env.step(np.zeros((arms, 6), np.float32))
    env.close()


def test_videos_are_recorded_at_the_rate_of_the_step(tmp_path):
    for module in ("moviepy", "pygame"):
        pytest.importorskip(module)
    env = batched(NEXT, render_mode="rgb_array", arm={"timestep": 0.02})
    env = vector.RecordVideo(env, str(tmp_path / "videos"), episode_trigger=lambda episode: episode == 1)
    assert env.frames_per_sec == 12.5
    env.reset(seed=9)
    for _ in range(LENGTH + 3):
        env.step(np.zeros((N, 6), np.float32))
    env.close()
    (video,) = (tmp_path / "videos").iterdir()
    assert video.name == "rl-video-episode-1.mp4"
    assert video.stat().st_size > 1000
