"""Two rewards for an environment of Gymnasium's: the pendulum's angle for one hemisphere, its effort for the other."""

import gymnasium
import numpy as np

from bilateral_rl.algorithms import HemisphericSAC
from bilateral_rl.envs import VectorReward

STEPS = 400  # enlarge to 8,000, with four pendulums and 32 units, to see it swing up


def reward_pair(step):
    """The dominant and the non-dominant reward of a step; their mean is what the pendulum itself rewards.

    A step has ``observation``, ``action``, ``next_observation``, and the environment's own ``reward`` and ``info``.
    """
    cos, sin, speed = step.observation
    angle = np.arctan2(sin, cos)
    return -2 * angle**2, -0.2 * speed**2 - 0.002 * step.action[0] ** 2


env = VectorReward(gymnasium.make("Pendulum-v1"), reward_pair)
model = HemisphericSAC("CallosalPolicy", env, learning_rate=3e-3, gamma=0.98, weight_penalty=0.0, device="cpu")
model.learn(STEPS)

observation, _ = env.reset(seed=0)
for _ in range(200):
    action, _ = model.predict(observation, deterministic=True)
    observation, reward, terminated, truncated, info = env.step(action)
print("returns of the last episode, dominant and non-dominant:", info["vector_return"])
