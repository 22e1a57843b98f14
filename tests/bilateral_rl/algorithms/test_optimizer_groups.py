"""Critics with a learning rate of their own, and the network with an ε of its own, by every algorithm."""

import copy

import pytest
import torch
from hemispheric_models import (
    ALGORITHMS,
    OFF_POLICY,
    ON_POLICY,
    STOCK,
    assert_same_weights,
    collect,
    make_model,
    optimizers,
    update,
    weights,
)
from stable_baselines3.common.torch_layers import FlattenExtractor
from torch import nn

from bilateral_rl.algorithms import HemisphericA2C, HemisphericPPO, HemisphericSAC
from bilateral_rl.algorithms.schedules import linear_schedule
from bilateral_rl.policies import CallosalPolicy

each_algorithm = pytest.mark.parametrize("algorithm", ALGORITHMS)
each_on_policy = pytest.mark.parametrize("algorithm", ON_POLICY)
ADAM = {HemisphericA2C: {"use_rms_prop": False}}
ONE_STEP = {HemisphericPPO: {"batch_size": 80, "n_epochs": 1}}
USUAL_EPSILON = dict.fromkeys(ON_POLICY, 1e-5) | dict.fromkeys(OFF_POLICY, 1e-8)
"""SB3's, of Adam."""


def adam(algorithm, *policy, **arguments):
    return make_model(algorithm, *policy, **ADAM.get(algorithm, {}) | arguments)


def updated(algorithm, **arguments):
    """How far the first step moves each parameter, and the model."""
    model = adam(algorithm, **ONE_STEP.get(algorithm, {}), **arguments)
    before = weights(collect(model))
    update(model)
    moved = {name: value - before[name] for name, value in weights(model).items() if "target" not in name}
    return moved, model


def is_critics(name):
    return "critic" in name


def options(model, name, *, of_critics):
    """The values of an option of the optimizers, for the parameters of critics or for all others."""
    ids = {id(p) for group, ps in model.policy.parameter_groups().items() if group.startswith("critic") for p in ps}
    groups = [group for optimizer in optimizers(model)[:2] for group in optimizer.param_groups]
    return {group[name] for group in groups for p in group["params"] if (id(p) in ids) == of_critics}


@each_algorithm
def test_critics_learn_as_many_times_as_fast_and_the_network_as_before(algorithm):
    usual, _ = updated(algorithm)
    faster, model = updated(algorithm, critic_rate_factor=3.0)
    assert any(map(is_critics, usual))
    for name, step in usual.items():
        if is_critics(name):
            torch.testing.assert_close(faster[name], 3 * step, rtol=1e-3, atol=1e-7)
        elif algorithm in ON_POLICY:  # SAC's and TD3's network moves after their critics, along what these have become
            torch.testing.assert_close(faster[name], step, rtol=0, atol=0)
    assert options(model, "lr", of_critics=True) == {3 * model.learning_rate}
    assert options(model, "lr", of_critics=False) == {model.learning_rate}


@each_algorithm
def test_the_rate_of_critics_follows_the_schedule_however_often_it_is_set(algorithm):
    model = adam(algorithm, critic_rate_factor=3.0, learning_rate=linear_schedule(0.01, 0.0))
    collect(model)
    model._current_progress_remaining = 0.25
    for optimizer in optimizers(model):
        model._update_learning_rate(optimizer)
    assert options(model, "lr", of_critics=True) == {3 * 0.0025}
    assert options(model, "lr", of_critics=False) == {0.0025}


@each_algorithm
def test_a_large_epsilon_slows_the_network_by_its_gradient_and_nothing_else(algorithm):
    usual, _ = updated(algorithm)
    slower, _ = updated(algorithm, network_epsilon=100.0)
    gradient_is_below = 1.0  # then a first step of Adam is below learning rate · 1 / (1 + 100)
    for name, step in usual.items():
        if is_critics(name) or name == "log_ent_coef":
            torch.testing.assert_close(slower[name], step, rtol=0, atol=0)
        elif float(step.abs().max()) > 0:
            assert float(slower[name].abs().max()) < gradient_is_below / 100 * float(step.abs().max()) * 1.1, name


@each_algorithm
def test_a_saved_model_keeps_them_and_load_changes_them(algorithm, tmp_path):
    model = adam(algorithm, critic_rate_factor=3.0, network_epsilon=0.5)
    for _ in range(2):
        update(collect(model))
    model.save(tmp_path / "model")
    plain = {"critic_rate_factor": 1.0, "network_epsilon": None}
    for given, factor, epsilon in (
        ({}, 3.0, 0.5),
        ({"critic_rate_factor": 2.0, "network_epsilon": 0.25}, 2.0, 0.25),
        (plain, 1.0, USUAL_EPSILON[algorithm]),
    ):
        loaded = algorithm.load(tmp_path / "model", env=model.env, device="cpu", **given)
        assert_same_weights(loaded.policy, model.policy)
        update(collect(loaded))
        assert options(loaded, "eps", of_critics=False) == {epsilon}
        assert options(loaded, "eps", of_critics=True) == {USUAL_EPSILON[algorithm]}
        assert options(loaded, "lr", of_critics=True) == {factor * loaded.learning_rate}
    adam(algorithm).save(tmp_path / "plain")
    changed = algorithm.load(tmp_path / "plain", env=model.env, device="cpu", critic_rate_factor=2.0)
    update(collect(changed))
    assert options(changed, "lr", of_critics=True) == {2 * changed.learning_rate}


@each_algorithm
def test_as_attributes_they_count_from_the_next_learning_on(algorithm):
    model = adam(algorithm)
    collect(model)
    for epsilon, expected in ((0.5, 0.5), (0.25, 0.25), (None, USUAL_EPSILON[algorithm])):
        model.critic_rate_factor, model.network_epsilon = 2.0, epsilon
        update(collect(model))
        assert options(model, "eps", of_critics=False) == {expected}
        assert options(model, "lr", of_critics=True) == {2 * model.learning_rate}
    model.critic_rate_factor = -1.0
    with pytest.raises(ValueError, match="critic_rate_factor must be"):
        model.learn(80)


@each_on_policy
def test_models_with_critics_in_a_group_of_their_own_and_without_take_each_others_parameters(algorithm):
    """A factor of 1 makes the same steps in both, so that they go on alike."""
    plain = adam(algorithm, loss="combined")
    apart = adam(algorithm, loss="combined", network_epsilon=USUAL_EPSILON[algorithm])
    update(collect(plain))
    assert [len(model.policy.optimizer.param_groups) for model in (plain, apart)] == [1, 2]
    saved = copy.deepcopy(plain.get_parameters())
    apart.set_parameters(copy.deepcopy(saved))
    again = adam(algorithm, loss="combined")
    again.set_parameters(copy.deepcopy(apart.get_parameters()))
    STOCK[algorithm]("CallosalPolicy", plain.env, device="cpu", **ADAM.get(algorithm, {})).set_parameters(saved)
    for model in (plain, apart, again):
        model.set_random_seed(5)
        model._last_obs = None
        update(collect(model))
    assert_same_weights(plain.policy, apart.policy)
    assert_same_weights(plain.policy, again.policy)


class WithTwoGroups(CallosalPolicy):
    """A policy of a user's, whose biases do not decay, and with critics and network in both groups."""

    def _build(self, lr_schedule):
        super()._build(lr_schedule)
        parts = [[p for p in self.parameters() if (p.ndim < 2) == flat] for flat in (True, False)]
        groups = [{"params": part, "weight_decay": decay} for part, decay in zip(parts, (0.0, 0.1), strict=True)]
        self.optimizer = torch.optim.AdamW(groups, lr=lr_schedule(1))


@each_on_policy
def test_groups_of_ones_own_stay_and_are_parted_where_they_need_to_be(algorithm):
    assert len(make_model(algorithm, WithTwoGroups).policy.optimizer.param_groups) == 2
    model = make_model(algorithm, WithTwoGroups, critic_rate_factor=2.0, network_epsilon=0.1)
    update(collect(model))
    groups = model.policy.optimizer.param_groups
    assert sorted(group["weight_decay"] for group in groups) == [0.0, 0.0, 0.1, 0.1]
    assert options(model, "lr", of_critics=True) == {2 * model.learning_rate}
    assert options(model, "eps", of_critics=False) == {0.1}
    assert options(model, "eps", of_critics=True) == {1e-8}
    model.policy.optimizer = torch.optim.Adam(reversed(list(model.policy.parameters())))
    update(collect(model))
    assert options(model, "lr", of_critics=True) == {2 * model.learning_rate}
    assert options(model, "eps", of_critics=True) == {1e-8}


class Extractor(FlattenExtractor):
    """A features extractor with something to learn."""

    def __init__(self, observation_space):
        super().__init__(observation_space)
        self.gain = nn.Parameter(torch.ones(self.features_dim))

    def forward(self, observations):
        return super().forward(observations) * self.gain


@each_algorithm
@pytest.mark.parametrize("share", [True, False])
def test_features_extractors_learn_at_the_networks_rate(algorithm, share):
    extractor = {"features_extractor_class": Extractor, "share_features_extractor": share}
    model = adam(algorithm, critic_rate_factor=3.0, network_epsilon=0.1, policy_kwargs=extractor)
    update(collect(model))
    gains = {id(p) for name, p in model.policy.named_parameters() if name.endswith("gain") and "target" not in name}
    groups = [group for optimizer in optimizers(model) for group in optimizer.param_groups]
    found = {(group["lr"], group["eps"]) for group in groups if gains & {id(p) for p in group["params"]}}
    assert found == {(model.learning_rate, 0.1)}


@each_algorithm
def test_an_epsilon_that_could_have_no_effect_is_refused_at_once(algorithm):
    for optimizer, arguments in ((torch.optim.SGD, {}), (torch.optim.Adafactor, {})):
        kwargs = {"policy_kwargs": {"optimizer_class": optimizer, "optimizer_kwargs": arguments}}
        with pytest.raises(ValueError, match="network_epsilon has no effect on an optimizer without an ε"):
            adam(algorithm, network_epsilon=0.1, **kwargs)


def test_the_temperature_keeps_its_epsilon_and_its_rate():
    model = make_model(HemisphericSAC, critic_rate_factor=3.0, network_epsilon=0.1)
    update(collect(model))
    (group,) = model.ent_coef_optimizer.param_groups
    assert (group["eps"], group["lr"]) == (1e-8, model.learning_rate)
