"""Pairs of rewards for many environments at once are those of one by one, in both libraries' forms."""

import copy
import re

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics, TransformReward
from pendulum import make_pendulum, reward_pairs
from stable_baselines3.common.vec_env import DummyVecEnv, VecFrameStack, VecMonitor, VecNormalize

from bilateral_rl.envs import ArmVecEnv, ArmVectorEnv, VecVectorReward
from bilateral_rl.envs.vector import VectorReward

LENGTHS = (3, 4, 6)
"""Steps of the pendulums' episodes, so that they end at different times."""
N = len(LENGTHS)
MODES = list(AutoresetMode)
each_mode = pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.value)


def pendulums(make, mode):
    return SyncVectorEnv([lambda k=k: make(max_episode_steps=k) for k in LENGTHS], autoreset_mode=mode)


def plain(**settings):
    return gymnasium.make("Pendulum-v1", **settings)


def play(env, steps=14):
    rng = np.random.default_rng(0)
    yield *env.reset(seed=5), None, None, None
    for _ in range(steps):
        observation, reward, terminated, truncated, infos = env.step(rng.uniform(-2, 2, (N, 1)).astype(np.float32))
        yield observation, infos, reward, terminated, truncated
        if truncated.any() and env.metadata["autoreset_mode"] is AutoresetMode.DISABLED:
            yield *env.reset(options={"reset_mask": truncated}), None, None, None


def assert_alike(mine, theirs):
    if isinstance(theirs, dict):
        assert set(mine) == set(theirs)
        for key in theirs:
            assert_alike(mine[key], theirs[key])
    elif theirs is not None and theirs.dtype == object:
        for one, other in zip(mine, theirs, strict=True):
            np.testing.assert_array_equal(one, other)
    elif theirs is not None:
        assert mine.dtype == theirs.dtype
        np.testing.assert_allclose(mine, theirs, rtol=1e-5, atol=1e-6)


@each_mode
def test_gymnasiums_vector_environments_are_told_what_single_ones_are(mode):
    ours, reference = VectorReward(pendulums(plain, mode), reward_pairs), pendulums(make_pendulum, mode)
    ended = 0
    for mine, theirs in zip(play(ours), play(reference), strict=True):
        for i, (one, other) in enumerate(zip(mine, theirs, strict=True)):
            if i == 1 and mode is AutoresetMode.SAME_STEP and "final_obs" in other:
                # Gymnasium tells the pair of an episode's last step in final_info alone; here it is in its place too.
                np.testing.assert_allclose(one["vector_reward"].mean(axis=1), mine[2], rtol=1e-6)
                assert one["_vector_reward"].all()
                one, other = ({k: v for k, v in of.items() if "vector_reward" not in k} for of in (one, other))
            ended += i == 4 and other is not None and other.any()
            assert_alike(one, other)
    assert ended >= 6


@each_mode
def test_the_function_sees_the_last_observation_of_an_episode_and_not_the_next_one(mode):
    seen = []

    def keep(step):
        seen.append(copy.deepcopy(step))
        return step.reward, 0.0

    env = VectorReward(pendulums(plain, mode), keep)
    steps = [told for told in play(env) if told[2] is not None]
    moved = [infos.get("_vector_reward", np.zeros(N, bool)) for _, infos, *_ in steps]
    for step, arms in zip(seen, moved, strict=True):
        cos, sin, speed = step.observation[arms].T
        torque = step.action[arms, 0]
        angle = np.arctan2(sin, cos)
        after = np.clip(speed + 0.05 * (15 * np.sin(angle) + 3 * torque), -8, 8)  # of Gymnasium's pendulum
        np.testing.assert_allclose(step.next_observation[arms, 2], after, atol=1e-3)
        np.testing.assert_allclose(np.cos(angle + 0.05 * after), step.next_observation[arms, 0], atol=1e-3)


def test_the_pair_may_be_an_array_a_constant_or_the_environments_own():
    arms, doubled = ArmVectorEnv(N), VectorReward(ArmVectorEnv(N), lambda step: 2 * step.info["vector_reward"])
    told = []
    for env in (arms, doubled):
        env.reset(seed=0)
        _, reward, *_, infos = env.step(np.zeros((N, 6), np.float32))
        np.testing.assert_allclose(reward, infos["vector_reward"].mean(axis=1))
        told.append(infos["vector_reward"])
    np.testing.assert_allclose(told[1], 2 * told[0])
    constant = VectorReward(ArmVectorEnv(N), lambda step: (1, 3.0))
    constant.reset(seed=0)
    assert constant.step(np.zeros((N, 6), np.float32))[1].tolist() == [2.0] * N
    many = VectorReward(TransformReward(ArmVectorEnv(N), lambda reward: np.stack([reward, 3 * reward], axis=1)))
    many.reset(seed=0)
    _, reward, *_, infos = many.step(np.zeros((N, 6), np.float32))
    np.testing.assert_allclose(infos["vector_reward"][:, 1], 3 * infos["vector_reward"][:, 0])


def test_it_sees_the_reward_that_wrappers_within_have_made_and_others_go_around_it():
    doubled = TransformReward(pendulums(plain, MODES[0]), lambda reward: 2 * reward)
    env = RecordEpisodeStatistics(VectorReward(doubled, lambda step: (step.reward, 0.0)))
    env.reset(seed=0)
    total = np.zeros(N)
    for _ in range(LENGTHS[0]):
        _, reward, _, truncated, infos = env.step(np.zeros((N, 1), np.float32))
        np.testing.assert_allclose(infos["vector_reward"], np.stack([2 * reward, 0 * reward], axis=1), rtol=1e-6)
        total += reward
    assert truncated.tolist() == [True, False, False]
    np.testing.assert_allclose(infos["episode"]["r"][0], total[0], rtol=1e-6)
    np.testing.assert_allclose(infos["vector_return"][0].mean(), total[0], rtol=1e-6)


BAD = {
    "one number": (lambda step: 1.0, "as a tuple, dominant and non-dominant, or one array"),
    "one array": (lambda step: np.ones(N), "one array (3, 2), got ndarray of shape (3,)"),
    "three": (lambda step: (1.0, 2.0, 3.0), "got tuple of shape (3,)"),
    "other lengths": (
        lambda step: (np.ones(N + 1), np.ones(N)),
        "two arrays (3,), dominant and non-dominant, got shapes (4,), (3,)",
    ),
    "words": (lambda step: ("a", "b"), "got shapes (), ()"),
    "nothing": (lambda step: None, "got NoneType"),
    "not finite": (lambda step: (np.zeros(N), np.array([0, np.nan, 0])), "of environment 1 must be two finite numbers"),
    "too large": (lambda step: (np.zeros(N), np.full(N, 1e300)), "of environment 0 must be two finite numbers"),
    "not of their own": (None, "the environments' reward must be two arrays"),
}


@pytest.mark.parametrize(("function", "sentence"), BAD.values(), ids=BAD)
def test_anything_but_pairs_is_refused_in_a_sentence(function, sentence):
    env = VectorReward(pendulums(plain, MODES[0]), function)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=re.escape(sentence)):
        env.step(np.zeros((N, 1), np.float32))
    venv = VecVectorReward(DummyVecEnv([plain] * N), function)
    venv.reset()
    with pytest.raises(ValueError, match=re.escape(sentence)):
        venv.step(np.zeros((N, 1), np.float32))


@pytest.mark.filterwarnings("ignore:invalid value encountered in divide")
def test_what_no_environment_moved_by_is_not_asked_for():
    """A function that divides by what a reset leaves at zero gives NaN where its number means nothing."""
    env = VectorReward(pendulums(plain, AutoresetMode.NEXT_STEP), lambda step: (step.reward / step.reward, 1.0))
    for mine in play(env):
        if mine[2] is not None:
            moved = mine[1].get("_vector_reward", np.zeros(N, bool))
            np.testing.assert_array_equal(mine[2], moved.astype(float))


def dummy(make):
    env = DummyVecEnv([lambda k=k: make(max_episode_steps=k) for k in LENGTHS])
    env.seed(5)
    return env


def test_sb3s_vectorized_environments_are_told_what_single_ones_are():
    ours, reference = VecVectorReward(dummy(plain), reward_pairs), dummy(make_pendulum)
    np.testing.assert_array_equal(ours.reset(), reference.reset())
    rng, ended = np.random.default_rng(0), 0
    for _ in range(14):
        actions = rng.uniform(-2, 2, (N, 1)).astype(np.float32)
        mine, theirs = ours.step(actions), reference.step(actions)
        np.testing.assert_array_equal(mine[0], theirs[0])
        np.testing.assert_allclose(mine[1], theirs[1], rtol=1e-5)
        np.testing.assert_array_equal(mine[2], theirs[2])
        ended += theirs[2].sum()
        for i, (info, other) in enumerate(zip(mine[3], theirs[3], strict=True)):
            assert info.keys() == other.keys()
            np.testing.assert_array_equal(info["vector_reward"], ours.last_vector_reward[i])
            np.testing.assert_allclose(info["vector_reward"], other["vector_reward"], rtol=1e-5, atol=1e-7)
            if theirs[2][i]:
                np.testing.assert_allclose(info["vector_return"], other["vector_return"], rtol=1e-5, atol=1e-6)
                np.testing.assert_array_equal(info["terminal_observation"], other["terminal_observation"])
    assert ended > 6


@pytest.mark.filterwarnings("ignore:The environment is already wrapped with a `Monitor`")
def test_around_sb3s_own_wrappers_it_sees_what_they_made():
    stacked = VecFrameStack(VecNormalize(ArmVecEnv(N, seed=0, trial_length=3), norm_reward=True), 2)
    seen = []
    env = VecMonitor(VecVectorReward(stacked, lambda step: seen.append(step) or (step.reward, 2 * step.reward)))
    env.reset()
    total = np.zeros(N)
    for _ in range(3):
        _, reward, dones, infos = env.step(np.zeros((N, 6), np.float32))
        np.testing.assert_allclose(reward, 1.5 * seen[-1].reward, rtol=1e-6)
        total += reward
    assert dones.all()
    np.testing.assert_array_equal(seen[-1].next_observation, [info["terminal_observation"] for info in infos])
    assert seen[-1].observation.shape == (N, 32)
    np.testing.assert_allclose([info["episode"]["r"] for info in infos], total, rtol=1e-4)
    np.testing.assert_allclose([info["vector_return"].mean() for info in infos], total, rtol=1e-4)
