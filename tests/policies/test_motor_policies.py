"""The networks as policies, whichever algorithm they are for: actions, groups, sizes, save and load."""

import copy
import itertools

import numpy as np
import pytest
import torch
from gymnasium import spaces
from hemispheric_models import LearnedFeatures, assert_same_weights

from bilateral_rl.policies import (
    ARCHITECTURES,
    POLICY_ALIASES,
    SAC_ALIASES,
    TD3_ALIASES,
    BilateralActorCriticPolicy,
    BilateralSACPolicy,
    BilateralTD3Policy,
)
from bilateral_rl.vocabulary import SIDES

OBSERVATIONS = spaces.Box(-1.0, 1.0, (16,))
MUSCLES = spaces.Box(-1.0, 1.0, (6,))
ALIASES = {
    BilateralActorCriticPolicy: POLICY_ALIASES,
    BilateralSACPolicy: SAC_ALIASES,
    BilateralTD3Policy: TD3_ALIASES,
}

kinds = pytest.mark.parametrize("kind", ALIASES)


def make_policy(kind, observations=OBSERVATIONS, actions=MUSCLES, **kwargs):
    return kind(observations, actions, lambda _: 1e-3, **({"architecture": "callosal"} | kwargs))


def observations(n=32, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, (n, 16)).astype(np.float32)


def deterministic_action(policy):
    return policy.predict(observations(), deterministic=True)[0]


def excitation(policy):
    with torch.no_grad():
        return policy.motor_network.excitation(torch.from_numpy(observations())).numpy()


def trained_parameters(policy):
    return [p for name, p in policy.named_parameters() if "_target" not in name]


def assert_each_parameter_in_one_group(policy):
    grouped = [id(parameter) for group in policy.parameter_groups().values() for parameter in group]
    assert sorted(grouped) == sorted(map(id, trained_parameters(policy)))


@kinds
def test_each_alias_has_its_architecture_and_the_class_any(kind):
    for name, policy_class in ALIASES[kind].items():
        policy = policy_class(OBSERVATIONS, MUSCLES, lambda _: 1e-3)
        assert name == f"{policy.motor_network.architecture.capitalize()}Policy"
    for architecture in ARCHITECTURES:
        assert make_policy(kind, architecture=architecture).motor_network.architecture == architecture


@kinds
def test_the_deterministic_action_is_the_networks_sigmoid_output(kind):
    for architecture in ARCHITECTURES:
        policy = make_policy(kind, architecture=architecture)
        np.testing.assert_allclose(deterministic_action(policy), 2 * excitation(policy) - 1, rtol=0, atol=1e-6)


@kinds
def test_actions_are_rescaled_to_any_bounded_box(kind):
    low, high = np.float32([-1, 0, 2, -5, 0, -1]), np.float32([2, 5, 3, -4, 1, 1])
    wide = {} if kind is BilateralTD3Policy else {"log_std_init": 1.0}
    policy = make_policy(kind, actions=spaces.Box(low, high), **wide)
    expected = low + excitation(policy) * (high - low)
    np.testing.assert_allclose(deterministic_action(policy), expected, rtol=0, atol=3e-6)
    sampled, _ = policy.predict(observations(500), deterministic=False)
    assert (low <= sampled).all()
    assert (sampled <= high).all()
    fills_the_box = ((sampled.max(axis=0) - sampled.min(axis=0)) > 0.8 * (high - low)).all()
    assert fills_the_box == (kind is not BilateralTD3Policy), "TD3's exploration is not the policy's"


@kinds
def test_action_spaces_other_than_a_bounded_box_are_refused(kind):
    half_bounded = spaces.Box(np.zeros(2, np.float32), np.array([1.0, np.inf], np.float32))
    for space in (spaces.Discrete(3), spaces.Box(-np.inf, np.inf, (6,)), half_bounded):
        with pytest.raises(ValueError, match="bounded Box, not"):
            make_policy(kind, actions=space)


@kinds
def test_state_dependent_exploration_is_refused(kind):
    with pytest.raises(ValueError, match="use_sde"):
        make_policy(kind, use_sde=True)


@kinds
def test_an_architecture_or_a_size_that_does_not_exist_is_refused(kind):
    with pytest.raises(ValueError, match="unknown architecture 'trilateral'"):
        make_policy(kind, architecture="trilateral")
    with pytest.raises(ValueError, match="7 is odd"):
        make_policy(kind, units=7)


@kinds
def test_policy_save_and_load_rebuild_the_same_policy(tmp_path, kind):
    sizes = {"units": 12, "layers": 3, "critic_arch": (8,), "n_streams": 2, "log_std_init": -0.5}
    if kind is not BilateralActorCriticPolicy:
        sizes["n_critics"] = 3
    for architecture in ARCHITECTURES:
        policy = make_policy(kind, architecture=architecture, **sizes)
        policy.save(tmp_path / "policy.pth")
        loaded = kind.load(tmp_path / "policy.pth", device="cpu")
        assert_same_weights(loaded, policy)
        network = loaded.motor_network
        assert (network.architecture, network.units, network.layers) == (architecture, 12, 3)
        assert {name: len(group) for name, group in loaded.parameter_groups().items()} == {
            name: len(group) for name, group in policy.parameter_groups().items()
        }
        np.testing.assert_array_equal(deterministic_action(loaded), deterministic_action(policy))


def network_optimizer(policy):
    return policy.optimizer if isinstance(policy, BilateralActorCriticPolicy) else policy.actor.optimizer


def push_below_zero(policy):
    """One step of the network's optimizer whose gradient drives both combination weights far below zero."""
    optimizer = network_optimizer(policy)
    optimizer.zero_grad()
    for side in SIDES:
        getattr(policy.motor_network, f"combination_{side}").grad = torch.tensor(1.0)
    for group in optimizer.param_groups:
        group["lr"] = 10.0
    optimizer.step()
    return policy.motor_network.combination_weights()


@kinds
def test_copied_and_loaded_policies_keep_their_combination_weights_non_negative(tmp_path, kind):
    policy = make_policy(kind)
    policy.save(tmp_path / "policy.pth")
    for other in (copy.deepcopy(policy), kind.load(tmp_path / "policy.pth", device="cpu")):
        assert push_below_zero(other) == dict.fromkeys(SIDES, 0.0)
    assert policy.motor_network.combination_weights() == dict.fromkeys(SIDES, 0.5)
    assert push_below_zero(policy) == dict.fromkeys(SIDES, 0.0)


@kinds
def test_another_optimizer_or_kernel_of_it_can_be_chosen(kind):
    chosen = [(torch.optim.SGD, {"momentum": 0.5}), (torch.optim.RMSprop, {}), (torch.optim.Adam, {"foreach": True})]
    for optimizer_class, arguments in chosen:
        policy = make_policy(kind, optimizer_class=optimizer_class, optimizer_kwargs={"weight_decay": 0.5} | arguments)
        optimizer = network_optimizer(policy)
        assert type(optimizer) is optimizer_class
        assert optimizer.defaults["weight_decay"] == 0.5
        assert push_below_zero(policy) == dict.fromkeys(SIDES, 0.0)


@kinds
def test_action_mean_is_half_the_networks_output(kind):
    policy, obs = make_policy(kind), torch.from_numpy(observations())
    mean = (policy if kind is BilateralActorCriticPolicy else policy.actor).action_mean(obs)
    torch.testing.assert_close(mean, policy.motor_network(obs) / 2)


@kinds
def test_every_parameter_of_a_policy_is_in_exactly_one_group(kind):
    critics = 1 if kind is BilateralActorCriticPolicy else 2
    for architecture, n_streams in itertools.product(ARCHITECTURES, (1, 2)):
        policy = make_policy(kind, architecture=architecture, n_streams=n_streams, units=12, layers=4)
        network_groups = {name: len(group) for name, group in policy.motor_network.parameter_groups().items()}
        assert_each_parameter_in_one_group(policy)
        groups = policy.parameter_groups()
        assert set(groups) == {"dominant", "non_dominant", "shared", *(f"critic_{i}" for i in range(n_streams))}
        shared = {id(parameter) for parameter in groups["shared"]}
        stds = [p for name, p in policy.named_parameters() if "log_std" in name]
        assert len(stds) == (0 if kind is BilateralTD3Policy else 1)
        assert all(id(std) in shared for std in stds)
        for i in range(n_streams):
            assert len(groups[f"critic_{i}"]) == 6 * critics, "two hidden layers and a read-out"
        after = {name: len(group) for name, group in policy.motor_network.parameter_groups().items()}
        assert after == network_groups, "asking for the policy's groups leaves the network's own alone"


@kinds
@pytest.mark.parametrize("share", [True, False])
def test_a_features_extractors_parameters_are_shared_and_the_network_sees_its_features(kind, share):
    policy = make_policy(kind, features_extractor_class=LearnedFeatures, share_features_extractor=share, n_streams=2)
    assert_each_parameter_in_one_group(policy)
    groups = policy.parameter_groups()
    actors = {id(p) for p in policy.motor_network.parameters()}
    critics = {id(p) for name, group in groups.items() if name.startswith("critic_") for p in group}
    stds = {id(p) for name, p in policy.named_parameters() if "log_std" in name}
    others = {id(p) for p in trained_parameters(policy)} - actors - critics - stds
    assert len(others) == (4 if share else 8), "a linear layer and its normalization, once or twice"
    assert others <= {id(p) for p in groups["shared"]}
    policy.set_training_mode(False)
    obs, actor = torch.from_numpy(observations()), policy if kind is BilateralActorCriticPolicy else policy.actor
    extractor = actor.pi_features_extractor if kind is BilateralActorCriticPolicy else actor.features_extractor
    torch.testing.assert_close(actor.action_mean(obs), policy.motor_network(extractor(obs)) / 2)


@kinds
def test_observations_are_flattened_and_actions_keep_the_shape_of_their_box(kind):
    for space in (spaces.Box(-1.0, 1.0, (3, 4)), spaces.Discrete(5)):
        policy = make_policy(kind, observations=space, actions=spaces.Box(-1.0, 1.0, (2, 3)))
        assert policy.motor_network.n_inputs == spaces.flatdim(space)
        assert policy.predict(space.sample(), deterministic=True)[0].shape == (2, 3)


@kinds
def test_a_network_trained_elsewhere_loads_into_a_policy_and_back(kind, random_network):
    network, policy = random_network("callosal"), make_policy(kind)
    policy.motor_network.load_state_dict(network.state_dict())
    with torch.no_grad():
        expected = 2 * network.excitation(torch.from_numpy(observations())).numpy() - 1
    np.testing.assert_allclose(deterministic_action(policy), expected, rtol=0, atol=1e-6)
    random_network("callosal", seed=5).load_state_dict(policy.motor_network.state_dict())


@kinds
def test_the_network_is_found_in_the_policys_weights_by_its_key(kind):
    for architecture in ARCHITECTURES:
        policy = make_policy(kind, architecture=architecture, n_streams=2)
        key = kind.NETWORK_KEY
        stored = {name.removeprefix(key): v for name, v in policy.state_dict().items() if name.startswith(key)}
        expected = policy.motor_network.state_dict()
        assert stored.keys() == expected.keys()
        assert all(stored[name].data_ptr() == value.data_ptr() for name, value in expected.items())


@kinds
def test_a_lesion_of_the_network_changes_the_policys_actions_and_lifts(kind):
    policy = make_policy(kind)
    intact = deterministic_action(policy)
    with policy.motor_network.lesioned("callosum"):
        lesioned = deterministic_action(policy)
    assert np.abs(lesioned - intact).max() > 1e-3
    np.testing.assert_array_equal(deterministic_action(policy), intact)
