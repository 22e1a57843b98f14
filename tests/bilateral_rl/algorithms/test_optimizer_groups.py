"""Critics with a learning rate of their own, and the network with an ε of its own, by every algorithm."""

import copy

import pytest
import torch
from hemispheric_models import ALGORITHMS, ON_POLICY, assert_same_weights, collect, make_model, update, weights

from bilateral_rl.algorithms import HemisphericA2C, HemisphericPPO, HemisphericSAC

each_algorithm = pytest.mark.parametrize("algorithm", ALGORITHMS)
ADAM = {HemisphericA2C: {"use_rms_prop": False}}
ONE_STEP = {HemisphericPPO: {"batch_size": 80, "n_epochs": 1}}


def updated(algorithm, **arguments):
    """How far an update of one step moves each parameter, from a model that has made one already; and the model."""
    model = make_model(algorithm, **ADAM.get(algorithm, {}), **ONE_STEP.get(algorithm, {}), **arguments)
    before = weights(collect(model))
    update(model)
    moved = {name: value - before[name] for name, value in weights(model).items() if "target" not in name}
    return moved, model


def of_critics(names):
    return {name for name in names if "critic" in name or name.startswith("critic")}


@each_algorithm
def test_critics_learn_as_many_times_as_fast_and_the_network_as_before(algorithm):
    usual, _ = updated(algorithm)
    faster, model = updated(algorithm, critic_rate_factor=3.0)
    critics = of_critics(usual)
    assert critics
    for name, step in usual.items():
        # SAC's and TD3's network moves after their critics, and along what these have become.
        if name in critics:
            torch.testing.assert_close(faster[name], 3 * step, rtol=1e-3, atol=1e-7)
        elif algorithm in ON_POLICY:
            torch.testing.assert_close(faster[name], step, rtol=0, atol=0)
        else:
            assert float(faster[name].abs().max()) < 2 * model.learning_rate
    rates = {group["lr"] for group in model._optimized()[1]}
    assert rates == {3 * model.learning_rate}


@each_algorithm
def test_a_large_epsilon_slows_the_network_by_its_gradient_and_nothing_else(algorithm):
    usual, _ = updated(algorithm)
    slower, _ = updated(algorithm, network_epsilon=100.0)
    gradient_is_below = 1.0  # then a first step of Adam is below learning rate · 1 / (1 + 100)
    for name, step in usual.items():
        if name in of_critics(usual) or name == "log_ent_coef":
            torch.testing.assert_close(slower[name], step, rtol=0, atol=0)
        elif float(step.abs().max()) > 0:
            assert float(slower[name].abs().max()) < gradient_is_below / 100 * float(step.abs().max()) * 1.1, name


@each_algorithm
def test_a_saved_model_keeps_them_and_load_changes_them(algorithm, tmp_path):
    arguments = {**ADAM.get(algorithm, {}), "critic_rate_factor": 3.0, "network_epsilon": 0.5}
    model = make_model(algorithm, **arguments)
    update(collect(model))
    model.save(tmp_path / "model")
    for given, factor, epsilon in (
        ({}, 3.0, 0.5),
        ({"critic_rate_factor": 2.0, "network_epsilon": 0.25}, 2.0, 0.25),
        ({"network_epsilon": None}, 3.0, model._optimized()[0][0]["usual_eps"]),
    ):
        loaded = algorithm.load(tmp_path / "model", env=model.env, device="cpu", **given)
        update(collect(loaded))
        network, critics = loaded._optimized()
        assert {group["eps"] for group in network} == {epsilon}
        assert {group["lr"] for group in critics} == {factor * loaded.learning_rate}


@pytest.mark.parametrize("algorithm", ON_POLICY)
def test_a_model_from_before_critics_had_a_group_of_their_own_goes_on_as_it_would_have(algorithm, tmp_path):
    model = make_model(algorithm, **ADAM.get(algorithm, {}))
    update(collect(model))
    saved = copy.deepcopy(model.get_parameters())
    network, critics = saved["policy.optimizer"]["param_groups"]
    saved["policy.optimizer"]["param_groups"] = [{**network, "params": network["params"] + critics["params"]}]
    other = make_model(algorithm, **ADAM.get(algorithm, {}))
    other.set_parameters(saved)
    for each in (model, other):
        each.set_random_seed(5)
        each.env.seed(5)
        each._last_obs = None
        update(collect(each))
    assert_same_weights(model.policy, other.policy)


@each_algorithm
def test_what_could_have_no_effect_is_refused(algorithm):
    arguments = {"use_rms_prop": False} if algorithm is HemisphericA2C else {}
    sgd = {"policy_kwargs": {"optimizer_class": torch.optim.SGD, "optimizer_kwargs": {}}}
    with pytest.raises(ValueError, match="network_epsilon has no effect on an optimizer without an ε"):
        update(collect(make_model(algorithm, network_epsilon=0.1, **arguments, **sgd)))
    if algorithm in ON_POLICY:
        model = make_model(algorithm, critic_rate_factor=2.0, **arguments)
        model.policy.optimizer = torch.optim.Adam(model.policy.parameters())
        with pytest.raises(ValueError, match="needs an optimizer in which critics have a parameter group of their own"):
            update(collect(model))


def test_the_temperature_keeps_its_epsilon_and_its_rate():
    model = make_model(HemisphericSAC, critic_rate_factor=3.0, network_epsilon=0.1)
    update(collect(model))
    (group,) = model.ent_coef_optimizer.param_groups
    assert (group["eps"], group["lr"]) == (1e-8, model.learning_rate)
