"""The networks as stable-baselines3 policies: stock PPO and A2C train, save, load and rescale them."""

import copy

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium import spaces
from stable_baselines3 import A2C, PPO
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor

from bilateral_rl.envs import ArmVecEnv
from bilateral_rl.policies import (
    ARCHITECTURES,
    POLICY_ALIASES,
    BilateralActorCriticPolicy,
    BilateralPolicy,
    CallosalPolicy,
    UnilateralPolicy,
)

OBSERVATIONS = spaces.Box(-1.0, 1.0, (16,))
MUSCLES = spaces.Box(-1.0, 1.0, (6,))
POLICIES = [
    ("UnilateralPolicy", {}, "unilateral"),
    ("BilateralPolicy", {}, "bilateral"),
    ("CallosalPolicy", {}, "callosal"),
    *[(BilateralActorCriticPolicy, {"architecture": name}, name) for name in ARCHITECTURES],
]
SIDES = ("dominant", "non_dominant")


def make_policy(policy=CallosalPolicy, observations=OBSERVATIONS, actions=MUSCLES, **kwargs):
    return policy(observations, actions, lambda _: 1e-3, **kwargs)


def make_model(algorithm, policy, env, seed=0, **kwargs):
    sizes = {"n_steps": 8} | ({"batch_size": 8, "n_epochs": 1} if algorithm is PPO else {})
    return algorithm(policy, env, seed=seed, device="cpu", **(sizes | kwargs))


def observations(n=32, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, (n, 16)).astype(np.float32)


def assert_same_weights(a, b):
    assert a.state_dict().keys() == b.state_dict().keys()
    for name, value in a.state_dict().items():
        assert torch.equal(value, b.state_dict()[name]), name


def assert_each_parameter_in_one_group(policy):
    grouped = [id(parameter) for group in policy.parameter_groups().values() for parameter in group]
    assert sorted(grouped) == sorted(id(parameter) for parameter in policy.parameters())


def watch_combination_weights(actor):
    """The smallest combination weight before each projection, recorded while training goes on."""
    before, constrain = [], actor.constrain

    def spy():
        before.append(min(actor.combination_weights().values()))
        constrain()

    actor.constrain = spy
    return before


def push_below_zero(policy):
    """One optimizer step whose gradient drives both combination weights far below zero."""
    policy.optimizer.zero_grad()
    for side in SIDES:
        getattr(policy.motor_network, f"combination_{side}").grad = torch.tensor(1.0)
    for group in policy.optimizer.param_groups:
        group["lr"] = 10.0
    policy.optimizer.step()


@pytest.mark.parametrize("algorithm", [PPO, A2C])
@pytest.mark.parametrize(("policy", "policy_kwargs", "architecture"), POLICIES)
@pytest.mark.parametrize("face", ["vec_env", "id"])
def test_stock_algorithms_learn_save_and_load(tmp_path, algorithm, policy, policy_kwargs, architecture, face):
    env = ArmVecEnv(4) if face == "vec_env" else "bilateral_rl/RandomReach-v0"
    model = make_model(algorithm, policy, env, policy_kwargs=policy_kwargs)
    assert model.policy.motor_network.architecture == architecture
    before = copy.deepcopy(model.policy.state_dict())
    model.learn(2 * model.n_steps * model.n_envs)
    assert all(not torch.equal(value, before[name]) for name, value in model.policy.state_dict().items())
    model.save(tmp_path / "model.zip")
    loaded = algorithm.load(tmp_path / "model.zip", device="cpu")
    assert loaded.policy.motor_network.architecture == architecture
    assert_same_weights(loaded.policy, model.policy)
    expected, _ = model.predict(observations(), deterministic=True)
    np.testing.assert_array_equal(loaded.predict(observations(), deterministic=True)[0], expected)


@pytest.mark.parametrize("name", POLICY_ALIASES)
@pytest.mark.parametrize("algorithm", [PPO, A2C])
def test_stock_algorithms_keep_their_own_aliases_beside_ours(algorithm, name):
    assert algorithm.policy_aliases[name] is POLICY_ALIASES[name]
    assert {"MlpPolicy", "CnnPolicy", "MultiInputPolicy"} <= set(algorithm.policy_aliases)


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_policy_save_and_load_rebuild_the_same_policy(tmp_path, architecture):
    policy = make_policy(
        BilateralActorCriticPolicy, architecture=architecture, units=12, layers=3, critic_arch=(8,), n_streams=2,
        log_std_init=-0.5,
    )  # fmt: skip
    policy.save(tmp_path / "policy.pth")
    loaded = BilateralActorCriticPolicy.load(tmp_path / "policy.pth", device="cpu")
    assert_same_weights(loaded, policy)
    assert (loaded.motor_network.architecture, loaded.motor_network.units, loaded.motor_network.layers) == (
        architecture,
        12,
        3,
    )
    np.testing.assert_array_equal(
        loaded.predict(observations(), deterministic=True)[0], policy.predict(observations(), deterministic=True)[0]
    )


@pytest.mark.parametrize("policy", [UnilateralPolicy, BilateralPolicy, CallosalPolicy])
def test_the_deterministic_action_is_the_networks_sigmoid_output(policy):
    policy = make_policy(policy)
    with torch.no_grad():
        expected = 2 * torch.sigmoid(policy.motor_network(torch.from_numpy(observations()))).numpy() - 1
    action, _ = policy.predict(observations(), deterministic=True)
    np.testing.assert_allclose(action, expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("low", "high"), [(0.0, 3.0), ([-1.0, 0.0, 2.0, -5.0, 0.0, -1.0], [2.0, 5.0, 3.0, -4.0, 1.0, 1.0])]
)
def test_actions_are_rescaled_to_any_bounded_box(low, high):
    low, high = np.broadcast_to(np.float32(low), 6), np.broadcast_to(np.float32(high), 6)
    policy = make_policy(actions=spaces.Box(low, high), log_std_init=1.0)
    with torch.no_grad():
        excitation = policy.motor_network.excitation(torch.from_numpy(observations())).numpy()
    action, _ = policy.predict(observations(), deterministic=True)
    np.testing.assert_allclose(action, low + excitation * (high - low), rtol=0, atol=3e-6)
    sampled, _ = policy.predict(observations(500), deterministic=False)
    assert (low <= sampled).all()
    assert (sampled <= high).all()
    assert ((sampled.max(axis=0) - sampled.min(axis=0)) > 0.8 * (high - low)).all(), "noise fills the box"


@pytest.mark.parametrize("policy", [UnilateralPolicy, CallosalPolicy])
@pytest.mark.parametrize(
    "space",
    [
        spaces.Discrete(3),
        spaces.MultiBinary(6),
        spaces.Box(-np.inf, np.inf, (6,)),
        spaces.Box(0.0, np.inf, (6,)),
        spaces.Box(np.zeros(2, np.float32), np.array([1.0, np.inf], np.float32)),
    ],
    ids=str,
)
def test_action_spaces_other_than_a_bounded_box_are_refused(policy, space):
    with pytest.raises(ValueError, match="bounded Box, not"):
        make_policy(policy, actions=space)


def test_state_dependent_exploration_is_refused():
    with pytest.raises(ValueError, match="use_sde"):
        make_policy(use_sde=True)
    with pytest.raises(ValueError, match="use_sde"):
        PPO("CallosalPolicy", ArmVecEnv(1), use_sde=True, device="cpu")


def test_an_architecture_or_a_size_that_does_not_exist_is_refused():
    with pytest.raises(ValueError, match="unknown architecture 'trilateral'"):
        PPO(BilateralActorCriticPolicy, ArmVecEnv(1), policy_kwargs={"architecture": "trilateral"}, device="cpu")
    with pytest.raises(ValueError, match="7 is odd"):
        PPO("BilateralPolicy", ArmVecEnv(1), policy_kwargs={"units": 7}, device="cpu")


@pytest.mark.parametrize("algorithm", [PPO, A2C])
@pytest.mark.parametrize("loaded", [False, True])
def test_combination_weights_stay_non_negative_under_stock_updates(tmp_path, algorithm, loaded):
    model = make_model(algorithm, "CallosalPolicy", ArmVecEnv(4), learning_rate=0.1)
    with torch.no_grad():
        for side in SIDES:
            getattr(model.policy.motor_network, f"combination_{side}").fill_(0.05)
    if loaded:
        model.save(tmp_path / "model.zip")
        model = algorithm.load(tmp_path / "model.zip", env=ArmVecEnv(4), device="cpu")
    before = watch_combination_weights(model.policy.motor_network)
    smallest_after = []
    model.policy.optimizer.register_step_post_hook(
        lambda *_: smallest_after.append(min(model.policy.motor_network.combination_weights().values()))
    )
    model.learn(320)
    assert min(before) < 0, "half a step of this learning rate was meant to take a weight below zero"
    assert len(smallest_after) == len(before)
    assert min(smallest_after) >= 0


def test_a_copied_policy_keeps_its_combination_weights_non_negative():
    policy = make_policy()
    clone = copy.deepcopy(policy)
    push_below_zero(clone)
    assert clone.motor_network.combination_weights() == dict.fromkeys(SIDES, 0.0)
    assert policy.motor_network.combination_weights() == dict.fromkeys(SIDES, 0.5)


def test_one_step_far_below_zero_ends_at_zero():
    policy = make_policy()
    push_below_zero(policy)
    assert policy.motor_network.combination_weights() == dict.fromkeys(SIDES, 0.0)


@pytest.mark.parametrize("n_streams", [1, 2])
def test_evaluate_actions_agrees_with_the_forward_pass(n_streams):
    policy = make_policy(n_streams=n_streams, log_std_init=-0.7)
    obs = torch.from_numpy(observations(200))
    with torch.no_grad():
        actions, values, log_prob = policy(obs)
        values_again, log_prob_again, entropy = policy.evaluate_actions(obs, actions)
        predicted = policy.predict_values(obs)
    assert values.shape == values_again.shape == predicted.shape == (200, 1)
    torch.testing.assert_close(values_again, values)
    torch.testing.assert_close(predicted, values)
    torch.testing.assert_close(log_prob_again, log_prob, rtol=1e-4, atol=1e-4)
    assert entropy is None, "a squashed Gaussian's entropy has no closed form"


def test_log_prob_is_the_density_of_the_squashed_gaussian():
    """The change of variables, from the network's output and the standard deviation."""
    policy = make_policy(log_std_init=-0.7)
    obs = torch.from_numpy(observations(200))
    with torch.no_grad():
        actions, _, log_prob = policy(obs)
        mean = policy.motor_network(obs).double() / 2
        latent = torch.atanh(actions.double())
        gaussian = torch.distributions.Normal(mean, np.exp(-0.7)).log_prob(latent)
        density = gaussian - torch.log1p(-(actions.double() ** 2))
    torch.testing.assert_close(log_prob.double(), density.sum(dim=1), rtol=1e-3, atol=1e-3)


def test_the_scalar_value_is_the_mean_of_the_streams():
    policy, obs = make_policy(n_streams=2), torch.from_numpy(observations())
    with torch.no_grad():
        streams = policy.predict_stream_values(obs)
        torch.testing.assert_close(policy.predict_values(obs), streams.mean(dim=1, keepdim=True))
        torch.testing.assert_close(policy(obs)[1], streams.mean(dim=1, keepdim=True))
    assert streams.shape == (32, 2)
    assert not torch.allclose(streams[:, 0], streams[:, 1])


def test_action_mean_is_half_the_networks_output():
    policy, obs = make_policy(), torch.from_numpy(observations())
    torch.testing.assert_close(policy.action_mean(obs), policy.motor_network(obs) / 2)


@pytest.mark.parametrize("architecture", ARCHITECTURES)
@pytest.mark.parametrize("n_streams", [1, 2])
@pytest.mark.parametrize("size", [(4, 2), (10, 2), (12, 4)])
def test_every_parameter_of_a_policy_is_in_exactly_one_group(architecture, n_streams, size):
    units, layers = size
    policy = make_policy(
        BilateralActorCriticPolicy, architecture=architecture, n_streams=n_streams, units=units, layers=layers
    )
    assert_each_parameter_in_one_group(policy)
    groups = policy.parameter_groups()
    assert set(groups) == {"dominant", "non_dominant", "shared", *(f"critic_{i}" for i in range(n_streams))}
    assert any(parameter is policy.log_std for parameter in groups["shared"])
    for i in range(n_streams):
        assert len(groups[f"critic_{i}"]) == 6, "two hidden layers and a read-out"


def test_asking_for_a_policys_groups_leaves_the_networks_own_alone():
    policy = make_policy()
    policy.parameter_groups()
    assert not any(parameter is policy.log_std for parameter in policy.motor_network.parameter_groups()["shared"])


class LinearFeatures(BaseFeaturesExtractor):
    """A features extractor that has parameters of its own."""

    def __init__(self, observation_space):
        super().__init__(observation_space, features_dim=9)
        self.linear = torch.nn.Linear(observation_space.shape[0], 9)

    def forward(self, obs):
        return self.linear(obs)


@pytest.mark.parametrize("share", [True, False])
def test_a_features_extractors_parameters_are_shared(share):
    policy = make_policy(features_extractor_class=LinearFeatures, share_features_extractor=share, n_streams=2)
    assert_each_parameter_in_one_group(policy)
    shared = {id(parameter) for parameter in policy.parameter_groups()["shared"]}
    for extractor in (policy.pi_features_extractor, policy.vf_features_extractor):
        assert {id(parameter) for parameter in extractor.parameters()} <= shared
    obs = torch.from_numpy(observations())
    features = policy.pi_features_extractor(obs)
    torch.testing.assert_close(policy.action_mean(obs), policy.motor_network(features) / 2)
    torch.testing.assert_close(policy.predict_values(obs), policy.predict_stream_values(obs).mean(dim=1, keepdim=True))


@pytest.mark.parametrize("policy", POLICY_ALIASES)
def test_other_environments_of_gymnasium_can_be_learned(tmp_path, policy):
    model = make_model(PPO, policy, gymnasium.make("Pendulum-v1")).learn(16)
    model.save(tmp_path / "model.zip")
    loaded = PPO.load(tmp_path / "model.zip", env=gymnasium.make("Pendulum-v1"), device="cpu")
    assert_same_weights(loaded.policy, model.policy)
    obs = np.random.default_rng(0).uniform(-1, 1, (100, 3)).astype(np.float32)
    torque, _ = loaded.predict(obs, deterministic=True)
    with torch.no_grad():
        expected = 4 * torch.sigmoid(loaded.policy.motor_network(torch.from_numpy(obs))).numpy() - 2
    np.testing.assert_allclose(torque, expected, rtol=0, atol=4e-6)
    loaded.learn(16)


@pytest.mark.parametrize("space", [spaces.Box(-1.0, 1.0, (3, 4)), spaces.Discrete(5)], ids=str)
def test_observations_are_flattened(space):
    policy = make_policy(observations=space)
    assert policy.motor_network.n_inputs == spaces.flatdim(space)
    assert policy.predict(space.sample(), deterministic=True)[0].shape == (6,)


def test_actions_keep_the_shape_of_their_box():
    policy = make_policy(actions=spaces.Box(-1.0, 1.0, (2, 3)))
    assert policy.predict(OBSERVATIONS.sample(), deterministic=True)[0].shape == (2, 3)


@pytest.mark.parametrize("units", [4, 20])
def test_the_actors_size_follows_policy_kwargs(units):
    model = make_model(PPO, "CallosalPolicy", ArmVecEnv(1), policy_kwargs={"units": units, "layers": 3})
    actor = model.policy.motor_network
    assert [layer.weight.shape[0] for layer in actor.dominant] == [units // 2] * 3


def test_a_network_trained_elsewhere_loads_into_a_policy_and_back(random_network):
    network, policy = random_network("callosal"), make_policy()
    policy.motor_network.load_state_dict(network.state_dict())
    action, _ = policy.predict(observations(), deterministic=True)
    with torch.no_grad():
        expected = 2 * network.excitation(torch.from_numpy(observations())).numpy() - 1
    np.testing.assert_allclose(action, expected, rtol=0, atol=1e-6)
    random_network("callosal", seed=5).load_state_dict(policy.motor_network.state_dict())


@pytest.mark.parametrize("lesion", ["shallow_dominant", "deep_non_dominant", "callosum"])
def test_a_lesion_of_the_actor_changes_the_policys_actions_and_lifts(lesion):
    policy = make_policy()
    intact, _ = policy.predict(observations(), deterministic=True)
    with policy.motor_network.lesioned(lesion):
        lesioned, _ = policy.predict(observations(), deterministic=True)
    assert np.abs(lesioned - intact).max() > 1e-3
    np.testing.assert_array_equal(policy.predict(observations(), deterministic=True)[0], intact)
