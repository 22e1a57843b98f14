"""Numbers that are not finite stop every algorithm at their step, with the true reason."""

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium import spaces
from hemispheric_models import ALGORITHMS, make_model
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import DummyVecEnv

from bilateral_rl.algorithms.finite import DivergedError

pytestmark = [
    pytest.mark.filterwarnings("ignore:You have specified a mini-batch size"),
    pytest.mark.parametrize("algorithm", ALGORITHMS),
]
AT = 31
"""The step of the second environment at which something is wrong."""


class Faulty(gymnasium.Env):
    """Episodes of four steps, cut by a time limit; ``spoil`` may change what step ``AT`` returns."""

    observation_space, action_space = spaces.Box(-1.0, 1.0, (3,)), spaces.Box(-1.0, 1.0, (2,))

    def __init__(self, spoil=lambda *step: step, spoils_reset=False):
        self.spoil, self.steps, self.spoils_reset = spoil, 0, spoils_reset

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        observation = self.np_random.uniform(-1, 1, 3).astype(np.float32)
        return observation * (np.nan if self.spoils_reset else 1), {}

    def step(self, action):
        self.steps += 1
        pair = self.np_random.normal(size=2)
        step = self.np_random.uniform(-1, 1, 3).astype(np.float32), float(pair.mean()), pair
        observation, reward, pair = self.spoil(*step) if self.steps == AT else step
        return observation, reward, False, self.steps % 4 == 0, {"vector_reward": pair}


NAN, INF = np.nan, np.inf
PAIR = r"info\['vector_reward'\] of environment 1 must be two finite numbers, dominant and non-dominant, got "
AT_62 = " at step 62: "
SPOILED = {
    "a pair that is not a number": (lambda o, r, p: (o, r, np.array([NAN, 0])), PAIR + r"array\(\[nan,"),
    "an infinite pair": (lambda o, r, p: (o, INF, np.array([INF, 1])), PAIR + r"array\(\[inf,"),
    "a pair of three": (lambda o, r, p: (o, r, np.zeros(3)), PAIR),
    "a pair of one": (lambda o, r, p: (o, r, 1.0), PAIR + "1.0"),
    "a pair of words": (lambda o, r, p: (o, r, ("1", "2")), PAIR + r"\('1', '2'\)"),
    "no pair": (lambda o, r, p: (o, r, None), "a pair of rewards is needed.*of environment 1"),
    "a reward that is not a number": (lambda o, r, p: (o, NAN, p), "environment 1 gave the reward nan" + AT_62),
    "an infinite observation": (
        lambda o, r, p: (o + np.array([0, INF, 0]), r, p),
        "environment 1 gave an observation that is not finite" + AT_62 + "its number 1 is inf",
    ),
}
"""What may be wrong at step ``AT``, with why it is refused."""


@pytest.mark.parametrize(("spoil", "reason"), SPOILED.values(), ids=SPOILED)
def test_what_one_environment_gives_at_one_step(algorithm, spoil, reason):
    for loss in ("specialized", "combined"):
        model = make_model(algorithm, env=DummyVecEnv([Faulty, lambda: Faulty(spoil)]), loss=loss)
        with pytest.raises(ValueError, match=reason):
            model.learn(400)
        assert model.num_timesteps == 2 * AT
        assert all(parameter.isfinite().all() for parameter in model.policy.parameters())


def test_the_last_observation_of_an_episode(algorithm):
    class Late(Faulty):
        def step(self, action):
            observation, *rest = super().step(action)
            return observation * (NAN if self.steps == 32 else 1), *rest

    model = make_model(algorithm, env=DummyVecEnv([Faulty, Late]))
    with pytest.raises(ValueError, match="environment 1 gave an observation that is not finite at step 64"):
        model.learn(400)


def test_the_first_observation(algorithm):
    model = make_model(algorithm, env=DummyVecEnv([Faulty, lambda: Faulty(spoils_reset=True)]))
    with pytest.raises(ValueError, match="environment 1 gave an observation that is not finite at step 0"):
        model.learn(400)


def test_a_policy_that_diverges_in_its_last_update(algorithm):
    def rate(remaining):
        return 1e-3 if remaining == 1 else float("nan")

    model = make_model(algorithm, learning_rate=rate)
    with pytest.raises(DivergedError, match=r"diverged after (80|48) steps: its parameters are no longer finite"):
        model.learn(80)


class Poison(BaseCallback):
    """Makes one parameter not finite at step 60, or all of them too large."""

    def __init__(self, value):
        super().__init__()
        self.value = value

    def _on_step(self):
        if self.num_timesteps == 60:
            with torch.no_grad():
                self.model.policy.motor_network.output.bias[0] = self.value
        return True


def test_a_policy_that_is_spoiled_while_it_acts(algorithm):
    model = make_model(algorithm)
    with pytest.raises(DivergedError, match="the policy diverged after 60 steps: its parameters are no longer finite"):
        model.learn(400, callback=Poison(NAN))
    with pytest.raises(DivergedError, match="the policy diverged after 0 steps"):
        model.learn(400)
