"""A saved HemisphericPPO comes back whole and goes on learning."""

import numpy as np
import pytest
import torch

from bilateral_rl.algorithms import LOSSES, HemisphericPPO
from bilateral_rl.envs import ArmVecEnv
from bilateral_rl.policies import POLICY_ALIASES

SETTINGS = {
    "weight_penalty": 0.02, "reward_scale": 3.0, "gamma": 0.9, "gae_lambda": 0.8, "ent_coef": 0.01, "vf_coef": 0.3,
    "max_grad_norm": 0.7, "target_kl": 5.0, "n_steps": 20, "batch_size": 40, "n_epochs": 2,
    "normalize_advantage": False,
}  # fmt: skip


def arm(n_envs=4):
    return ArmVecEnv(n_envs, trial_length=7)


def observations():
    return np.random.default_rng(0).uniform(-1, 1, (16, 16)).astype(np.float32)


def assert_same_state(a, b):
    """Nested state dictionaries, bit for bit."""
    assert type(a) is type(b)
    if isinstance(a, dict):
        assert a.keys() == b.keys()
        for key in a:
            assert_same_state(a[key], b[key])
    elif isinstance(a, list):
        assert len(a) == len(b)
        for x, y in zip(a, b, strict=True):
            assert_same_state(x, y)
    elif isinstance(a, torch.Tensor):
        assert torch.equal(a, b)
    else:
        assert a == b


def saved(model, tmp_path):
    model.save(tmp_path / "model.zip")
    return tmp_path / "model.zip"


@pytest.mark.parametrize("policy", POLICY_ALIASES)
@pytest.mark.parametrize("loss", LOSSES)
def test_weights_hyperparameters_and_optimizer_come_back(tmp_path, make_model, policy, loss):
    model = make_model(policy, loss=loss, clip_range=0.3, clip_range_vf=0.4, **SETTINGS).learn(80)
    loaded = HemisphericPPO.load(saved(model, tmp_path), env=arm(), device="cpu")
    assert_same_state(loaded.policy.state_dict(), model.policy.state_dict())
    assert_same_state(loaded.policy.optimizer.state_dict(), model.policy.optimizer.state_dict())
    assert loaded.policy.optimizer.state_dict()["state"], "Adam's moments, not an optimizer that never stepped"
    assert loaded.loss == loss
    assert {name: getattr(loaded, name) for name in SETTINGS} == SETTINGS
    assert (loaded.clip_range(1.0), loaded.clip_range_vf(1.0)) == (0.3, 0.4)
    assert loaded.num_timesteps == 80
    assert loaded.policy.n_streams == (2 if loss == "specialized" else 1)


@pytest.mark.parametrize("loss", ["specialized", "combined"])
def test_a_loaded_model_goes_on_learning(tmp_path, make_model, loss):
    model = make_model(loss=loss).learn(80)
    loaded = HemisphericPPO.load(saved(model, tmp_path), env=arm(), device="cpu")
    loaded.learn(80, reset_num_timesteps=False)
    assert loaded.num_timesteps == 160
    before = model.policy.state_dict()
    assert all(not torch.equal(value, before[name]) for name, value in loaded.policy.state_dict().items())


def test_the_next_update_of_a_loaded_model_is_the_saved_ones(tmp_path, make_model, collect):
    """On the same rollout and in the same order: all that an update depends on has been saved."""
    model = collect(make_model().learn(80))
    loaded = HemisphericPPO.load(saved(model, tmp_path), env=arm(), device="cpu")
    collect(loaded)
    loaded.rollout = model.rollout
    loaded._current_progress_remaining = model._current_progress_remaining
    for each in (model, loaded):
        torch.manual_seed(5)
        each.train()
    assert_same_state(loaded.policy.state_dict(), model.policy.state_dict())


def test_a_model_loaded_without_an_environment_predicts(tmp_path, make_model):
    model = make_model().learn(80)
    loaded = HemisphericPPO.load(saved(model, tmp_path), device="cpu")
    assert loaded.env is None
    expected, _ = model.predict(observations(), deterministic=True)
    np.testing.assert_array_equal(loaded.predict(observations(), deterministic=True)[0], expected)
    loaded.set_env(arm())
    loaded.learn(80)


def test_a_model_loads_onto_another_number_of_arms(tmp_path, make_model):
    model = make_model().learn(80)
    loaded = HemisphericPPO.load(saved(model, tmp_path), env=arm(n_envs=2), device="cpu")
    loaded.learn(40)
    assert loaded.rollout.rewards.shape == (20, 2, 2)


def test_a_saved_model_does_not_hold_its_rollout(tmp_path, make_model):
    small, large = (saved(make_model(n_steps=n_steps), tmp_path).stat().st_size for n_steps in (20, 2000))
    assert abs(large - small) < 2000


def test_saving_twice_gives_the_same_weights(tmp_path, make_model):
    model = make_model().learn(80)
    first = HemisphericPPO.load(saved(model, tmp_path), device="cpu")
    second = HemisphericPPO.load(saved(first, tmp_path), device="cpu")
    assert_same_state(second.policy.state_dict(), model.policy.state_dict())
    assert_same_state(second.policy.optimizer.state_dict(), model.policy.optimizer.state_dict())
