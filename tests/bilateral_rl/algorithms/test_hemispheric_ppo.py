"""HemisphericPPO: which update moves what, and how a model is used, logged, stopped and refused."""

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.policies import ActorCriticPolicy

from bilateral_rl.algorithms import LOSSES, HemisphericPPO
from bilateral_rl.envs import ArmVecEnv
from bilateral_rl.policies import POLICY_ALIASES

SIDES = ("dominant", "non_dominant")
ARCHITECTURE_AND_LOSS = [(policy, loss) for policy in POLICY_ALIASES for loss in LOSSES]


def weights(model):
    return {name: value.clone() for name, value in model.policy.state_dict().items()}


def changed(model, before):
    return {name for name, value in model.policy.state_dict().items() if not torch.equal(value, before[name])}


def names_by_group(model):
    names = {id(parameter): name for name, parameter in model.policy.named_parameters()}
    return {group: {names[id(p)] for p in owned} for group, owned in model.policy.parameter_groups().items()}


@pytest.mark.parametrize("policy", ["BilateralPolicy", "CallosalPolicy"])
@pytest.mark.parametrize(("silenced", "stream"), [("non_dominant", 1), ("dominant", 0)])
def test_a_stream_without_advantages_moves_no_parameter_of_its_hemisphere(
    monkeypatch, make_model, policy, silenced, stream
):
    model = make_model(policy, weight_penalty=0.0, ent_coef=0.0)
    finish = model.rollout.finish

    def finish_and_silence(*args):
        finish(*args)
        model.rollout.advantages[..., stream] = 0.0

    monkeypatch.setattr(model.rollout, "finish", finish_and_silence)
    before, groups = weights(model), names_by_group(model)
    model.learn(80)
    moved = changed(model, before)
    other = SIDES[1 - stream]
    assert not moved & groups[silenced]
    assert groups[other] <= moved
    assert groups["shared"] <= moved
    assert groups["critic_0"] | groups["critic_1"] <= moved


@pytest.mark.parametrize(("policy", "loss"), ARCHITECTURE_AND_LOSS)
def test_every_model_trains_every_parameter_each_in_one_group_with_a_share(
    make_model, collect, gradients_of_update, policy, loss
):
    model = make_model(policy, loss=loss)
    grouped = [id(p) for group in model.policy.parameter_groups().values() for p in group]
    assert sorted(grouped) == sorted(id(p) for p in model.policy.parameters())
    gradients = gradients_of_update(collect(model))
    assert set(gradients) == {name for name, _ in model.policy.named_parameters()}
    without = [name for name, gradient in gradients.items() if gradient is None or not gradient.any()]
    assert not without


@pytest.mark.parametrize(("policy", "loss"), ARCHITECTURE_AND_LOSS)
def test_the_weight_penalty_touches_exactly_the_groups_it_names(make_model, collect, gradients_of_update, policy, loss):
    coefficient = 0.3
    factor = {
        "combined": {"dominant": 1.0, "non_dominant": 1.0, "shared": 1.0},
        "dominant": {"dominant": 0.0, "non_dominant": 0.0, "shared": 0.0},
        "non_dominant": {"dominant": 2.0, "non_dominant": 2.0, "shared": 2.0},
        "specialized": {"dominant": 0.0, "non_dominant": 2.0, "shared": 1.0},
    }[loss]
    # A standard deviation other than 1, whose logarithm would feel a penalty.
    sizes = {"batch_size": 80, "n_epochs": 1, "max_grad_norm": 1e9, "policy_kwargs": {"log_std_init": -1.0}}
    gradients = []
    for weight_penalty in (0.0, coefficient):
        model = collect(make_model(policy, loss=loss, weight_penalty=weight_penalty, **sizes))
        torch.manual_seed(1)  # the order of the samples, and so the rounding
        gradients.append(gradients_of_update(model))
    without, with_penalty = gradients
    values, network = dict(model.policy.named_parameters()), {id(p) for p in model.policy.motor_network.parameters()}
    for group, names in names_by_group(model).items():
        for name in names:
            weight = factor[group] if id(values[name]) in network else 0.0
            expected = without[name] + weight * coefficient * values[name].detach()
            if weight:
                torch.testing.assert_close(with_penalty[name], expected, rtol=1e-5, atol=1e-7)
            else:
                assert torch.equal(with_penalty[name], without[name]), name


def test_each_group_is_clipped_by_itself_in_an_update(make_model, collect, gradients_of_update):
    sizes = {"batch_size": 80, "n_epochs": 1}
    gradients = []
    for max_grad_norm in (1e9, 0.05):
        model = collect(make_model(max_grad_norm=max_grad_norm, **sizes))
        torch.manual_seed(1)
        gradients.append(gradients_of_update(model))
    free, clipped = gradients
    for names in names_by_group(model).values():
        norm = torch.linalg.vector_norm(torch.cat([free[name].flatten() for name in names]))
        factor = min(1.0, 0.05 / (norm.item() + 1e-6))
        for name in names:
            torch.testing.assert_close(clipped[name], factor * free[name], rtol=1e-4, atol=1e-8)


def test_the_same_seed_gives_the_same_weights_bit_for_bit(make_model):
    runs = [make_model(seed=seed).learn(160).policy.state_dict() for seed in (3, 3, 4)]
    assert all(torch.equal(value, runs[1][name]) for name, value in runs[0].items())
    assert any(not torch.equal(value, runs[2][name]) for name, value in runs[0].items())


def test_two_streams_are_logged_by_name(make_model, learn_logged):
    logged = learn_logged(make_model())
    for side in SIDES:
        for quantity in ("policy_loss", "value_loss", "explained_variance", "return", "combination"):
            assert np.isfinite(logged[f"{quantity}/{side}"]).all()
    for group in (*SIDES, "shared", "critic_0", "critic_1"):
        before, after = (np.array(logged[f"{name}/{group}"]) for name in ("gradient_norm", "gradient_norm_clipped"))
        assert (after > 0).all()
        assert (after <= 0.5 + 1e-6).all()
        assert (after <= before + 1e-6).all()
    assert {"train/approx_kl", "train/clip_fraction", "train/std", "train/clip_range"} <= set(logged)
    assert {"train/learning_rate", "rollout/ep_rew_mean", "rollout/success_rate"} <= set(logged)


@pytest.mark.parametrize("loss", ["combined", "dominant", "non_dominant"])
def test_one_stream_is_logged_under_its_losss_name(make_model, learn_logged, loss):
    logged = learn_logged(make_model("UnilateralPolicy", loss=loss))
    for quantity in ("policy_loss", "value_loss", "explained_variance"):
        assert [name for name in logged if name.startswith(f"{quantity}/")] == [f"{quantity}/{loss}"]
    assert {"return/dominant", "return/non_dominant"} <= set(logged), "what a trial brought is logged for any loss"
    assert not any(name.startswith("combination/") for name in logged)


def test_the_logged_returns_are_the_trials_and_unscaled(make_model, learn_logged, recorder):
    env = recorder(ArmVecEnv(4, trial_length=7))
    logged = learn_logged(make_model(env=env, reward_scale=100.0), n_updates=1)
    ended = [info["vector_return"] for step in env.steps for info in step[3] if "vector_return" in info]
    assert len(ended) == 8
    for stream, side in enumerate(SIDES):
        assert logged[f"return/{side}"][0] == pytest.approx(np.mean([pair[stream] for pair in ended]), rel=1e-5)


def test_the_logged_combination_weights_are_the_networks(make_model, learn_logged):
    model = make_model(learning_rate=1e-2)
    capture = learn_logged(model, n_updates=2)
    assert capture["combination/dominant"] != [0.5]
    model.logger.dump()
    assert {
        side: capture[f"combination/{side}"][-1] for side in SIDES
    } == model.policy.motor_network.combination_weights()


def test_combination_weights_stay_non_negative(make_model):
    model = make_model(learning_rate=0.1)
    with torch.no_grad():
        for side in SIDES:
            getattr(model.policy.motor_network, f"combination_{side}").fill_(0.05)
    smallest = []
    model.policy.optimizer.register_step_post_hook(
        lambda *_: smallest.append(min(model.policy.motor_network.combination_weights().values()))
    )
    model.learn(320)
    assert min(smallest) == 0.0, "the learning rate was meant to drive a weight to its bound"


def count_optimizer_steps(model):
    steps = []
    model.policy.optimizer.register_step_post_hook(lambda *_: steps.append(1))
    model.learn(80)
    return len(steps)


def test_target_kl_stops_an_update_early(make_model):
    settings = {"n_epochs": 10, "learning_rate": 0.03}
    assert count_optimizer_steps(make_model(**settings)) == 20
    assert 0 < count_optimizer_steps(make_model(target_kl=0.01, **settings)) < 20
    assert count_optimizer_steps(make_model(target_kl=1e6, **settings)) == 20


def test_an_epoch_that_target_kl_cuts_short_counts_as_stock_ppo_counts_it(make_model):
    settings = {"n_steps": 20, "batch_size": 40, "n_epochs": 10, "learning_rate": 0.03, "target_kl": 0.0}
    ours = make_model("UnilateralPolicy", loss="combined", **settings).learn(80)
    stock = PPO("UnilateralPolicy", ArmVecEnv(4, trial_length=7), seed=0, device="cpu", **settings).learn(80)
    assert ours._n_updates == stock._n_updates == 1


class StopAfter(BaseCallback):
    """Stops learning after some steps."""

    def __init__(self, steps):
        super().__init__()
        self.steps = steps

    def _on_step(self):
        return self.n_calls < self.steps


def test_a_callback_can_stop_in_the_middle_of_a_rollout(make_model):
    model = make_model()
    before = weights(model)
    model.learn(800, callback=StopAfter(5))
    assert model.num_timesteps == 5 * 4
    assert not changed(model, before)


def test_a_policy_that_is_not_ours_is_refused():
    with pytest.raises(ValueError, match=r"needs a BilateralActorCriticPolicy, not ActorCriticPolicy"):
        HemisphericPPO(ActorCriticPolicy, ArmVecEnv(1), device="cpu")
    with pytest.raises(ValueError, match="MlpPolicy"):
        HemisphericPPO("MlpPolicy", ArmVecEnv(1), device="cpu")


def test_an_unknown_loss_is_refused_naming_the_valid_ones():
    with pytest.raises(ValueError, match=r"'both'.*combined, dominant, non_dominant, specialized"):
        HemisphericPPO("CallosalPolicy", ArmVecEnv(1), loss="both", device="cpu")


def test_the_policys_other_settings_are_kept(make_model):
    model = make_model(policy_kwargs={"units": 20, "layers": 3, "critic_arch": (8,), "log_std_init": -1.0})
    assert (model.policy.motor_network.units, model.policy.motor_network.layers, model.policy.n_streams) == (20, 3, 2)
    torch.testing.assert_close(model.policy.log_std.detach(), torch.full((6,), -1.0))


def test_an_environments_id_is_enough():
    model = HemisphericPPO("BilateralPolicy", "bilateral_rl/HoldPosition-v0", n_steps=16, batch_size=16, device="cpu")
    before = weights(model)
    assert len(changed(model.learn(16), before)) == len(before)
