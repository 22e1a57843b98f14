"""An environment whose pairs of rewards can be told by the step, and wrappers that change rewards, pairs, or both."""

import gymnasium
import numpy as np
from gymnasium import spaces
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnvWrapper, VecNormalize

LENGTH = 7
"""Steps of an episode."""
PAIR = np.array([1.0, -0.25], dtype=np.float32)
"""The pair of an episode's first step; that of its step t is t times as large."""


def known_pairs(n_steps, n_envs=2, factor=(1.0, 1.0)):
    """The pairs of the first steps, (n_steps, n_envs, 2), each side's times its factor."""
    steps = 1 + np.arange(n_steps) % LENGTH
    return np.tile((steps[:, None] * PAIR * np.array(factor, np.float32))[:, None], (1, n_envs, 1))


class KnownPairs(gymnasium.Env):
    """Episodes that end by themselves after ``LENGTH`` steps of random observations."""

    action_space = spaces.Box(-1.0, 1.0, (2,))

    def __init__(self, shape=(3,)):
        self.observation_space = (
            spaces.Box(0, 255, shape, np.uint8) if len(shape) == 3 else spaces.Box(-1.0, 1.0, shape)  # an image
        )

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.steps = 0
        return self._observation(), {}

    def step(self, action):
        self.steps += 1
        pair = self.steps * PAIR
        return (
            self._observation(),
            float(pair.mean()),
            self.steps == LENGTH,
            False,
            {"vector_reward": pair},
        )

    def _observation(self):
        space = self.observation_space
        return self.np_random.uniform(space.low, space.high).astype(space.dtype)


def two(wrap=lambda env: env, **arguments):
    """Two environments, each wrapped."""
    return DummyVecEnv([lambda: wrap(KnownPairs(**arguments))] * 2)


class OwnRewardWrapper(gymnasium.RewardWrapper):
    """Doubles the reward, and leaves the pair."""

    def reward(self, reward):
        return 2 * reward


class Passing(VecEnvWrapper):
    """A wrapper of one's own that changes nothing."""

    def reset(self):
        return self.venv.reset()

    def step_wait(self):
        return self.venv.step_wait()


class OwnPair(Passing):
    """Puts a pair ten times as large into infos, and its mean into the reward."""

    def step_wait(self):
        observations, rewards, dones, infos = self.venv.step_wait()
        return (
            observations,
            10 * rewards,
            dones,
            [info | {"vector_reward": 10 * self._pair(i, info)} for i, info in enumerate(infos)],
        )

    def _pair(self, number, info):
        return info["vector_reward"] if "vector_reward" in info else self.venv.last_vector_reward[number]


class Anew(OwnPair):
    """Puts such a pair into infos and its mean into the reward, whatever the reward has become within."""

    def step_wait(self):
        observations, _, dones, infos = super().step_wait()
        return observations, np.array([info["vector_reward"].mean() for info in infos]), dones, infos


class OwnPairOnly(OwnPair):
    """The same, but with the reward as it was."""

    def step_wait(self):
        observations, rewards, dones, infos = super().step_wait()
        return observations, rewards / 10, dones, infos


class OwnAttribute(Passing):
    """Gives pairs, whose first is three times as large, as ``last_vector_reward``, and their mean as the reward."""

    def step_wait(self):
        observations, _, dones, infos = self.venv.step_wait()
        self.last_vector_reward = np.array([info["vector_reward"] for info in infos]) * np.array([3, 1], np.float32)
        return observations, self.last_vector_reward.mean(axis=1), dones, infos


class Swapped(Passing):
    """Gives both sides' rewards the other way round, as ``last_vector_reward``, and leaves infos."""

    def step_wait(self):
        observations, rewards, dones, infos = self.venv.step_wait()
        self.last_vector_reward = np.array([info["vector_reward"][::-1] for info in infos])
        return observations, rewards, dones, infos


def half(env, **arguments):
    """``VecNormalize`` whose statistics stay such that it halves rewards."""
    normalized = VecNormalize(env, training=False, epsilon=0.0, clip_reward=3.0, **arguments)
    normalized.ret_rms.var = np.array(4.0)
    return normalized
