"""A point on a line whose actuator is hidden: what an action does shows three steps later, what it costs at once."""

import gymnasium
import numpy as np
from gymnasium import spaces


class HiddenActuator(gymnasium.Env):
    """Push a point to the middle of a line, by an activation that follows the action and that nobody observes.

    The activation takes a step towards the action, moves the velocity two steps later, and that the position a step
    after. Observed are position and velocity. Dominant reward: distance and effort; non-dominant: distance.
    """

    observation_space = spaces.Box(-np.inf, np.inf, (2,))
    action_space = spaces.Box(-1.0, 1.0, (1,))
    LENGTH = 30

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.position, self.velocity = float(self.np_random.choice([-1.0, 1.0]) * self.np_random.uniform(0.5, 1)), 0.0
        self.activation, self.steps = [0.0, 0.0, 0.0], 0
        return self._observation(), {}

    def step(self, action):
        now = self.activation[-1] + 0.4 * (float(action[0]) - self.activation[-1])
        self.position += 0.3 * self.velocity
        self.velocity += 0.3 * self.activation[0] - 0.3 * self.velocity
        self.activation = [*self.activation[1:], now]
        self.steps += 1
        distance = abs(self.position)
        pair = np.array([-distance - 0.3 * float(action[0]) ** 2, -distance])
        return self._observation(), pair.mean(), False, self.steps == self.LENGTH, {"vector_reward": pair}

    def _observation(self):
        return np.array([self.position, self.velocity], dtype=np.float32)
