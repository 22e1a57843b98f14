"""Logs of the hemispheric algorithms: returns, combination weights and losses, by stream."""

import numpy as np
import pytest
from hemispheric_models import (
    ALGORITHMS,
    OFF_POLICY,
    Recorder,
    arm,
    learn_logged,
    make_model,
)
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

from bilateral_rl.algorithms import HemisphericTD3
from bilateral_rl.envs import ArmEnv
from bilateral_rl.vocabulary import SIDES


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_the_logged_returns_are_the_trials_and_unscaled(algorithm):
    env = Recorder(arm())
    logged = learn_logged(make_model(algorithm, env=env, reward_scale=100.0), timesteps=140)
    ended = [info["vector_return"] for step in env.steps for info in step[3] if "vector_return" in info]
    assert len(ended) >= 20
    for stream, side in enumerate(SIDES):
        assert logged[f"return/{side}"][-1] == pytest.approx(np.mean([pair[stream] for pair in ended]), rel=1e-5)
    assert {"rollout/ep_rew_mean", "rollout/success_rate"} <= set(logged)


@pytest.mark.filterwarnings("ignore:The environment is already wrapped with a `Monitor`")
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_the_streams_returns_are_logged_on_any_environment(algorithm):
    expected = learn_logged(make_model(algorithm), timesteps=100)
    for env in (DummyVecEnv([lambda: Monitor(ArmEnv(trial_length=7))] * 4), VecMonitor(arm())):
        logged = learn_logged(make_model(algorithm, env=env), timesteps=100)
        for side in SIDES:
            assert len(expected[f"return/{side}"]) > 1
            np.testing.assert_allclose(logged[f"return/{side}"], expected[f"return/{side}"], rtol=1e-6)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_the_logged_combination_weights_are_the_networks(algorithm):
    model = make_model(algorithm, learning_rate=1e-2)
    capture = learn_logged(model, timesteps=160)
    assert capture["combination/dominant"][0] != 0.5
    model.logger.dump()
    network = model.policy.motor_network
    assert {side: capture[f"combination/{side}"][-1] for side in SIDES} == network.combination_weights()


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("loss", ["specialized", "dominant"])
def test_losses_are_logged_under_their_streams_names(algorithm, loss):
    logged = learn_logged(make_model(algorithm, "UnilateralPolicy", loss=loss))
    streams = set(SIDES) if loss == "specialized" else {loss}
    off_policy = algorithm in OFF_POLICY
    for quantity in ("actor_loss", "critic_loss", "value") if off_policy else ("policy_loss", "value_loss"):
        names = {name for name in logged if name.startswith(f"{quantity}/")}
        assert names == {f"{quantity}/{stream}" for stream in streams}
        assert all(np.isfinite(logged[name]).all() for name in names)
    assert {f"return/{side}" for side in SIDES} <= set(logged), "what a trial brought is logged for any loss"
    assert {"train/learning_rate", "train/n_updates"} <= set(logged)
    assert ("train/entropy" in logged) == (algorithm is not HemisphericTD3)
    assert not any(name.startswith("combination/") for name in logged), "one side has nothing to combine"
