"""Where an action changes what nobody observes, critics that see traces of the actions learn; others do not."""

import numpy as np
import pytest
import torch
from hidden_actuator import HiddenActuator
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.vec_env import DummyVecEnv

from bilateral_rl.algorithms import HemisphericSAC, HemisphericTD3

OWN = {
    HemisphericSAC: {"ent_coef": "auto_0.01"},
    HemisphericTD3: {"policy_delay": 1, "action_noise": NormalActionNoise(np.zeros(1), np.full(1, 0.2))},
}


def final_distance(algorithm, action_traces):
    """How far from the middle the point ends, after a training of seconds; it begins at 0.75."""
    model = algorithm(
        "BilateralPolicy",
        DummyVecEnv([HiddenActuator] * 8),
        action_traces=action_traces,
        actor_value="mean",
        weight_penalty=0.0,
        learning_rate=3e-3,
        learning_starts=800,
        batch_size=128,
        gradient_steps=2,
        gamma=0.95,
        tau=0.02,
        policy_kwargs={"critic_arch": (32, 32)},
        seed=0,
        device="cpu",
        **OWN[algorithm],
    ).learn(6000, log_interval=10**9)
    env = DummyVecEnv([HiddenActuator] * 16)
    env.seed(100)
    observations = env.reset()
    for _ in range(HiddenActuator.LENGTH - 1):
        observations, *_ = env.step(model.predict(observations, deterministic=True)[0])
    return np.abs(observations[:, 0]).mean()


@pytest.mark.parametrize("algorithm", [HemisphericTD3, pytest.param(HemisphericSAC, marks=pytest.mark.slow)])
def test_with_traces_the_point_is_brought_to_the_middle_and_without_it_is_not(algorithm):
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        assert final_distance(algorithm, (0.5, 0.8)) < 0.25
        assert final_distance(algorithm, ()) > 0.3
    finally:
        torch.set_num_threads(threads)
