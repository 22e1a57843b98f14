"""Every argument of every policy, SB3's too: another value shows, or is refused with what to say instead."""

import inspect

import numpy as np
import pytest
import torch
from gymnasium import spaces
from hemispheric_models import LearnedFeatures, assert_same_weights, make_model
from stable_baselines3 import A2C, PPO, SAC, TD3
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.sac.policies import SACPolicy
from stable_baselines3.td3.policies import TD3Policy
from torch import nn

from bilateral_rl import policies
from bilateral_rl.policies import BilateralActorCriticPolicy, BilateralSACPolicy, BilateralTD3Policy
from bilateral_rl.policies.lesions import Lesion
from bilateral_rl.policies.motor_network import MotorNetwork
from bilateral_rl.policies.motor_policy import MotorPolicy
from bilateral_rl.policies.networks import CallosalNetwork, make_network
from bilateral_rl.vocabulary import SIDES

PARENT = {
    BilateralActorCriticPolicy: ActorCriticPolicy,
    BilateralSACPolicy: SACPolicy,
    BilateralTD3Policy: TD3Policy,
}
kinds = pytest.mark.parametrize("kind", PARENT)


class SizedFeatures(LearnedFeatures):
    """Learned features whose scale is an argument."""

    def __init__(self, observation_space, scale=1.0):
        super().__init__(observation_space)
        self.scale = scale

    def forward(self, observations):
        return self.scale * super().forward(observations)


LEARNED = {"features_extractor_class": SizedFeatures}
IMAGES = {"observation_space": spaces.Box(0, 255, (2, 4, 2), np.uint8)}
SHOWS = {
    "observation_space": spaces.Box(-1.0, 1.0, (9,)),
    "action_space": spaces.Box(0.0, 1.0, (6,)),
    "lr_schedule": lambda _: 0.5,
    "architecture": "unilateral",
    "units": 12,
    "layers": 3,
    "hidden_noise": 0.1,
    "n_arms": 2,
    "critic_arch": (8,),
    "n_critics": 3,
    "n_streams": 2,
    "n_traces": 1,
    "standardize_inputs": True,
    "critic_activation_fn": nn.ELU,
    "log_std_init": -1.0,
    "features_extractor_class": LearnedFeatures,
    "optimizer_class": torch.optim.SGD,
    "optimizer_kwargs": {"weight_decay": 0.5},
}
"""Another value than the default of every argument."""
SHOWS_BESIDE = {
    "ipsilateral_share": (0.3, {"n_arms": 2}),
    "trained_combination": (True, {"n_arms": 2}),
    "features_extractor_kwargs": ({"scale": 2.0}, LEARNED),
    "share_features_extractor": (None, LEARNED),  # the opposite of the default
    "normalize_images": (False, IMAGES),
}
"""Likewise, with the arguments without which it has nothing to act on."""
NO_SDE = (r"there is no state-dependent exploration \(gSDE\)", True)
REFUSED = {
    "net_arch": ("net_arch=.* the network is sized by units and layers, and the critics by critic_arch", [64, 64]),
    "activation_fn": ("activation_fn=ELU .* tanh, as in the paper, .* what critic_activation_fn says", nn.ELU),
    "ortho_init": ("ortho_init=False .* Glorot-uniform kernels, as in the paper", False),
    "squash_output": ("squash_output=False .* always squashed into the bounds of the action space", False),
    "use_sde": NO_SDE,
    "full_std": (NO_SDE[0], False),
    "use_expln": NO_SDE,
    "clip_mean": (NO_SDE[0], 1.0),
}
"""What the refusal of an argument says, and the value that is refused."""
REFUSED_BY_TD3 = {"log_std_init": ("log_std_init is not available for TD3, which explores by its action_noise", -1.0)}


def arguments_of(kind):
    names = {**inspect.signature(kind.__init__).parameters, **inspect.signature(PARENT[kind].__init__).parameters}
    return {name: p.default for name, p in names.items() if name not in ("self", "kwargs")}


def make_policy(kind, **arguments):
    torch.manual_seed(0)
    spaces_ = {"observation_space": spaces.Box(-1.0, 1.0, (16,)), "action_space": spaces.Box(-1.0, 1.0, (6,))}
    small = {"lr_schedule": lambda _: 1e-3, "architecture": "callosal", "critic_arch": (6,)}
    return kind(**(spaces_ | small | arguments))


def fingerprint(policy):
    """What a policy is made of, does, learns by, and becomes by a step of each optimizer."""
    obs = torch.linspace(0, 1, 3 * spaces.flatdim(policy.observation_space))
    obs = (100 * obs.reshape(3, *policy.observation_space.shape)).clip(0, 100)
    policy.set_training_mode(False)
    torch.manual_seed(1)
    actions = policy.predict(obs.numpy().astype(policy.observation_space.dtype), deterministic=False)[0]
    if isinstance(policy, BilateralActorCriticPolicy):
        values = None if policy.n_traces else policy.predict_stream_values(obs)
        optimizers = [policy.optimizer]
    else:
        values = None if policy.n_traces else policy.stream_values(policy.critic, obs, torch.ones(3, 6))
        optimizers = [policy.actor.optimizer, policy.critic.optimizer]
    if values is not None:
        values.sum().backward()
    for optimizer in optimizers:
        optimizer.step()
    tensors = {name: tensor.numpy().tobytes() for name, tensor in policy.state_dict().items()}
    trained = [parameter.requires_grad for parameter in policy.parameters()]
    return actions.tobytes(), None if values is None else values.tolist(), tensors, repr(optimizers), trained


@kinds
def test_every_argument_shows_or_is_refused(kind):
    defaults = arguments_of(kind)
    refused = REFUSED | (REFUSED_BY_TD3 if kind is BilateralTD3Policy else {})
    missing = defaults.keys() - SHOWS.keys() - SHOWS_BESIDE.keys() - refused.keys()
    assert not missing, f"say here what other values of {missing} change, or that they are refused"
    plain = fingerprint(make_policy(kind))
    assert plain == fingerprint(make_policy(kind)), "or nothing is shown below"
    for name, default in defaults.items():
        if name in refused:
            message, value = refused[name]
            with pytest.raises(ValueError, match=message):
                make_policy(kind, **{name: value})
        elif name in SHOWS:
            assert fingerprint(make_policy(kind, **{name: SHOWS[name]})) != plain, name
        else:
            value, beside = SHOWS_BESIDE[name]
            value = not default if value is None else value
            without, given = (fingerprint(make_policy(kind, **beside, **given)) for given in ({}, {name: value}))
            assert given != without, name


@pytest.mark.parametrize("algorithm", [PPO, A2C, SAC, TD3])
def test_stock_algorithms_refuse_what_could_have_no_effect(algorithm):
    for name in ("net_arch", "activation_fn"):
        message, value = REFUSED[name]
        with pytest.raises(ValueError, match=message):
            make_model(algorithm, policy_kwargs={name: value})


@kinds
def test_what_says_no_more_than_is_so_is_taken(kind):
    same = {"net_arch": None, "squash_output": True, "use_sde": False, "full_std": True, "use_expln": False}
    assert_same_weights(make_policy(kind, **same, clip_mean=2.0), make_policy(kind))


@kinds
def test_numbers_of_numpy_and_lists_are_taken_and_saved_as_pythons(kind, tmp_path):
    critics = {} if kind is BilateralActorCriticPolicy else {"n_critics": np.int8(2), "standardize_inputs": 1}
    std = {} if kind is BilateralTD3Policy else {"log_std_init": np.float32(-1)}
    sizes = {"units": np.int64(12), "layers": np.uint8(2), "critic_arch": [np.int32(8), 4], "n_streams": np.int64(2)}
    policy = make_policy(kind, **sizes, **critics, **std)
    saved = policy._get_constructor_parameters()
    assert {type(saved[name]) for name in sizes.keys() - {"critic_arch"}} == {int}
    assert saved["critic_arch"] == (8, 4)
    policy.save(tmp_path / "policy.pth")
    assert_same_weights(kind.load(tmp_path / "policy.pth", device="cpu"), policy)


@kinds
def test_spaces_of_two_arms_are_taken_for_them_only_where_somebody_says_so(kind, tmp_path):
    spaces_ = {"observation_space": spaces.Box(-1.0, 1.0, (40,)), "action_space": spaces.Box(-1.0, 1.0, (12,))}
    with pytest.raises(ValueError, match=r"40 observed numbers and 12 actions are those of two arms: .* n_arms=2 "):
        make_policy(kind, **spaces_)
    for n_arms, units in ((1, 10), (2, 20)):
        policy = make_policy(kind, **spaces_, n_arms=n_arms)
        assert (policy.motor_network.n_arms, policy.motor_network.units) == (n_arms, units)
        policy.save(tmp_path / "policy.pth")
        loaded = kind.load(tmp_path / "policy.pth", device="cpu")
        assert loaded.motor_network.arguments == policy.motor_network.arguments
        assert_same_weights(loaded, policy)


@kinds
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n_arms": 3}, "n_arms must be 1 or 2, got 3"),
        ({"ipsilateral_share": 0.1}, "ipsilateral_share is for networks that command two arms"),
        ({"units": 10.0}, r"units must be a whole number, got 10\.0"),
        ({"units": "10"}, "units must be a whole number, got '10'"),
        ({"hidden_noise": -0.1}, r"hidden_noise must be at least 0, got -0\.1"),
        ({"layers": True}, "layers must be a whole number, got True"),
        ({"critic_arch": 64}, r"critic_arch must be a sequence of units per hidden layer, such as \(64, 64\), got 64"),
        ({"critic_arch": [64, 0]}, "each number of critic_arch must be at least 1, got 0"),
        ({"critic_arch": "64"}, "critic_arch must be a sequence"),
        ({"n_streams": 0}, "n_streams must be at least 1, got 0"),
        ({"n_traces": -1}, "n_traces must be at least 0, got -1"),
        ({"n_critics": 0}, "n_critics must be at least 1, got 0"),
        ({"standardize_inputs": "yes"}, "standardize_inputs must be True or False, got 'yes'"),
        ({"log_std_init": np.nan}, "log_std_init must be a finite number, got nan"),
        ({"log_std_init": [0.0, 1.0]}, "log_std_init must be a finite number"),
    ],
)
def test_sizes_of_another_kind_are_refused_by_name(kind, arguments, message):
    if arguments.keys() <= arguments_of(kind).keys():
        with pytest.raises(ValueError, match=message):
            make_policy(kind, **arguments)


@kinds
def test_a_saved_policy_keeps_how_its_features_are_shared_and_its_critics(kind, tmp_path):
    shared = {"features_extractor_class": LearnedFeatures, "critic_activation_fn": nn.ELU}
    for share in (True, False):
        policy = make_policy(kind, share_features_extractor=share, **shared)
        policy.save(tmp_path / "policy.pth")
        loaded = kind.load(tmp_path / "policy.pth", device="cpu")
        assert loaded.share_features_extractor == share
        assert_same_weights(loaded, policy)
        assert fingerprint(loaded)[:2] == fingerprint(policy)[:2], "what it does, before a step"


def test_off_policy_policies_of_earlier_versions_load(tmp_path):
    """They name SB3's activation, which their critics have, and a standard deviation, which TD3 has no use for."""
    for kind in (BilateralSACPolicy, BilateralTD3Policy):
        policy = make_policy(kind)
        data = policy._get_constructor_parameters()
        del data["critic_activation_fn"], data["share_features_extractor"]
        data |= {"activation_fn": nn.ReLU, "log_std_init": 0.0}
        torch.save({"state_dict": policy.state_dict(), "data": data}, tmp_path / "policy.pth")
        assert_same_weights(kind.load(tmp_path / "policy.pth", device="cpu"), policy)


@kinds
def test_the_motor_network_cannot_be_replaced(kind):
    policy = make_policy(kind)
    with pytest.raises(AttributeError, match=r"load weights into it, by policy\.motor_network\.load_state_dict"):
        policy.motor_network = CallosalNetwork(16, 6)
    assert not [name for name in policy.state_dict() if name.startswith("motor_network")]


@kinds
def test_an_optimizer_of_ones_own_keeps_combination_weights_non_negative(kind):
    policy = make_policy(kind)
    actor = policy if kind is BilateralActorCriticPolicy else policy.actor
    actor.optimizer = torch.optim.SGD(actor.parameters(), lr=10.0)
    for side in SIDES:
        getattr(policy.motor_network, f"combination_{side}").grad = torch.tensor(1.0)
    actor.optimizer.step()
    assert policy.motor_network.combination_weights() == dict.fromkeys(SIDES, 0.0)


def test_every_argument_of_a_lesion_shows():
    assert inspect.signature(Lesion).parameters.keys() == {"input_of", "output_of", "callosum"}
    network, obs = make_network("callosal", 5, 6), torch.linspace(-1, 1, 5)[None]
    outputs = {repr(network(obs))}
    for lesion in (Lesion(input_of="dominant"), Lesion(output_of="dominant"), Lesion(callosum=np.True_)):
        with network.lesioned(lesion):
            outputs.add(repr(network(obs)))
    assert len(outputs) == 4
    with pytest.raises(ValueError, match="callosum must be True or False, got 'cut'"):
        Lesion(callosum="cut")


def test_every_public_class_is_looked_at():
    public = {getattr(policies, name) for name in policies.__all__ if inspect.isclass(getattr(policies, name))}
    networks = {cls for cls in public if issubclass(cls, MotorNetwork)}
    assert public - networks - {Lesion, MotorPolicy} == PARENT.keys() | set(policies.POLICY_ALIASES.values())
    for cls in networks:
        assert inspect.signature(cls).parameters.keys() == inspect.signature(make_network).parameters.keys() - {
            "architecture"
        }
    for alias in policies.POLICY_ALIASES.values():
        assert inspect.signature(alias) == inspect.signature(BilateralActorCriticPolicy)


def shown(network):
    """What a network is made of, with which combinations, trained or not."""
    combination = network.combination_weights()
    return repr(network), combination, [parameter.requires_grad for parameter in network.parameters()]


def test_every_argument_of_a_network_shows():
    arguments = {"n_inputs": 6, "n_outputs": 6, "units": 8, "layers": 2, "hidden_noise": 0, "architecture": "callosal",
                 "n_arms": 2, "ipsilateral_share": 0.1, "trained_combination": False}  # fmt: skip
    others = {"n_inputs": 4, "n_outputs": 4, "units": 12, "layers": 3, "hidden_noise": 0.1, "architecture": "bilateral",
              "n_arms": 1, "ipsilateral_share": 0.0, "trained_combination": True}  # fmt: skip
    of_one_arm = {"ipsilateral_share": None, "trained_combination": None}
    assert arguments.keys() == others.keys() == inspect.signature(make_network).parameters.keys()
    plain = shown(make_network(**arguments))
    for name, value in others.items():
        changed = arguments | {name: value} | (of_one_arm if name == "n_arms" else {})
        assert shown(make_network(**changed)) != plain, name
    assert make_network("callosal", np.int64(5), 6, np.int32(8)).units == 8
