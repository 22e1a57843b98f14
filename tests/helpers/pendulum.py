"""Somebody's own environment: Gymnasium's Pendulum-v1 with a reward for each hemisphere."""

import gymnasium
import numpy as np

from bilateral_rl.envs import VectorReward


def reward_pair(transition):
    """The angle for the dominant side, speed and torque for the other; their mean is the pendulum's own reward."""
    cos, sin, speed = transition.observation
    return -2 * np.arctan2(sin, cos) ** 2, -0.2 * speed**2 - 0.002 * transition.action[0] ** 2


def reward_pairs(transitions):
    """The same for many pendulums at once."""
    cos, sin, speed = transitions.observation.T
    return -2 * np.arctan2(sin, cos) ** 2, -0.2 * speed**2 - 0.002 * transitions.action[:, 0] ** 2


def make_pendulum(**settings):
    return VectorReward(gymnasium.make("Pendulum-v1", **settings), reward_pair)
