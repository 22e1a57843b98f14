"""A pair of rewards for any Gymnasium environment."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from bilateral_rl.reward_pair import checked_pair


class Transition(NamedTuple):
    """A step of an environment, as the function that gives a pair of rewards sees it."""

    observation: Any
    """What the agent acted on."""
    action: Any
    """The action that the wrapper was given."""
    next_observation: Any
    """What the action led to."""
    reward: float | NDArray[np.float64]
    """The environment's own reward: a number, or a vector where its rewards are many, as those of MO-Gymnasium."""
    info: dict[str, Any]
    """The environment's own info."""


RewardPair = Callable[[Transition], tuple[float, float]]
"""A function from a step to its dominant and its non-dominant reward."""


class VectorReward(gymnasium.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Any environment with a reward for each hemisphere, so that the hemispheric algorithms can train on it.

    ``info["vector_reward"]`` (2,) float32 holds the dominant and the non-dominant reward of each step, and the reward
    is their mean. At an episode's last step ``info["vector_return"]`` (2,) float32 holds their sums. Put it around
    ``TimeLimit``, where ``gymnasium.make(...)`` has it inside, so that it sees episodes end.

    Args:
        env: the environment. Its own reward may be a vector, as those of MO-Gymnasium are.
        reward_pair: gives the pair for a :class:`Transition`; by default the environment's own reward is the pair.

    Raises:
        ValueError: at a step, if ``reward_pair``, or without it the environment, gives anything but two finite numbers.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], reward_pair: RewardPair | None = None) -> None:
        RecordConstructorArgs.__init__(self, reward_pair=reward_pair)
        gymnasium.Wrapper.__init__(self, env)
        self.reward_pair = reward_pair
        self._observation: Any = None
        self._return = np.zeros(2)
        self._steps = 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        self._observation, info = self.env.reset(seed=seed, options=options)
        self._return = np.zeros(2)
        self._steps = 0
        return self._observation, info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._steps += 1
        pair = self._pair(Transition(self._observation, action, observation, _own_reward(reward), info))
        self._observation = observation
        self._return += pair
        info = info | {"vector_reward": pair}
        if terminated or truncated:
            info["vector_return"] = self._return.astype(np.float32)
        return observation, float(pair.mean()), terminated, truncated, info

    def _pair(self, transition: Transition) -> NDArray[np.float32]:
        """Return the pair of rewards (2,) of a step."""
        when = f"at step {self._steps} of the episode"
        if self.reward_pair is not None:
            return checked_pair(
                self.reward_pair(transition), f"what reward_pair gives at step {self._steps} of the episode"
            )
        if np.ndim(transition.reward) == 0:
            raise ValueError(
                "VectorReward without reward_pair needs an environment whose reward is a pair, dominant and "
                f"non-dominant, not the number {transition.reward!r}: give a function of the step as reward_pair."
            )
        return checked_pair(transition.reward, f"the environment's reward {when}")


def _own_reward(reward: Any) -> float | NDArray[np.float64]:
    """Return the reward that an environment gave, as a number or, of several, as a vector."""
    return float(reward) if np.ndim(reward) == 0 else np.asarray(reward)
