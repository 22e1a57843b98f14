"""Any hemispheric algorithm on any kind of environment: batched, one by one, wrapped."""

import numpy as np
import pytest
import torch
from hemispheric_models import ALGORITHMS, OFF_POLICY, arm, make_model, weights
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from bilateral_rl.envs import ArmEnv

pytestmark = pytest.mark.parametrize("algorithm", ALGORITHMS)


def normalized(env):
    return VecNormalize(env, norm_reward=False, clip_obs=0.5)


def test_ordinary_environments_train_to_the_same_weights(algorithm):
    """DummyVecEnv of ArmEnv, whose reward pairs come by info, and ArmVecEnv, on the same seeds."""
    ordinary = DummyVecEnv([lambda: Monitor(ArmEnv(trial_length=7)) for _ in range(4)])
    a, b = (weights(make_model(algorithm, env=env).learn(160)) for env in (ordinary, arm()))
    assert all(torch.equal(value, b[name]) for name, value in a.items())


def test_normalized_observations_are_what_the_networks_see(algorithm):
    env = normalized(arm())
    model = make_model(algorithm, env=env).learn(160)
    seen = []
    model.policy.motor_network.register_forward_pre_hook(lambda _, inputs: seen.append(inputs[0]))
    model.train(*([1, 30] if type(model) in OFF_POLICY else []))
    assert all(observations.abs().max() <= 0.5 for observations in seen)
    assert any(observations.abs().max() == 0.5 for observations in seen)
    raw = env.get_original_obs()
    assert np.abs(raw).max() > 0.5
    if type(model) in OFF_POLICY:
        assert np.abs(model.replay_buffer.observations).max() > 0.5, "kept as they were, normalized when sampled"
