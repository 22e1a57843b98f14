"""Algorithms on an environment of two arms: the network that they make, what they leave alone, and stock parents."""

import numpy as np
import pytest
import torch
from hemispheric_models import (
    ALGORITHMS,
    ON_POLICY,
    STOCK,
    WHOLE_ROLLOUT,
    TwoArms,
    changed,
    collect,
    gradients_of_update,
    learn_logged,
    make_model,
    names_by_group,
    optimizers,
    weights,
)
from stable_baselines3.common.vec_env import DummyVecEnv

from bilateral_rl.vocabulary import SIDES

N_ENVS = 4
SMALL = {"units": 8, "critic_arch": (8,)}
FIXED = {f"combination_{side}" for side in SIDES}
algorithms = pytest.mark.parametrize("algorithm", ALGORITHMS)


class OneArm(TwoArms):
    """The same, which says that it is one."""

    n_arms = 1


def two_arms(cls=TwoArms):
    return DummyVecEnv([cls] * N_ENVS)


def model_of(algorithm, policy="CallosalPolicy", env=None, policy_kwargs=None, **settings):
    return make_model(algorithm, policy, env or two_arms(), policy_kwargs=SMALL | (policy_kwargs or {}), **settings)


def combinations(names):
    """Names of the combination weights among those of a policy's parameters, as the network has them."""
    return {name.rsplit(".", 1)[1] for name in names if ".combination" in name}


@algorithms
def test_the_network_is_of_as_many_arms_as_the_environment_tells(algorithm, tmp_path):
    model = model_of(algorithm, policy_kwargs={"ipsilateral_share": 0.3})
    network = model.policy.motor_network
    assert (network.n_arms, network.ipsilateral_share, network.trained_combination) == (2, 0.3, False)
    model.save(tmp_path / "model.zip")
    for env in (None, two_arms()):
        loaded = algorithm.load(tmp_path / "model.zip", env, device="cpu")
        assert loaded.policy.motor_network.arguments == network.arguments
        assert all(torch.equal(value, weights(model)[name]) for name, value in weights(loaded).items())
    assert model_of(algorithm, env=two_arms(OneArm)).policy.motor_network.n_arms == 1
    for env, n_arms in ((TwoArms, 1), (OneArm, 2)):
        with pytest.raises(ValueError, match=rf"n_arms={n_arms}, and the environment has {env.n_arms}"):
            model_of(algorithm, env=two_arms(env), policy_kwargs={"n_arms": n_arms})


@algorithms
def test_fixed_combination_weights_are_left_alone_by_losses_penalties_and_optimizers(algorithm):
    model = model_of(algorithm, loss="specialized", weight_penalty=0.3)
    before = weights(model)
    gradients = gradients_of_update(collect(model))
    assert combinations(name for name, gradient in gradients.items() if gradient is None) == FIXED
    logged = learn_logged(model)
    moved = changed(model, before)
    assert not combinations(moved)
    trained = {name for names in names_by_group(model).values() for name in names if ".combination" not in name}
    assert trained <= moved
    assert not [name for name in logged if name.startswith("combination")], "what is fixed is no news"
    optimizer = optimizers(model)[0]
    assert len(optimizer.state) < sum(len(group["params"]) for group in optimizer.param_groups)


@algorithms
def test_trained_combination_weights_are_learned_logged_and_kept_non_negative(algorithm):
    model = model_of(algorithm, policy_kwargs={"trained_combination": True}, learning_rate=0.1)
    smallest = []
    network = model.policy.motor_network
    optimizers(model)[0].register_step_post_hook(
        lambda *_: smallest.append(min(network.combination_weights().values()))
    )
    before = weights(model)
    logged = learn_logged(model)
    assert combinations(changed(model, before)) == FIXED
    assert min(smallest) == 0.0, "the learning rate was meant to drive a weight to its bound"
    shown = {name.removeprefix("combination/") for name in logged if name.startswith("combination/")}
    assert shown == {*network.combination_weights()}


@algorithms
def test_frozen_output_layers_and_hemispheres_stay(algorithm):
    model = model_of(algorithm, frozen=("dominant",), policy_kwargs={"ipsilateral_share": 0.0})
    before = weights(model)
    model.learn(160)
    moved = {name for name in changed(model, before) if "target" not in name}
    frozen = names_by_group(model)["dominant"]
    assert any(name.endswith("output.dominant.weight") for name in frozen), "that side alone commands it"
    assert not moved & {*frozen}
    assert {*names_by_group(model)["non_dominant"]} - moved == {
        name for name in names_by_group(model)["non_dominant"] if name.endswith("combination_non_dominant")
    }


@pytest.mark.parametrize("algorithm", ON_POLICY)
def test_with_one_stream_an_on_policy_update_is_the_stock_one(algorithm):
    """The stock algorithm is told the number of arms, and its buffer holds our rollout."""
    kwargs = {"log_std_init": -1.5}
    settings = WHOLE_ROLLOUT[algorithm] | {"vf_coef": 0.7, "gamma": 0.95}
    ours = model_of(algorithm, loss="combined", weight_penalty=0.0, policy_kwargs=kwargs, **settings)
    stock = model_of(STOCK[algorithm], policy_kwargs=kwargs | {"n_arms": 2}, **settings)
    stock.policy.load_state_dict(ours.policy.state_dict())
    collect(ours)
    rollout, starts = ours.rollout_buffer, np.ones(N_ENVS)
    stock._setup_learn(1, None)
    with torch.no_grad():
        for t in range(ours.n_steps):
            seen, actions = torch.from_numpy(rollout.observations[t]), np.tanh(rollout.latent_actions[t])
            values, log_prob, _ = stock.policy.evaluate_actions(seen, torch.from_numpy(actions))
            stock.rollout_buffer.add(
                rollout.observations[t], actions, rollout.rewards[t, :, 0], starts, values, log_prob
            )
            starts = rollout.dones[t]
        last_values = stock.policy.predict_values(torch.from_numpy(ours._last_obs))
    stock.rollout_buffer.compute_returns_and_advantage(last_values, rollout.dones[-1])
    mine, theirs = gradients_of_update(ours), gradients_of_update(stock)
    assert mine.keys() == theirs.keys()
    for name, gradient in theirs.items():
        if ".combination" in name:
            assert (mine[name], gradient) == (None, None)
        else:
            torch.testing.assert_close(
                mine[name], gradient, rtol=1e-5, atol=1e-6, msg=lambda text, n=name: f"{n}: {text}"
            )
