"""A pair of rewards for any vector environment of Gymnasium."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from gymnasium.vector.utils import concatenate, create_empty_array, iterate
from numpy.typing import NDArray

from bilateral_rl.envs.batched_pairs import BatchedPairs, Float32, RewardPairs, Transitions

Mask = NDArray[np.bool_]


class VectorReward(VectorWrapper, RecordConstructorArgs):  # type: ignore[type-arg] # no arguments before Gymnasium 1.3
    """Any Gymnasium vector environment with a reward for each hemisphere, computed for all environments at once.

    It is to vector environments what :class:`bilateral_rl.envs.VectorReward` is to single ones.
    ``infos["vector_reward"]`` (n, 2) float32 holds the dominant and the non-dominant reward of each step, and the
    reward is their mean. ``infos["vector_return"]`` (n, 2) float32 holds their sums where an episode ended; in
    same-step environments it is in ``infos["final_info"]``, with that step's pair. Masks are as in all infos. In
    next-step environments both rewards are 0 where a step, whatever its action, begins an episode.

    Args:
        env: the vector environment, of any autoreset mode.
        reward_pairs: gives the pairs for :class:`Transitions`; by default the environments' own rewards (n, 2), as
            those of MO-Gymnasium are, are the pairs.

    Raises:
        ValueError: at a step, if ``reward_pairs`` gives anything but two finite numbers for each environment.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any], reward_pairs: RewardPairs | None = None) -> None:
        RecordConstructorArgs.__init__(self, reward_pairs=reward_pairs)
        VectorWrapper.__init__(self, env)
        self.reward_pairs = reward_pairs
        self._mode = env.metadata.get("autoreset_mode", AutoresetMode.NEXT_STEP)  # as Gymnasium's own wrappers assume
        self._pairs = BatchedPairs(self.num_envs, reward_pairs)
        self._ended = np.zeros(self.num_envs, dtype=np.bool_)
        self._observations: Any = None

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        mask = (options or {}).get("reset_mask", np.ones(self.num_envs, dtype=np.bool_))  # which some environments pop
        observations, infos = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type] # lists too
        self._pairs.begin(mask)
        self._ended[mask] = False
        self._observations = copy.deepcopy(observations)
        return observations, infos

    def step(self, actions: Any) -> tuple[Any, NDArray[np.float64], Mask, Mask, dict[str, Any]]:
        observations, rewards, terminations, truncations, infos = self.env.step(actions)
        ended = np.logical_or(terminations, truncations)
        moved = ~self._ended
        led_to = self._last_of(ended, observations, infos)
        transitions = Transitions(self._observations, actions, led_to, np.asarray(rewards), infos)
        pairs = self._pairs.step(transitions, moved)
        infos = self._told(infos, pairs, moved, ended)
        self._ended = ended if self._mode is AutoresetMode.NEXT_STEP else np.zeros_like(ended)
        self._observations = copy.deepcopy(observations)
        return observations, pairs.mean(axis=1).astype(np.float64), terminations, truncations, infos

    def _last_of(self, ended: Mask, observations: Any, infos: dict[str, Any]) -> Any:
        """Return the observations with those in place that ended an episode."""
        if self._mode is not AutoresetMode.SAME_STEP or not ended.any():
            return observations
        if "final_obs" not in infos:
            raise ValueError(f"{self.env} is of the same-step mode, which tells last observations in final_obs.")
        each = list(iterate(self.env.observation_space, observations))
        for i in np.flatnonzero(ended):
            each[i] = infos["final_obs"][i]
        space = self.env.single_observation_space
        led_to: Any = create_empty_array(space, self.num_envs)
        return concatenate(space, each, led_to)

    def _told(self, infos: dict[str, Any], pairs: Float32, moved: Mask, ended: Mask) -> dict[str, Any]:
        """Return infos with the pairs in them, and the sums of those episodes that ended."""
        infos = dict(infos)
        if moved.any():
            infos |= {"vector_reward": pairs, "_vector_reward": moved}
        if not ended.any():
            return infos
        returns = np.zeros((self.num_envs, 2), dtype=np.float32)
        returns[ended] = self._pairs.returns(ended)
        if self._mode is AutoresetMode.SAME_STEP:
            last = {"vector_reward": np.where(ended[:, None], pairs, np.float32(0)), "_vector_reward": ended.copy()}
            last |= {"vector_return": returns, "_vector_return": ended.copy()}
            infos |= {"final_info": infos.get("final_info", {}) | last, "_final_info": ended.copy()}
        else:
            infos |= {"vector_return": returns, "_vector_return": ended.copy()}
        return infos
