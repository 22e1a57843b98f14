"""Stock PPO, A2C, SAC and TD3 train, save and load the networks."""

import copy

import gymnasium
import numpy as np
import pytest
import torch
from hemispheric_models import STOCK, arm, assert_same_weights, make_model, optimizers
from stable_baselines3 import A2C, PPO, SAC, TD3

from bilateral_rl.policies import (
    POLICY_ALIASES,
    SAC_ALIASES,
    TD3_ALIASES,
    BilateralActorCriticPolicy,
    BilateralSACPolicy,
    BilateralTD3Policy,
)
from bilateral_rl.vocabulary import SIDES

ALGORITHMS = {
    PPO: (BilateralActorCriticPolicy, POLICY_ALIASES),
    A2C: (BilateralActorCriticPolicy, POLICY_ALIASES),
    SAC: (BilateralSACPolicy, SAC_ALIASES),
    TD3: (BilateralTD3Policy, TD3_ALIASES),
}
SINGLE = {PPO: {"batch_size": 20}, A2C: {}, SAC: {"learning_starts": 8}, TD3: {"learning_starts": 8}}
"""Settings for a single environment, of which a rollout has twenty steps."""

assert set(ALGORITHMS) == set(STOCK.values())
algorithms = pytest.mark.parametrize("algorithm", ALGORITHMS)


@algorithms
@pytest.mark.parametrize(
    ("architecture", "by"), [("unilateral", "alias"), ("bilateral", "class"), ("callosal", "alias")]
)
def test_stock_algorithms_learn_save_and_load(tmp_path, algorithm, architecture, by):
    policy, policy_kwargs = f"{architecture.capitalize()}Policy", {}
    if by == "class":
        policy, policy_kwargs = ALGORITHMS[algorithm][0], {"architecture": architecture}
    model = make_model(algorithm, policy, policy_kwargs=policy_kwargs)
    assert model.policy.motor_network.architecture == architecture
    before = copy.deepcopy(model.policy.state_dict())
    model.learn(80)
    assert all(not torch.equal(value, before[name]) for name, value in model.policy.state_dict().items())
    model.save(tmp_path / "model.zip")
    loaded = algorithm.load(tmp_path / "model.zip", env=arm(), device="cpu")
    assert loaded.policy.motor_network.architecture == architecture
    assert_same_weights(loaded.policy, model.policy)
    observations = np.random.default_rng(0).uniform(-1, 1, (32, 16)).astype(np.float32)
    expected, _ = model.predict(observations, deterministic=True)
    np.testing.assert_array_equal(loaded.predict(observations, deterministic=True)[0], expected)
    loaded.learn(80)


@algorithms
def test_stock_algorithms_keep_their_own_aliases_beside_ours(algorithm):
    assert ALGORITHMS[algorithm][1].items() <= algorithm.policy_aliases.items()
    assert {"MlpPolicy", "CnnPolicy", "MultiInputPolicy"} <= set(algorithm.policy_aliases)


@algorithms
def test_state_dependent_exploration_and_impossible_sizes_are_refused(algorithm):
    if algorithm is not TD3:  # it has none
        with pytest.raises(ValueError, match="use_sde"):
            make_model(algorithm, "CallosalPolicy", use_sde=True)
    with pytest.raises(ValueError, match="7 is odd"):
        make_model(algorithm, "BilateralPolicy", policy_kwargs={"units": 7})


def watch_combination_weights(network):
    """The smallest combination weight before each projection, recorded while training goes on."""
    before, constrain = [], network.constrain

    def spy():
        before.append(min(network.combination_weights().values()))
        constrain()

    network.constrain = spy
    return before


@algorithms
def test_combination_weights_of_a_loaded_model_stay_non_negative_under_stock_updates(tmp_path, algorithm):
    model = make_model(algorithm, "CallosalPolicy", learning_rate=0.1)
    with torch.no_grad():
        for side in SIDES:
            getattr(model.policy.motor_network, f"combination_{side}").fill_(0.05)
    model.save(tmp_path / "model.zip")
    model = algorithm.load(tmp_path / "model.zip", env=arm(), device="cpu")
    network, smallest_after = model.policy.motor_network, []
    before = watch_combination_weights(network)
    optimizers(model)[0].register_step_post_hook(
        lambda *_: smallest_after.append(min(network.combination_weights().values()))
    )
    model.learn(240)
    assert min(before) < 0, "half a step of this learning rate was meant to take a weight below zero"
    assert len(smallest_after) == len(before)
    assert min(smallest_after) >= 0


@algorithms
def test_other_environments_of_gymnasium_can_be_learned(tmp_path, algorithm):
    model = make_model(algorithm, "CallosalPolicy", gymnasium.make("Pendulum-v1"), **SINGLE[algorithm]).learn(20)
    model.save(tmp_path / "model.zip")
    loaded = algorithm.load(tmp_path / "model.zip", env=gymnasium.make("Pendulum-v1"), device="cpu")
    assert_same_weights(loaded.policy, model.policy)
    observations = np.random.default_rng(0).uniform(-1, 1, (100, 3)).astype(np.float32)
    torque, _ = loaded.predict(observations, deterministic=True)
    with torch.no_grad():
        expected = 4 * loaded.policy.motor_network.excitation(torch.from_numpy(observations)).numpy() - 2
    np.testing.assert_allclose(torque, expected, rtol=0, atol=4e-6)
    loaded.learn(20)
