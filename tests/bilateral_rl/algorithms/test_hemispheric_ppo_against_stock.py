"""Where nothing is specialized, HemisphericPPO's gradients are stock PPO's."""

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO

from bilateral_rl.envs import ArmVecEnv

# A narrow Gaussian: SB3 recovers the latent action from the squashed one, which costs digits near the bounds.
POLICY_KWARGS = {"log_std_init": -1.5}
WHOLE_ROLLOUT = {"batch_size": 80, "n_epochs": 1, "max_grad_norm": 1e9, "vf_coef": 0.7}
TOLERANCE = {"rtol": 1e-5, "atol": 1e-6}


def copy_critic(policy):
    """Makes the second stream's critic the first's."""
    critics = policy.mlp_extractor.critics
    if len(critics) > 1:
        critics[1].load_state_dict(critics[0].state_dict())


def copy_weights(policy, stock_policy):
    """Gives a stock PPO's one-stream policy the weights of ours, those of the first critic."""
    state = policy.state_dict()
    stock_policy.load_state_dict({name: state[name] for name in stock_policy.state_dict()})


def perturb(policy, seed=0):
    """Moves every parameter, so that the ratio to the collecting policy is no longer one."""
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in policy.parameters():
            parameter.add_(0.02 * torch.randn(parameter.shape, generator=generator))


def stock_twin(model, **kwargs):
    """A stock PPO with the model's weights and, in a stock buffer, the model's rollout (its first stream)."""
    stock = PPO(
        model.policy_class, ArmVecEnv(model.n_envs, trial_length=7), n_steps=model.n_steps, gamma=model.gamma,
        gae_lambda=model.gae_lambda, policy_kwargs=POLICY_KWARGS, seed=0, device="cpu", **kwargs,
    )  # fmt: skip
    stock._setup_learn(model.n_steps * model.n_envs, None)
    copy_weights(model.policy, stock.policy)
    rollout, buffer = model.rollout, stock.rollout_buffer
    starts = np.ones(model.n_envs)
    with torch.no_grad():
        for t in range(model.n_steps):
            observations = torch.from_numpy(rollout.observations[t])
            actions = torch.tanh(torch.from_numpy(rollout.latent_actions[t]))
            values, log_prob, _ = stock.policy.evaluate_actions(observations, actions)
            buffer.add(rollout.observations[t], actions.numpy(), rollout.rewards[t, :, 0], starts, values, log_prob)
            starts = rollout.dones[t]
        last_values = stock.policy.predict_values(torch.from_numpy(model._last_obs))
    buffer.compute_returns_and_advantage(last_values, rollout.dones[-1])
    return stock


@pytest.fixture
def compare(make_model, collect, gradients_of_update):
    """Gradients of one update on one rollout, ours and stock PPO's."""

    def compare(policy, loss, env=None, **settings):
        settings = WHOLE_ROLLOUT | settings
        model = make_model(
            policy, env=env, loss=loss, weight_penalty=0.0, reward_scale=0.1, gamma=0.95,
            policy_kwargs=POLICY_KWARGS, **settings,
        )  # fmt: skip
        copy_critic(model.policy)
        collect(model)
        stock = stock_twin(model, **settings)
        perturb(model.policy)
        copy_critic(model.policy)
        copy_weights(model.policy, stock.policy)
        return gradients_of_update(model), gradients_of_update(stock), model

    return compare


def is_critic(name):
    return "critics" in name


SETTINGS = [
    {},
    {"clip_range_vf": 0.03},
    {"clip_range": 0.01},
    {"normalize_advantage": False},
    {"clip_range_vf": 0.03, "clip_range": 0.05},
]


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
@pytest.mark.parametrize("policy", ["UnilateralPolicy", "BilateralPolicy", "CallosalPolicy"])
def test_with_one_stream_gradients_are_stock_ppos(compare, policy, settings):
    ours, stock, _ = compare(policy, "combined", **settings)
    assert ours.keys() == stock.keys()
    for name, gradient in stock.items():
        assert gradient.abs().max() > 1e-4, name
        torch.testing.assert_close(ours[name], gradient, **TOLERANCE, msg=lambda text, name=name: f"{name}: {text}")


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
def test_with_equal_streams_and_shared_parameters_gradients_are_stock_ppos(compare, equal_streams, settings):
    env = equal_streams(ArmVecEnv(4, trial_length=7))
    ours, stock, model = compare("UnilateralPolicy", "specialized", env=env, **settings)
    np.testing.assert_array_equal(model.rollout.advantages[..., 0], model.rollout.advantages[..., 1])
    for name, gradient in stock.items():
        torch.testing.assert_close(ours[name], gradient, **TOLERANCE, msg=lambda text, name=name: f"{name}: {text}")
    for name in filter(is_critic, stock):
        second = name.replace("critics.0", "critics.1")
        torch.testing.assert_close(ours[second], stock[name], **TOLERANCE)


def test_with_equal_streams_a_bilateral_networks_gradients_are_stock_ppos_too(compare, equal_streams):
    """Each side's share of equal gradients is the whole of one, or half of each."""
    ours, stock, _ = compare("CallosalPolicy", "specialized", env=equal_streams(ArmVecEnv(4, trial_length=7)))
    for name, gradient in stock.items():
        torch.testing.assert_close(ours[name], gradient, **TOLERANCE)


def test_the_comparison_sees_clipped_ratios_and_values(compare):
    """Guards the tests above: their clip ranges bind, so the gradients with and without differ."""
    free, _, _ = compare("UnilateralPolicy", "combined")
    for settings in ({"clip_range": 0.01}, {"clip_range_vf": 0.03}):
        bound, _, _ = compare("UnilateralPolicy", "combined", **settings)
        assert any((bound[name] - free[name]).abs().max() > 1e-3 for name in free), settings


@pytest.mark.parametrize("loss", ["combined", "specialized"])
def test_the_entropy_bonus_widens_every_action_by_its_coefficient_and_moves_nothing_else(compare, loss):
    """Entropy of a Gaussian grows by one nat per nat of log_std; stock PPO's estimate has no expected gradient."""
    without, _, _ = compare("CallosalPolicy", loss)
    with_bonus, _, _ = compare("CallosalPolicy", loss, ent_coef=0.05)
    for name, gradient in without.items():
        expected = gradient - 0.05 if name == "log_std" else gradient
        torch.testing.assert_close(with_bonus[name], expected, **TOLERANCE)
