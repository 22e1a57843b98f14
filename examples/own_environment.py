"""Two rewards for an environment that you wrote yourself: a puck that glides to a target in the plane."""

import gymnasium
import numpy as np
from gymnasium import spaces
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy

from bilateral_rl.algorithms import HemisphericPPO
from bilateral_rl.envs import VectorReward

STEPS = 4_000  # with 200,000 the intact network's return rises from about -16 to -11


class Puck(gymnasium.Env):
    """Push a puck of 1 kg by two forces, each up to 1 N, so that it comes to rest at the origin.

    Any environment will do whose actions are a bounded ``Box``. Observations: position (m) and velocity (m/s).
    """

    observation_space = spaces.Box(-np.inf, np.inf, (4,), np.float32)
    action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)

    def reset(self, *, seed=None, options=None):
        """Put the puck somewhere, at rest."""
        super().reset(seed=seed)
        self.position = self.np_random.uniform(-1, 1, 2)
        self.velocity = np.zeros(2)
        return self.observe(), {}

    def step(self, action):
        """Move on by 0.1 s; the reward is left to VectorReward, and the end to a limit of 50 steps."""
        self.velocity = 0.95 * self.velocity + 0.1 * np.clip(action, -1, 1)
        self.position = self.position + 0.1 * self.velocity
        return self.observe(), 0.0, False, False, {}

    def observe(self):
        """Position and velocity."""
        return np.concatenate([self.position, self.velocity]).astype(np.float32)


def reward_pair(step):
    """Quickly there for the dominant side; at rest and with little force for the non-dominant one."""
    x, y, vx, vy = step.next_observation
    effort = 0.1 * float(np.square(step.action).sum())
    return -float(np.hypot(x, y)), -float(np.hypot(vx, vy)) - effort


def make_puck():
    """VectorReward goes around the limit, so that it sees episodes end."""
    return VectorReward(gymnasium.wrappers.TimeLimit(Puck(), max_episode_steps=50), reward_pair)


env = make_vec_env(make_puck, n_envs=8, seed=0)
model = HemisphericPPO("CallosalPolicy", env, n_steps=50, batch_size=100, gamma=0.95, device="cpu", seed=0)
model.learn(STEPS)

test_env = make_vec_env(make_puck, n_envs=8, seed=1)
for lesion in ("intact", "deep_dominant", "deep_non_dominant", "callosum"):
    with model.policy.motor_network.lesioned(lesion):
        mean, _ = evaluate_policy(model, test_env, n_eval_episodes=16)
    print(f"{lesion:20} return {mean:.1f}")
