"""HemisphericSAC and HemisphericTD3: what is stored, what the critics are trained towards, and when targets follow."""

import numpy as np
import pytest
import torch
from hemispheric_models import (
    MIX,
    N_STEPS,
    OFF_POLICY,
    ROLLOUT,
    RandomEnds,
    Recorder,
    arm,
    collect,
    gradients_of_update,
    make_model,
    optimizers,
    update,
    weights,
)
from stable_baselines3.common.vec_env import DummyVecEnv

from bilateral_rl.algorithms import HemisphericSAC, HemisphericTD3
from bilateral_rl.vocabulary import SIDES

GAMMA, TEMPERATURE = 0.9, 0.3


@pytest.mark.parametrize("algorithm", OFF_POLICY)
@pytest.mark.parametrize("loss", ["specialized", "combined"])
def test_what_is_stored_is_what_happened(algorithm, loss):
    """The last observation of a trial, not the next trial's first; an end only where a trial was terminated."""
    env = Recorder(DummyVecEnv([RandomEnds] * 3))
    model = collect(make_model(algorithm, env=env, loss=loss, reward_scale=0.5))
    buffer, before, ends = model.replay_buffer, env.starts[-1], []
    for t, (after, pair, dones, infos) in enumerate(env.steps):
        actions = 2 * env.actions[t] / 3 - 1  # of a Box(0, 3)
        for i in range(3):
            assert buffer.observations[t, i].tolist() == before[i].tolist()
            np.testing.assert_allclose(buffer.actions[t, i], actions[i], atol=1e-6)
            np.testing.assert_allclose(buffer.rewards[t, i], 0.5 * np.array(MIX[loss]) @ pair[i], rtol=1e-5, atol=1e-6)
            last = infos[i]["terminal_observation"] if dones[i] else after[i]
            assert buffer.next_observations[t, i].tolist() == last.tolist()
            terminated = dones[i] and not infos[i]["TimeLimit.truncated"]
            assert buffer.dones[t, i] * (1 - buffer.timeouts[t, i]) == terminated
            ends.append((bool(dones[i]), bool(terminated)))
        before = after
    assert buffer.pos == N_STEPS
    assert set(ends) == {(False, False), (True, False), (True, True)}


def blend_in_noise(module, seed=0):
    """Moves the targets away from what they follow."""
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in module.parameters():
            parameter.add_(0.1 * torch.randn(parameter.shape, generator=generator))


def critic_losses(model, batch, seed):
    """Each stream's loss of its critics, and their mean value, number by number from the formulas."""
    policy, n_critics = model.policy, model.policy.n_critics
    torch.manual_seed(seed)
    with torch.no_grad():
        if isinstance(model, HemisphericSAC):
            torch.randn(batch.actions.shape)  # the actions of the observations themselves come first
            mean, std = policy.motor_network(batch.next_observations) / 2, policy.actor.log_std.exp()
            latent = mean + std * torch.randn(mean.shape)
            action = torch.tanh(latent)
            squashing = torch.log(1 - action**2 + 1e-6)
            entropy = -(torch.distributions.Normal(mean, std).log_prob(latent) - squashing).sum(dim=1)
        else:
            noise = (model.target_policy_noise * torch.randn(batch.actions.shape)).clamp(
                -model.target_noise_clip, model.target_noise_clip
            )
            target_network = policy.actor_target.network
            action = (torch.tanh(target_network(batch.next_observations) / 2) + noise).clamp(-1, 1)
            entropy = torch.zeros(len(action))
    losses, values = [], []
    for stream in range(policy.n_streams):
        streams_critics = range(stream * n_critics, (stream + 1) * n_critics)
        loss = 0.0
        for row in range(len(batch.rewards)):
            after = torch.cat([batch.next_observations[row], action[row]])
            with torch.no_grad():
                smallest = min(policy.critic_target.q_networks[k](after).item() for k in streams_critics)
            goes_on = 1 - batch.dones[row].item()
            target = batch.rewards[row, stream] + goes_on * GAMMA * (smallest + TEMPERATURE * entropy[row])
            now = torch.cat([batch.observations[row], batch.actions[row]])
            predicted = [policy.critic.q_networks[k](now) for k in streams_critics]
            loss = loss + sum((value - target).square() for value in predicted)
            values.append((stream, torch.cat(predicted).mean().item()))
        factor = 0.5 if isinstance(model, HemisphericSAC) else 1.0
        losses.append(factor * loss.squeeze() / len(batch.rewards))
    means = [np.mean([value for s, value in values if s == stream]) for stream in range(policy.n_streams)]
    return losses, means


@pytest.mark.parametrize(
    ("algorithm", "settings", "loss", "n_critics"),
    [
        (HemisphericSAC, {"ent_coef": TEMPERATURE}, "specialized", 3),
        (HemisphericSAC, {"ent_coef": f"auto_{TEMPERATURE}"}, "specialized", 2),
        (HemisphericSAC, {"ent_coef": f"auto_{TEMPERATURE}"}, "combined", 1),
        (HemisphericTD3, {}, "specialized", 3),
        (HemisphericTD3, {"target_policy_noise": 2.0, "target_noise_clip": 0.1}, "specialized", 2),
        (HemisphericTD3, {}, "combined", 1),
    ],
)
def test_critics_are_trained_towards_their_streams_target(monkeypatch, algorithm, settings, loss, n_critics):
    env = DummyVecEnv([RandomEnds] * 3)
    policy_kwargs = {"n_critics": n_critics, "critic_arch": (8, 8)}
    model = collect(make_model(algorithm, env=env, loss=loss, gamma=GAMMA, policy_kwargs=policy_kwargs, **settings))
    blend_in_noise(model.policy.critic_target)
    if algorithm is HemisphericTD3:
        blend_in_noise(model.policy.actor_target)
    batch = model.replay_buffer.sample(20)
    assert 0 < batch.dones.sum() < 20
    monkeypatch.setattr(model.replay_buffer, "sample", lambda *_, **__: batch)
    losses, values = critic_losses(model, batch, seed=4)
    torch.manual_seed(4)
    routed = gradients_of_update(model)
    for stream, name in enumerate(SIDES if loss == "specialized" else ["combined"]):
        assert model.logger.name_to_value[f"critic_loss/{name}"] == pytest.approx(losses[stream].item(), rel=1e-4)
        assert model.logger.name_to_value[f"value/{name}"] == pytest.approx(values[stream], rel=1e-3, abs=1e-5)
        for k in range(stream * n_critics, (stream + 1) * n_critics):
            for part, parameter in model.policy.critic.q_networks[k].named_parameters():
                (expected,) = torch.autograd.grad(losses[stream], parameter, retain_graph=True)
                torch.testing.assert_close(routed[f"critic.qf{k}.{part}"], expected, rtol=1e-4, atol=1e-6)


def test_the_noise_on_td3s_target_actions_is_clipped_and_stays_within_the_commands():
    model = collect(make_model(HemisphericTD3, target_policy_noise=2.0, target_noise_clip=0.3))
    with torch.no_grad():
        model.policy.actor_target.network.output.bias[:3] = 5.0  # commands near their bound
    seen = []
    model.policy.critic_target.register_forward_pre_hook(lambda _, inputs: seen.append(inputs))
    update(model)
    ((observations, actions, _),) = seen
    with torch.no_grad():
        moved = actions - model.policy.actor_target(observations)
    assert actions.abs().max() <= 1.0
    assert moved.abs().max() <= 0.3 + 1e-2, "the targets have followed a little since"
    assert (moved[:, 3:].abs() > 0.29).float().mean() > 0.5, "most noise is beyond the clip"


def count_steps(optimizer):
    steps = []
    optimizer.register_step_post_hook(lambda *_: steps.append(1))
    return steps


@pytest.mark.parametrize("gradient_steps", [1, 7])
def test_td3s_network_and_targets_move_every_policy_delay_updates_of_the_critics(gradient_steps):
    model = collect(make_model(HemisphericTD3, policy_delay=3))
    actor, critic = (count_steps(optimizer) for optimizer in optimizers(model))
    for _ in range(7 // gradient_steps):
        before = weights(model)
        model.train(gradient_steps, 20)
        moves = {name for name, value in weights(model).items() if not torch.equal(value, before[name])}
        assert any(name.startswith("critic.") for name in moves)
        due = gradient_steps == 7 or model._n_updates % 3 == 0
        for kind in ("actor.", "actor_target.", "critic_target."):
            assert any(name.startswith(kind) for name in moves) == due
    assert (len(actor), len(critic)) == (2, 7)


@pytest.mark.parametrize("gradient_steps", [1, 7])
def test_sacs_network_and_temperature_move_every_policy_delay_updates_and_its_targets_with_the_critics(gradient_steps):
    model = collect(make_model(HemisphericSAC, policy_delay=3))
    actor, critic = (count_steps(optimizer) for optimizer in optimizers(model)[:2])
    temperature = count_steps(model.ent_coef_optimizer)
    for _ in range(7 // gradient_steps):
        before, log_ent_coef = weights(model), model.log_ent_coef.item()
        model.train(gradient_steps, 20)
        moves = {name for name, value in weights(model).items() if not torch.equal(value, before[name])}
        due = gradient_steps == 7 or model._n_updates % 3 == 0
        assert (model.log_ent_coef.item() != log_ent_coef) == due
        for kind, moved in (("critic.", True), ("critic_target.", True), ("actor.", due)):
            assert any(name.startswith(kind) for name in moves) == moved
    assert (len(actor), len(critic), len(temperature)) == (2, 7, 2)


@pytest.mark.parametrize("gradient_steps", [1, 7])
def test_sacs_targets_move_every_target_update_interval_updates(gradient_steps):
    model = collect(make_model(HemisphericSAC, target_update_interval=3))
    follow, followed = model._follow, []
    model._follow = lambda *networks: (followed.append(model._n_updates), follow(*networks))
    before = weights(model)
    for _ in range(7 // gradient_steps):
        model.train(gradient_steps, 20)
    assert followed == [3, 6]
    assert not any(torch.equal(v, before[name]) for name, v in weights(model).items() if "critic_target" in name)


@pytest.mark.parametrize("algorithm", OFF_POLICY)
def test_targets_follow_by_tau(algorithm):
    tau = 0.3
    model = collect(make_model(algorithm, tau=tau, learning_rate=0.01))
    blend_in_noise(model.policy.critic_target)
    before = weights(model)
    update(model)
    after, kinds = weights(model), {"critic_target"} | ({"actor_target"} if algorithm is HemisphericTD3 else set())
    for name, target in after.items():
        if name.split(".")[0] in kinds:
            network = after[name.replace("_target", "")]
            torch.testing.assert_close(target, (1 - tau) * before[name] + tau * network, rtol=1e-5, atol=1e-7)
    assert any(name.startswith("actor_target") for name in after) == (algorithm is HemisphericTD3)


@pytest.mark.parametrize("algorithm", OFF_POLICY)
def test_a_saved_replay_buffer_comes_back_with_its_streams(tmp_path, algorithm):
    model, other = collect(make_model(algorithm)), collect(make_model(algorithm))
    model.save_replay_buffer(tmp_path / "replay.pkl")
    other.replay_buffer = None
    other.load_replay_buffer(tmp_path / "replay.pkl")
    stored = other.replay_buffer.rewards[:N_STEPS]
    np.testing.assert_array_equal(stored, model.replay_buffer.rewards[:N_STEPS])
    assert stored.shape == (N_STEPS, 4, 2)
    assert (stored[..., 0] != stored[..., 1]).any()
    update(other)


@pytest.mark.parametrize("algorithm", OFF_POLICY)
def test_a_buffer_smaller_than_the_training_keeps_the_last_steps(algorithm):
    env = Recorder(arm())
    model = make_model(algorithm, env=env, buffer_size=40, learning_starts=0)
    model.learn(ROLLOUT + 12)
    buffer = model.replay_buffer
    assert (len(env.steps), buffer.full, buffer.pos) == (24, True, 4)  # 23 steps, rounded up to whole fours
    order = [*range(4, 10), *range(4)]
    np.testing.assert_allclose(buffer.rewards[order], [step[1] for step in env.steps[-10:]], rtol=1e-6)
