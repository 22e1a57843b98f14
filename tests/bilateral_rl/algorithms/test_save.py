"""A saved hemispheric model comes back whole and goes on learning."""

import copy

import numpy as np
import pytest
import torch
from hemispheric_models import (
    ALGORITHMS,
    OFF_POLICY,
    ROLLOUT,
    arm,
    changed,
    collect,
    make_model,
    optimizers,
    update,
    weights,
)

from bilateral_rl.algorithms import HemisphericA2C, HemisphericPPO, HemisphericSAC, HemisphericTD3

COMMON = {"weight_penalty": 0.02, "penalty_weights": (0.5, 1.0), "reward_scale": 3.0, "gamma": 0.9}
ON = {"gae_lambda": 0.8, "ent_coef": 0.01, "vf_coef": 0.3, "max_grad_norm": 0.7, "n_steps": 20}
OFF = {"tau": 0.1, "gradient_steps": 2, "learning_starts": 30, "batch_size": 30, "buffer_size": 300}
SETTINGS = {
    HemisphericPPO: COMMON | ON | {"target_kl": 5.0, "normalize_advantage": False, "n_epochs": 2},
    HemisphericA2C: COMMON | ON | {"normalize_advantage": True},
    HemisphericSAC: COMMON
    | OFF
    | {"ent_coef": "auto_0.3", "target_entropy": -2.5, "target_update_interval": 2, "policy_delay": 2},
    HemisphericTD3: COMMON | OFF | {"policy_delay": 2, "target_policy_noise": 0.3, "target_noise_clip": 0.4},
}

pytestmark = pytest.mark.parametrize("algorithm", ALGORITHMS)


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


def assert_same_models(a, b):
    """Weights, targets, temperature and what the optimizers remember."""
    assert_same_state(weights(a), weights(b))
    for one, other in zip(optimizers(a), optimizers(b), strict=True):
        assert_same_state(one.state_dict(), other.state_dict())


def saved(model, tmp_path):
    model.save(tmp_path / "model.zip")
    return tmp_path / "model.zip"


def give_experience(model, other):
    """Lets ``other`` learn from what ``model`` has collected."""
    if type(model) in OFF_POLICY:
        other.replay_buffer = model.replay_buffer
    else:
        other.rollout_buffer = model.rollout_buffer
    other._current_progress_remaining = model._current_progress_remaining


def assert_the_next_updates_are_the_same(model, other):
    """On the same experience and from the same random state: all that an update depends on is the same."""
    give_experience(model, other)
    for each in (model, other):
        each.set_random_seed(5)
        update(update(each))
    assert_same_models(other, model)


@pytest.mark.parametrize(
    ("policy", "loss"),
    [("UnilateralPolicy", "dominant"), ("CallosalPolicy", "specialized")],
)
def test_weights_hyperparameters_and_optimizers_come_back(tmp_path, algorithm, policy, loss):
    settings = SETTINGS[algorithm]
    model = make_model(algorithm, policy, loss=loss, **settings).learn(ROLLOUT)
    loaded = algorithm.load(saved(model, tmp_path), env=arm(), device="cpu")
    assert_same_models(loaded, model)
    assert_same_models(algorithm.load(saved(loaded, tmp_path), device="cpu"), model)
    assert all(optimizer.state_dict()["state"] for optimizer in optimizers(loaded)), "they had stepped"
    assert loaded.loss == loss
    assert {name: getattr(loaded, name) for name in settings} == settings
    assert loaded.num_timesteps == ROLLOUT
    assert loaded.policy.n_streams == (2 if loss == "specialized" else 1)


def test_a_loaded_model_goes_on_learning(tmp_path, algorithm):
    model = make_model(algorithm).learn(ROLLOUT)
    loaded = algorithm.load(saved(model, tmp_path), env=arm(), device="cpu")
    before = weights(loaded)
    loaded.learn(ROLLOUT, reset_num_timesteps=False)
    assert loaded.num_timesteps == 2 * ROLLOUT
    assert len(changed(loaded, before)) == len(before)


def test_the_next_updates_of_a_loaded_model_are_the_saved_ones(tmp_path, algorithm):
    model = make_model(algorithm, **SETTINGS[algorithm]).learn(ROLLOUT)
    loaded = collect(algorithm.load(saved(model, tmp_path), env=arm(), device="cpu"))
    assert_the_next_updates_are_the_same(model, loaded)


@pytest.mark.parametrize("form", ["parameters", "file"])
def test_parameters_set_into_another_model_make_it_the_same(tmp_path, algorithm, form):
    model = make_model(algorithm, **SETTINGS[algorithm]).learn(ROLLOUT)
    other = collect(make_model(algorithm, seed=1, **SETTINGS[algorithm]))
    # Optimizers would share the moments that they are given.
    parameters = saved(model, tmp_path) if form == "file" else copy.deepcopy(model.get_parameters())
    other.set_parameters(parameters, device="cpu")
    other._n_updates = model._n_updates
    if algorithm is HemisphericSAC:  # SB3 keeps it beside the parameters
        other.log_ent_coef.data.copy_(model.log_ent_coef)
    assert_the_next_updates_are_the_same(model, other)


def test_a_model_loaded_without_an_environment_predicts(tmp_path, algorithm):
    model = make_model(algorithm).learn(ROLLOUT)
    loaded = algorithm.load(saved(model, tmp_path), device="cpu")
    assert loaded.env is None
    expected, _ = model.predict(observations(), deterministic=True)
    np.testing.assert_array_equal(loaded.predict(observations(), deterministic=True)[0], expected)
    loaded.set_env(arm())
    loaded.learn(ROLLOUT, reset_num_timesteps=False)
    assert loaded.num_timesteps == 2 * ROLLOUT


def test_a_model_loads_onto_another_number_of_arms(tmp_path, algorithm):
    model = make_model(algorithm).learn(ROLLOUT)
    loaded = algorithm.load(saved(model, tmp_path), env=arm(n_envs=2), device="cpu")
    loaded.learn(ROLLOUT // 2)
    rewards = loaded.replay_buffer.rewards if algorithm in OFF_POLICY else loaded.rollout_buffer.rewards
    assert rewards.shape[1:] == (2, 2)


def test_a_saved_model_does_not_hold_its_experience(tmp_path, algorithm):
    name = "buffer_size" if algorithm in OFF_POLICY else "n_steps"
    small, large = (saved(make_model(algorithm, **{name: n}), tmp_path).stat().st_size for n in (80, 8000))
    assert abs(large - small) < 2000


def test_another_loss_than_the_saved_one_is_refused(tmp_path, algorithm):
    path = saved(make_model(algorithm, loss="combined"), tmp_path)
    with pytest.raises(
        ValueError, match=r"n_streams of the buffer follows .* a saved model keeps its traces and its loss"
    ):
        algorithm.load(path, loss="specialized", device="cpu")


@pytest.mark.parametrize("exact", [True, False])
def test_parameters_that_do_not_fit_leave_the_model_as_it_was(tmp_path, algorithm, exact):
    path = saved(make_model(algorithm, loss="combined", seed=1).learn(ROLLOUT), tmp_path)
    model = make_model(algorithm).learn(ROLLOUT)
    before = copy.deepcopy(model.get_parameters())
    with pytest.raises((RuntimeError, ValueError)):
        model.set_parameters(path, exact_match=exact)
    assert_same_state(model.get_parameters(), before)


def test_a_model_of_another_algorithm_is_refused(tmp_path, algorithm):
    path = saved(make_model(algorithm), tmp_path)
    its_name = algorithm.__name__.removeprefix("Hemispheric")
    for other in ALGORITHMS:
        if other is not algorithm:
            with pytest.raises(ValueError, match=rf"{other.__name__} loads models of \w+, and .* by {its_name}\."):
                other.load(path)
    with path.open("rb") as file:  # is where it was, once it has been looked at
        assert isinstance(algorithm.load(file), algorithm)
    assert isinstance(algorithm.load(tmp_path / "model"), algorithm)
