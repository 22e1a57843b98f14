"""A pair of rewards for any vectorized environment of stable-baselines3."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from bilateral_rl.envs.batched_pairs import BatchedPairs, RewardPairs, Transitions


class VecVectorReward(VecEnvWrapper):
    """Any ``VecEnv`` with a reward for each hemisphere, computed for all environments at once.

    It is for environments that are batched by themselves, and goes around a ``VecEnvWrapper`` that changes the reward:
    the function sees the reward as the wrappers inside have made it. Put ``VecNormalize`` around it, and
    ``VecMonitor``, which then counts returns of this reward.

    :attr:`last_vector_reward` (n_envs, 2) and ``info["vector_reward"]`` (2,) hold the dominant and the non-dominant
    reward of each step, and the reward is their mean; at an episode's last step ``info["vector_return"]`` (2,) holds
    their sums.

    Args:
        venv: the environment.
        reward_pairs: gives the pairs for :class:`~bilateral_rl.envs.batched_pairs.Transitions`; by default the
            environments' own rewards (n_envs, 2) are the pairs.

    Raises:
        ValueError: at a step, if ``reward_pairs`` gives anything but two finite numbers for each environment.
    """

    def __init__(self, venv: VecEnv, reward_pairs: RewardPairs | None = None) -> None:
        super().__init__(venv)
        self.reward_pairs = reward_pairs
        self._pairs = BatchedPairs(self.num_envs, reward_pairs)
        self._vector_reward = np.zeros((self.num_envs, 2), dtype=np.float32)
        self._observations: Any = None
        self._actions: Any = None

    @property
    def last_vector_reward(self) -> NDArray[np.float32]:
        """(n_envs, 2) float32: the last step's dominant and non-dominant reward; their mean was the reward."""
        return self._vector_reward

    def reset(self) -> VecEnvObs:
        observations = self.venv.reset()
        self._pairs.begin()
        self._vector_reward = np.zeros((self.num_envs, 2), dtype=np.float32)
        self._observations = copy.deepcopy(observations)
        return observations

    def step_async(self, actions: NDArray[Any]) -> None:
        self._actions = actions
        self.venv.step_async(actions)

    def step_wait(self) -> VecEnvStepReturn:
        observations, rewards, dones, infos = self.venv.step_wait()
        led_to = _last_of(dones, observations, infos)
        transitions = Transitions(self._observations, self._actions, led_to, np.asarray(rewards), infos)
        pairs = self._vector_reward = self._pairs.step(transitions)
        told = [info | {"vector_reward": pair} for info, pair in zip(infos, pairs, strict=True)]
        for i, summed in zip(np.flatnonzero(dones), self._pairs.returns(dones), strict=True):
            told[i]["vector_return"] = summed
        self._observations = copy.deepcopy(observations)
        return observations, pairs.mean(axis=1), dones, told


def _last_of(dones: NDArray[np.bool_], observations: Any, infos: list[dict[str, Any]]) -> Any:
    """Return the observations with those in place that ended an episode."""
    if not dones.any():
        return observations
    led_to = copy.deepcopy(observations)
    for i in np.flatnonzero(dones):
        last = infos[i]["terminal_observation"]
        if isinstance(led_to, np.ndarray):
            led_to[i] = last
        else:
            for key in led_to if isinstance(led_to, dict) else range(len(led_to)):
                led_to[key][i] = last[key]
    return led_to
