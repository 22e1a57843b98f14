"""Where nothing is specialized, HemisphericPPO and HemisphericA2C are stock PPO and A2C."""

import numpy as np
import pytest
import torch
from hemispheric_models import (
    ON_POLICY,
    ROLLOUT,
    STOCK,
    WHOLE_ROLLOUT,
    EqualStreams,
    arm,
    assert_close_weights,
    collect,
    gradients_of_update,
    make_model,
)

from bilateral_rl.algorithms import HemisphericA2C, HemisphericPPO

# A narrow Gaussian: SB3 recovers the latent action from the squashed one, which costs digits near the bounds.
POLICY_KWARGS = {"log_std_init": -1.5}
TOLERANCE = {"rtol": 1e-5, "atol": 1e-6}
CASES = [
    (HemisphericPPO, {}),
    (HemisphericPPO, {"clip_range_vf": 0.03}),
    (HemisphericPPO, {"clip_range": 0.01}),
    (HemisphericPPO, {"normalize_advantage": False}),
    (HemisphericA2C, {}),
    (HemisphericA2C, {"normalize_advantage": True}),
]
cases = pytest.mark.parametrize(("algorithm", "settings"), CASES, ids=[f"{a.__name__}-{s}" for a, s in CASES])


def copy_critic(policy):
    """Makes the second stream's critic the first's."""
    critics = policy.mlp_extractor.critics
    if len(critics) > 1:
        critics[1].load_state_dict(critics[0].state_dict())


def copy_weights(policy, stock_policy):
    """Gives a stock algorithm's one-stream policy the weights of ours, those of the first critic."""
    state = policy.state_dict()
    stock_policy.load_state_dict({name: state[name] for name in stock_policy.state_dict()})


def perturb(policy, seed=0):
    """Moves every parameter, so that the ratio to the collecting policy is no longer one."""
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in policy.parameters():
            parameter.add_(0.02 * torch.randn(parameter.shape, generator=generator))


def pair(algorithm, policy, loss, env=arm, **settings):
    """A model of ours and a stock one with its weights, and critics that begin alike."""
    settings = WHOLE_ROLLOUT[algorithm] | {"vf_coef": 0.7, "gamma": 0.95} | settings
    ours = make_model(
        algorithm, policy, env(), loss=loss, weight_penalty=0.0, policy_kwargs=dict(POLICY_KWARGS), **settings
    )
    stock = make_model(STOCK[algorithm], policy, env(), policy_kwargs=dict(POLICY_KWARGS), **settings)
    copy_critic(ours.policy)
    copy_weights(ours.policy, stock.policy)
    return ours, stock


def copy_rollout(model, stock):
    """Puts the model's rollout, of its first stream, into the stock one's buffer."""
    stock._setup_learn(ROLLOUT, None)
    rollout, buffer = model.rollout_buffer, stock.rollout_buffer
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


def compare(algorithm, policy, loss, env=arm, **settings):
    """Gradients of one update on one rollout, ours and the stock algorithm's."""
    ours, stock = pair(algorithm, policy, loss, env, **settings)
    ours.reward_scale = 0.1
    collect(ours)
    copy_rollout(ours, stock)
    perturb(ours.policy)
    copy_critic(ours.policy)
    copy_weights(ours.policy, stock.policy)
    return gradients_of_update(ours), gradients_of_update(stock), ours


def equal_streams():
    return EqualStreams(arm())


def is_critic(name):
    return "critics" in name


@pytest.mark.parametrize(
    ("algorithm", "settings", "policy"),
    [
        *[(*case, "CallosalPolicy") for case in CASES],
        *[(algorithm, {}, policy) for algorithm in ON_POLICY for policy in ("UnilateralPolicy", "BilateralPolicy")],
    ],
)
def test_with_one_stream_gradients_are_the_stock_ones(algorithm, policy, settings):
    ours, stock, _ = compare(algorithm, policy, "combined", **settings)
    assert ours.keys() == stock.keys()
    for name, gradient in stock.items():
        assert gradient.abs().max() > 1e-4, name
        torch.testing.assert_close(ours[name], gradient, **TOLERANCE, msg=lambda text, name=name: f"{name}: {text}")


@cases
def test_with_equal_streams_and_shared_parameters_gradients_are_the_stock_ones(algorithm, settings):
    ours, stock, model = compare(algorithm, "UnilateralPolicy", "specialized", equal_streams, **settings)
    np.testing.assert_array_equal(model.rollout_buffer.advantages[..., 0], model.rollout_buffer.advantages[..., 1])
    for name, gradient in stock.items():
        torch.testing.assert_close(ours[name], gradient, **TOLERANCE, msg=lambda text, name=name: f"{name}: {text}")
    for name in filter(is_critic, stock):
        second = name.replace("critics.0", "critics.1")
        torch.testing.assert_close(ours[second], stock[name], **TOLERANCE)


@pytest.mark.parametrize("algorithm", ON_POLICY)
def test_with_equal_streams_a_bilateral_networks_gradients_are_the_stock_ones_too(algorithm):
    """Each side's share of equal gradients is the whole of one, or half of each."""
    ours, stock, _ = compare(algorithm, "CallosalPolicy", "specialized", equal_streams)
    for name, gradient in stock.items():
        torch.testing.assert_close(ours[name], gradient, **TOLERANCE)


def test_the_comparison_sees_clipped_ratios_and_values():
    """Guards the tests above: their clip ranges bind, so the gradients with and without differ."""
    free, _, _ = compare(HemisphericPPO, "UnilateralPolicy", "combined")
    for settings in ({"clip_range": 0.01}, {"clip_range_vf": 0.03}):
        bound, _, _ = compare(HemisphericPPO, "UnilateralPolicy", "combined", **settings)
        assert any((bound[name] - free[name]).abs().max() > 1e-3 for name in free), settings


@pytest.mark.parametrize("algorithm", ON_POLICY)
@pytest.mark.parametrize("loss", ["combined", "specialized"])
def test_the_entropy_bonus_widens_every_action_by_its_coefficient_and_moves_nothing_else(algorithm, loss):
    """Entropy of a Gaussian grows by one nat per nat of log_std; the stock estimate has no expected gradient."""
    without, _, _ = compare(algorithm, "CallosalPolicy", loss)
    with_bonus, _, _ = compare(algorithm, "CallosalPolicy", loss, ent_coef=0.05)
    for name, gradient in without.items():
        expected = gradient - 0.05 if name == "log_std" else gradient
        torch.testing.assert_close(with_bonus[name], expected, **TOLERANCE)


@pytest.mark.parametrize(
    ("algorithm", "settings", "optimizer"),
    [
        (HemisphericPPO, {}, torch.optim.Adam),
        (HemisphericA2C, {}, torch.optim.RMSprop),
        (HemisphericA2C, {"use_rms_prop": False}, torch.optim.Adam),
        (HemisphericA2C, {"rms_prop_eps": 1e-3, "normalize_advantage": True}, torch.optim.RMSprop),
    ],
)
@pytest.mark.parametrize(("policy", "loss"), [("CallosalPolicy", "combined"), ("UnilateralPolicy", "specialized")])
def test_whole_trainings_end_with_the_stock_weights(algorithm, settings, optimizer, policy, loss):
    """Collecting, bootstrapping at time limits and stepping; between updates the random states are set alike."""
    models = pair(algorithm, policy, loss, equal_streams, learning_rate=3e-4, **settings)
    before = models[0].policy.motor_network.output.weight.detach().clone()
    for seed in range(3):
        for model in models:
            model.set_random_seed(seed)
            model.learn(ROLLOUT)
            assert type(model.policy.optimizer) is optimizer
    assert_close_weights(*models, atol=2e-6)
    assert models[0]._n_updates == models[1]._n_updates == 3
    assert (models[0].policy.motor_network.output.weight - before).abs().max() > 5e-4
