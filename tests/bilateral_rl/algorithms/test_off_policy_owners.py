"""HemisphericSAC and HemisphericTD3: whose reward moves which parameters, by brute force."""

import math

import pytest
import torch
from hemispheric_models import (
    OFF_POLICY,
    changed,
    collect,
    gradients_of_update,
    make_model,
    named_parameters,
    names_by_group,
    update,
    weights,
)

from bilateral_rl.algorithms import HemisphericSAC
from bilateral_rl.vocabulary import SIDES

TEMPERATURE = 0.3


def with_one_batch(monkeypatch, model):
    """Lets every update of the model see the same samples."""
    batch = collect(model).replay_buffer.sample(30)
    monkeypatch.setattr(model.replay_buffer, "sample", lambda *_, **__: batch)
    return batch


def actor_losses(model, batch, seed):
    """Each stream's loss of the network, and the temperature's, from the formulas."""
    policy, observations = model.policy, batch.observations
    mean, log_prob = policy.motor_network(observations) / 2, torch.zeros(len(observations))
    action = torch.tanh(mean)
    if isinstance(model, HemisphericSAC):
        torch.manual_seed(seed)
        std = policy.actor.log_std.exp()
        latent = mean + std * torch.randn(mean.shape)
        action = torch.tanh(latent)
        squashing = torch.log(1 - action**2 + 1e-6)
        log_prob = (torch.distributions.Normal(mean, std).log_prob(latent) - squashing).sum(dim=1)
    losses = []
    for first in range(0, 2 * policy.n_streams, 2):
        inputs = torch.cat([observations, action], dim=1)
        one, other = (policy.critic.q_networks[first + k](inputs).squeeze(1) for k in range(2))
        if isinstance(model, HemisphericSAC):
            losses.append((TEMPERATURE * log_prob - torch.where(one < other, one, other)).mean())
        else:
            losses.append(-one.mean())
    entropy_missing = -(log_prob.detach() + model.target_entropy).mean() if isinstance(model, HemisphericSAC) else None
    return losses, entropy_missing


def gradients(loss, parameters):
    values = torch.autograd.grad(loss, list(parameters.values()), retain_graph=True, allow_unused=True)
    return dict(zip(parameters, values, strict=True))


def make(algorithm, policy="CallosalPolicy", **kwargs):
    settings = {"weight_penalty": 0.0} | kwargs
    if algorithm is HemisphericSAC:
        settings["ent_coef"] = f"auto_{TEMPERATURE}"
    return make_model(algorithm, policy, **settings)


@pytest.mark.parametrize("algorithm", OFF_POLICY)
@pytest.mark.parametrize("policy", ["UnilateralPolicy", "BilateralPolicy", "CallosalPolicy"])
def test_a_hemisphere_gets_its_streams_gradient_and_the_shared_parameters_half_of_each(monkeypatch, algorithm, policy):
    model = make(algorithm, policy)
    batch = with_one_batch(monkeypatch, model)
    groups = names_by_group(model)
    parameters = {name: p for name, p in named_parameters(model).items() if name.startswith("actor.")}
    (dominant, non_dominant), entropy_missing = actor_losses(model, batch, seed=3)
    by_stream = gradients(dominant, parameters), gradients(non_dominant, parameters)
    torch.manual_seed(3)
    routed = gradients_of_update(model)
    for name in parameters:
        of_dominant, of_non_dominant = (stream[name] for stream in by_stream)
        assert (of_dominant - of_non_dominant).abs().max() > 1e-5, "the streams were meant to differ"
        if name in groups["dominant"]:
            expected = of_dominant
        elif name in groups["non_dominant"]:
            expected = of_non_dominant
        else:
            assert name in groups["shared"]
            expected = (of_dominant + of_non_dominant) / 2
        torch.testing.assert_close(routed[name], expected, rtol=1e-4, atol=1e-7)
    logged = model.logger.name_to_value
    assert logged["actor_loss/dominant"] == pytest.approx(dominant.item(), rel=1e-4)
    assert logged["actor_loss/non_dominant"] == pytest.approx(non_dominant.item(), rel=1e-4)
    if algorithm is HemisphericSAC:
        torch.testing.assert_close(routed["log_ent_coef"], entropy_missing.reshape(1), rtol=1e-4, atol=1e-6)
        assert logged["train/entropy"] == pytest.approx(entropy_missing.item() + model.target_entropy, rel=1e-4)
        assert logged["train/ent_coef"] == pytest.approx(TEMPERATURE)


@pytest.mark.parametrize("algorithm", OFF_POLICY)
@pytest.mark.parametrize(("policy", "flows"), [("BilateralPolicy", False), ("CallosalPolicy", True)])
def test_gradients_flow_through_the_other_side_over_the_callosum(algorithm, policy, flows):
    """With the dominant side's own way to the muscles closed, only the callosum is left."""
    model = collect(make(algorithm, policy))
    with model.policy.motor_network.lesioned("deep_dominant"):
        gradient = gradients_of_update(model)["actor.network.dominant.0.weight"]
    assert flows == (gradient is not None and bool(gradient.any()))


@pytest.mark.parametrize("algorithm", OFF_POLICY)
@pytest.mark.parametrize("stream", [0, 1])
def test_a_streams_rewards_move_its_critics_and_its_hemisphere_and_nothing_of_the_other(algorithm, stream):
    # Without momentum, and with steps that reach from the reward over the critics to the network in one update.
    settings = {"learning_rate": 0.05, "tau": 0.5, "policy_kwargs": {"optimizer_class": torch.optim.SGD}}
    models = [collect(make(algorithm, **settings)) for _ in range(2)]
    models[1].replay_buffer.rewards[..., stream] += 1.0
    for model in models:
        model.set_random_seed(1)
        update(model)
    groups = names_by_group(models[0])
    critics = groups[f"critic_{stream}"]
    network = [name for name in groups[SIDES[stream]] + groups["shared"] if name != "log_ent_coef"]
    targets = [name.replace("critic.", "critic_target.") for name in critics]
    if algorithm is not HemisphericSAC:
        targets += [name.replace("actor.", "actor_target.") for name in network]
    assert changed(models[1], weights(models[0])) == {*critics, *network, *targets}


@pytest.mark.parametrize("algorithm", OFF_POLICY)
def test_the_single_stream_of_another_loss_moves_everything(monkeypatch, algorithm):
    model = make(algorithm, loss="dominant")
    batch = with_one_batch(monkeypatch, model)
    parameters = {name: p for name, p in named_parameters(model).items() if name.startswith("actor.")}
    (loss,), _ = actor_losses(model, batch, seed=3)
    expected = gradients(loss, parameters)
    torch.manual_seed(3)
    routed = gradients_of_update(model)
    for name in parameters:
        torch.testing.assert_close(routed[name], expected[name], rtol=1e-4, atol=1e-7)


@pytest.mark.parametrize(("missing", "direction"), [(1.0, 1), (-1.0, -1)])
def test_a_learned_temperature_rises_where_entropy_is_missing_and_falls_where_there_is_too_much(missing, direction):
    model = collect(make(HemisphericSAC))
    with torch.no_grad():
        _, log_prob = model.policy.actor.action_log_prob(torch.from_numpy(model._last_obs))
    model.target_entropy = -log_prob.mean().item() + 5 * missing
    update(model)
    step = model.log_ent_coef.item() - math.log(TEMPERATURE)
    assert step * direction == pytest.approx(model.learning_rate, rel=1e-2), "Adam's first step"


def test_a_given_temperature_stays():
    model = make_model(HemisphericSAC, ent_coef=0.2).learn(80)
    assert model.log_ent_coef is None
    assert model.ent_coef_tensor.item() == pytest.approx(0.2)
    assert model.logger.name_to_value["train/ent_coef"] == pytest.approx(0.2)


@pytest.mark.parametrize("algorithm", OFF_POLICY)
def test_a_warm_up_trains_the_critics_alone(algorithm):
    model = collect(
        make_model(algorithm, critic_warm_up=4, **({} if algorithm is HemisphericSAC else {"policy_delay": 1}))
    )
    before = weights(model)
    model.train(gradient_steps=4, batch_size=20)
    moved = changed(model, before)
    assert moved
    assert all(name.startswith(("critic.", "critic_target.")) for name in moved)
    model.train(gradient_steps=1, batch_size=20)
    assert any(name.startswith("actor.network.") for name in changed(model, before))
