"""Every hemispheric algorithm: owners of parameters, weight penalty, seeds, settings, and refusals."""

import gymnasium
import pytest
import torch
from gymnasium import spaces
from hemispheric_models import (
    ALGORITHMS,
    OFF_POLICY,
    PENALTY_ON_GROUP,
    STOCK,
    WHOLE_ROLLOUT,
    RandomEnds,
    arm,
    changed,
    collect,
    gradients_of_update,
    make_model,
    named_parameters,
    names_by_group,
    optimizers,
    weights,
)
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import DummyVecEnv

from bilateral_rl.algorithms import HemisphericA2C, HemisphericTD3
from bilateral_rl.policies import POLICY_ALIASES, SAC_ALIASES
from bilateral_rl.vocabulary import SIDES

pytestmark = pytest.mark.parametrize("algorithm", ALGORITHMS)
each_loss = pytest.mark.parametrize(
    ("policy", "loss"),
    [
        ("UnilateralPolicy", "dominant"),
        ("UnilateralPolicy", "non_dominant"),
        ("BilateralPolicy", "combined"),
        ("CallosalPolicy", "specialized"),
    ],
)

SINGLE = {algorithm: {"batch_size": 20} for algorithm in ALGORITHMS if algorithm is not HemisphericA2C}
"""Settings for a single environment."""


@each_loss
def test_every_parameter_is_trained_and_in_one_group_with_a_share(algorithm, policy, loss):
    model = make_model(algorithm, policy, loss=loss)
    trained = [p for optimizer in optimizers(model) for group in optimizer.param_groups for p in group["params"]]
    grouped = [p for group in model.parameter_groups().values() for p in group]
    assert sorted(map(id, grouped)) == sorted(map(id, trained))
    assert {id(p) for p in grouped} == {id(p) for p in named_parameters(model).values()}
    gradients = gradients_of_update(collect(model))
    assert gradients.keys() == named_parameters(model).keys()
    assert not [name for name, gradient in gradients.items() if gradient is None or not gradient.any()]


def scale_of_the_last_stream(model):
    """How much smaller or larger than the rewards the loss is that follows them; the last stream pays the penalty."""
    if getattr(model, "normalize_advantage", False):
        return model.reward_scale / model.rollout_buffer.advantages[..., -1].std(ddof=1)
    return model.reward_scale


@each_loss
def test_the_weight_penalty_touches_exactly_the_groups_it_names_in_the_scale_of_their_loss(algorithm, policy, loss):
    coefficient = 0.3
    # A standard deviation other than 1, whose logarithm would feel a penalty.
    std = {} if algorithm is HemisphericTD3 else {"log_std_init": -1.0}
    settings = WHOLE_ROLLOUT[algorithm] | {"reward_scale": 0.5, "policy_kwargs": std}
    gradients = []
    for weight_penalty in (0.0, coefficient):
        model = collect(make_model(algorithm, policy, loss=loss, weight_penalty=weight_penalty, **settings))
        model.set_random_seed(1)  # the samples or their order, and so the rounding
        gradients.append(gradients_of_update(model))
    without, with_penalty = gradients
    values, network = named_parameters(model), {id(p) for p in model.policy.motor_network.parameters()}
    for group, names in names_by_group(model).items():
        for name in names:
            weight = PENALTY_ON_GROUP[loss][group] if id(values[name]) in network else 0.0
            weight *= scale_of_the_last_stream(model)
            expected = without[name] + weight * coefficient * values[name].detach()
            if weight:
                torch.testing.assert_close(with_penalty[name], expected, rtol=1e-5, atol=1e-7)
            else:
                assert torch.equal(with_penalty[name], without[name]), name


def test_the_same_seed_gives_the_same_weights_bit_for_bit(algorithm):
    first, again, other = (weights(make_model(algorithm, seed=seed).learn(160)) for seed in (3, 3, 4))
    assert all(torch.equal(value, again[name]) for name, value in first.items())
    assert any(not torch.equal(value, other[name]) for name, value in first.items())


def test_combination_weights_stay_non_negative(algorithm):
    model = make_model(algorithm, learning_rate=0.1)
    network = model.policy.motor_network
    with torch.no_grad():
        for side in SIDES:
            getattr(network, f"combination_{side}").fill_(0.05)
    smallest = []
    optimizers(model)[0].register_step_post_hook(
        lambda *_: smallest.append(min(network.combination_weights().values()))
    )
    model.learn(320)
    assert min(smallest) == 0.0, "the learning rate was meant to drive a weight to its bound"


class StopAfter(BaseCallback):
    """Stops learning after some steps."""

    def __init__(self, steps):
        super().__init__()
        self.steps = steps

    def _on_step(self):
        return self.n_calls < self.steps


def test_a_callback_can_stop_in_the_middle_of_a_rollout(algorithm):
    model = make_model(algorithm)
    before = weights(model)
    model.learn(800, callback=StopAfter(5))
    assert model.num_timesteps == 5 * 4
    assert not changed(model, before)


def test_an_environments_id_is_enough(algorithm):
    model = make_model(algorithm, "BilateralPolicy", "bilateral_rl/HoldPosition-v0", **SINGLE.get(algorithm, {}))
    before = weights(model)
    model.learn(60)
    assert len(changed(model, before)) == len(before)


def test_the_policys_other_settings_are_kept(algorithm):
    policy_kwargs = {"units": 20, "layers": 3, "critic_arch": (8,)}
    std = {} if algorithm is HemisphericTD3 else {"log_std_init": -1.0}
    policy = make_model(algorithm, policy_kwargs=policy_kwargs | std).policy
    assert (policy.motor_network.units, policy.motor_network.layers, policy.n_streams) == (20, 3, 2)
    for name, value in policy.named_parameters():
        if "log_std" in name:
            torch.testing.assert_close(value.detach(), torch.full((6,), -1.0))


def test_a_policy_that_is_not_ours_is_refused(algorithm):
    needed = algorithm.POLICY_CLASS.__name__
    stock = STOCK[algorithm].policy_aliases["MlpPolicy"]
    of_the_other_kind = (POLICY_ALIASES if algorithm in OFF_POLICY else SAC_ALIASES)["CallosalPolicy"]
    for policy in (stock, of_the_other_kind):
        message = f"{algorithm.__name__} needs a {needed}, not {policy.__name__}"
        with pytest.raises(ValueError, match=message):
            algorithm(policy, arm(1), device="cpu")
    with pytest.raises(ValueError, match="MlpPolicy"):
        algorithm("MlpPolicy", arm(1), device="cpu")


def test_an_unknown_loss_is_refused_naming_the_valid_ones(algorithm):
    with pytest.raises(ValueError, match=r"'both'.*combined, dominant, non_dominant, specialized"):
        algorithm("CallosalPolicy", arm(1), loss="both", device="cpu")


def test_critics_that_do_not_fit_the_loss_are_refused(algorithm):
    for loss, needed, n_streams in (("specialized", 2, 1), ("combined", 1, 2)):
        with pytest.raises(ValueError, match=f"'{loss}' needs {needed} critics, but the policy has {n_streams}"):
            make_model(algorithm, loss=loss, policy_kwargs={"n_streams": n_streams})


class Dictionary(RandomEnds):
    """Observations in a dictionary."""

    observation_space = spaces.Dict({"hand": spaces.Box(-1.0, 1.0, (5,))})

    def _observation(self):
        return {"hand": super()._observation()}


def test_observations_other_than_a_box_are_refused(algorithm):
    with pytest.raises(ValueError, match=f"{algorithm.__name__} needs observations in a Box, not Dict"):
        make_model(algorithm, env=DummyVecEnv([Dictionary]), **SINGLE.get(algorithm, {}))


def test_an_environment_without_reward_pairs_is_refused_by_name(algorithm):
    with pytest.raises(ValueError, match=r"a pair of rewards is needed.*vector_reward"):
        make_model(algorithm, env=gymnasium.make("Pendulum-v1"), **SINGLE.get(algorithm, {})).learn(60)
