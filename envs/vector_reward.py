"""A pair of rewards for any Gymnasium environment."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray


class Transition(NamedTuple):
    """A step of an environment, as the function that gives a pair of rewards sees it."""

    observation: Any
    """What the agent acted on."""
    action: Any
    """The action that the wrapper was given."""
    next_observation: Any
    """What the action led to."""
    reward: float
    """The environment's own reward."""
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
        env: the environment.
        reward_pair: gives the pair for a :class:`Transition`.

    Raises:
        ValueError: at a step, if ``reward_pair`` gives anything but two finite numbers.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], reward_pair: RewardPair) -> None:
        RecordConstructorArgs.__init__(self, reward_pair=reward_pair)
        gymnasium.Wrapper.__init__(self, env)
        self.reward_pair = reward_pair
        self._observation: Any = None
        self._return = np.zeros(2)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        self._observation, info = self.env.reset(seed=seed, options=options)
        self._return = np.zeros(2)
        return self._observation, info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        observation, reward, terminated, truncated, info = self.env.step(action)
        transition = Transition(self._observation, action, observation, float(reward), info)
        pair = _checked(self.reward_pair(transition))
        self._observation = observation
        self._return += pair
        info = info | {"vector_reward": pair}
        if terminated or truncated:
            info["vector_return"] = self._return.astype(np.float32)
        return observation, float(pair.mean()), terminated, truncated, info


def _checked(pair: Any) -> NDArray[np.float32]:
    """Return the rewards (2,) that ``reward_pair`` gave.

    Raises:
        ValueError: anything but two finite numbers.
    """
    try:
        with np.errstate(over="ignore"):
            numbers = np.asarray(pair, dtype=np.float32)
    except (TypeError, ValueError):
        numbers = np.empty(0, dtype=np.float32)
    if numbers.shape != (2,) or not np.isfinite(numbers).all():
        raise ValueError(f"reward_pair must give two finite numbers, dominant and non-dominant, got {pair!r}.")
    return numbers
