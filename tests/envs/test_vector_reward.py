"""VectorReward gives any environment a pair of rewards."""

import re

import cloudpickle
import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env
from pendulum import make_pendulum, reward_pair
from stable_baselines3.common.env_checker import check_env as check_env_for_sb3
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

from bilateral_rl.envs import VectorReward


def episode(env, seed=0):
    """Everything that an episode of seeded random actions gives, step by step."""
    rng = np.random.default_rng(seed)
    observation, _ = env.reset(seed=seed)
    steps, ended = [], False
    while not ended:
        action = rng.uniform(env.action_space.low, env.action_space.high).astype(np.float32)
        next_observation, reward, terminated, truncated, info = env.step(action)
        steps.append((observation, action, next_observation, reward, info))
        observation, ended = next_observation, terminated or truncated
    return steps


def test_the_pair_is_what_the_function_says_of_the_step():
    seen = []

    def first_two(transition):
        seen.append(transition)
        return 3.0, transition.reward

    steps = episode(VectorReward(gymnasium.make("Pendulum-v1"), first_two))
    plain = episode(gymnasium.make("Pendulum-v1"))
    assert len(steps) == len(plain) == len(seen) == 200
    for step, stock, transition in zip(steps, plain, seen, strict=True):
        for ours, theirs, given in zip(step[:3], stock[:3], transition[:3], strict=True):
            np.testing.assert_array_equal(ours, theirs)
            np.testing.assert_array_equal(given, theirs)
        assert transition.reward == stock[3]
        pair = step[4]["vector_reward"]
        assert pair.dtype == np.float32
        np.testing.assert_allclose(pair, [3.0, stock[3]], rtol=1e-6)
        assert step[3] == pytest.approx(pair.mean())
        assert type(step[3]) is float


def test_the_pendulums_pair_averages_to_its_own_reward():
    steps, plain = episode(make_pendulum()), episode(gymnasium.make("Pendulum-v1"))
    np.testing.assert_allclose([step[3] for step in steps], [step[3] for step in plain], rtol=1e-4, atol=1e-5)


def test_the_last_step_of_every_episode_holds_its_sums():
    env = make_pendulum()
    for seed in (0, 1):
        steps = episode(env, seed)
        infos = [info for *_, info in steps]
        assert all("vector_return" not in info for info in infos[:-1])
        total = np.sum([info["vector_reward"] for info in infos], axis=0)
        np.testing.assert_allclose(infos[-1]["vector_return"], total, rtol=1e-5)
        assert infos[-1]["vector_return"].dtype == np.float32


@pytest.mark.filterwarnings("ignore")  # what they recommend is the pendulum's to follow
def test_it_passes_both_checkers():
    check_env(make_pendulum(), skip_render_check=True)
    check_env_for_sb3(make_pendulum())


def test_the_environments_own_info_stays_and_is_not_written_into():
    class Informed(gymnasium.Env):
        observation_space = action_space = spaces.Box(-1, 1, (1,))
        mine = {"forward": 2.0, "effort": -0.5}

        def reset(self, *, seed=None, options=None):
            return np.zeros(1, np.float32), {}

        def step(self, action):
            return np.zeros(1, np.float32), 0.0, False, False, self.mine

    env = VectorReward(Informed(), lambda t: (t.info["forward"], t.info["effort"]))
    env.reset()
    info = env.step(np.zeros(1, np.float32))[4]
    assert info | Informed.mine == info
    np.testing.assert_array_equal(info["vector_reward"], [2.0, -0.5])
    assert set(Informed.mine) == {"forward", "effort"}


def test_anything_but_two_finite_numbers_is_refused():
    env = VectorReward(gymnasium.make("Pendulum-v1"), lambda transition: bad)
    for bad in (1.0, (1.0,), (1.0, 2.0, 3.0), (1.0, np.nan), (np.inf, 0.0), (1e300, 0.0), None, ("a", "b"), ([1], [2])):
        env.reset(seed=0)
        with pytest.raises(ValueError, match=re.escape(f"two finite numbers, dominant and non-dominant, got {bad!r}")):
            env.step(env.action_space.sample())


def test_several_side_by_side():
    venv = DummyVecEnv([lambda: Monitor(make_pendulum(max_episode_steps=30))] * 2)
    venv.seed(0)
    venv.reset()
    for _ in range(30):
        _, rewards, dones, infos = venv.step(np.zeros((2, 1), np.float32))
        np.testing.assert_allclose(rewards, [info["vector_reward"].mean() for info in infos], rtol=1e-6)
    assert dones.all()
    for info in infos:
        assert info["episode"]["r"] == pytest.approx(info["vector_return"].mean(), abs=1e-3)


def test_it_travels_to_other_processes():
    """SubprocVecEnv pickles the function that makes an environment, even one of a function that has no name."""
    make = cloudpickle.loads(cloudpickle.dumps(lambda: VectorReward(gymnasium.make("Pendulum-v1"), lambda t: (1, 2))))
    env = make()
    env.reset(seed=0)
    assert env.step(env.action_space.sample())[1] == 1.5


def test_gymnasium_makes_it_again_from_its_spec():
    again = gymnasium.make(make_pendulum().spec)
    assert isinstance(again, VectorReward)
    assert again.reward_pair is reward_pair


class ManyRewards(gymnasium.Env):
    """An environment whose reward is a vector, as those of MO-Gymnasium."""

    observation_space = action_space = spaces.Box(-1, 1, (1,))

    def __init__(self, rewards):
        self.rewards = rewards

    def reset(self, *, seed=None, options=None):
        return np.zeros(1, np.float32), {}

    def step(self, action):
        return np.zeros(1, np.float32), self.rewards, False, False, {}


def one_step(env):
    env.reset()
    return env.step(np.zeros(1, np.float32))


def test_a_vector_of_two_rewards_is_the_pair():
    _, reward, *_, info = one_step(VectorReward(ManyRewards(np.array([2.0, -1.0]))))
    np.testing.assert_array_equal(info["vector_reward"], [2.0, -1.0])
    assert info["vector_reward"].dtype == np.float32
    assert reward == 0.5
    assert type(reward) is float


def test_a_reward_that_is_not_finite_is_refused_with_the_step_of_its_episode():
    rewards = iter([0.0, 0.0, 0.0, np.nan])
    env = VectorReward(gymnasium.make("Pendulum-v1"), lambda transition: (next(rewards), 0.0))
    for steps in (2, 1):
        env.reset(seed=0)
        for _ in range(steps):
            env.step(env.action_space.sample())
    with pytest.raises(ValueError, match="what reward_pair gives at step 2 of the episode must be two finite numbers"):
        env.step(env.action_space.sample())


def test_a_function_may_make_a_pair_of_any_number_of_rewards():
    env = VectorReward(ManyRewards(np.array([2.0, -1.0, 4.0])), lambda step: (step.reward[0], step.reward[1:].sum()))
    np.testing.assert_array_equal(one_step(env)[4]["vector_reward"], [2.0, 3.0])


def test_other_rewards_than_two_need_a_function():
    with pytest.raises(
        ValueError,
        match=r"environment.s reward at step 1 of the episode must be two finite numbers.*array\(\[1., 2., 3.\]\)",
    ):
        one_step(VectorReward(ManyRewards(np.array([1.0, 2.0, 3.0]))))
    with pytest.raises(ValueError, match=r"not the number 1\.5: give a function of the step as reward_pair"):
        one_step(VectorReward(ManyRewards(1.5)))
