"""What SAC's and TD3's critics see is standardized, which value the network follows, and streams of one scale."""

import numpy as np
import pytest
import torch
from hemispheric_models import (
    OFF_POLICY,
    STOCK,
    arm,
    collect,
    gradients_of_update,
    make_model,
    names_by_group,
    update,
    weights,
)

from bilateral_rl.algorithms import HemisphericTD3
from bilateral_rl.algorithms.stream_scale import StreamScale

each_algorithm = pytest.mark.parametrize("algorithm", OFF_POLICY)


@each_algorithm
def test_inputs_are_standardized_by_the_steps_before_the_first_update(algorithm):
    model = collect(make_model(algorithm, standardize_inputs=True, action_traces=(0.5,)))
    steps = model.replay_buffer.kept(10**6)
    update(model)
    for critics in (model.policy.critic, model.policy.critic_target):
        inputs = critics.inputs(steps.observations, steps.traces)
        assert inputs.shape == (80, 23)
        torch.testing.assert_close(inputs.mean(dim=0), torch.zeros(23), atol=1e-4, rtol=0)
        stds = inputs.std(dim=0)
        varies = torch.cat([steps.observations, steps.traces], dim=1).std(dim=0) > 1e-6
        torch.testing.assert_close(stds[varies], torch.ones(int(varies.sum())), atol=1e-3, rtol=0)
        assert (stds[~varies] < 1e-5).all()
    measured = {name: value for name, value in weights(model).items() if "input_" in name}
    update(collect(model))
    assert all(torch.equal(value, weights(model)[name]) for name, value in measured.items()), "once and for all"
    assert len(measured) == 4


@each_algorithm
def test_what_is_standardized_comes_back_with_a_saved_model(algorithm, tmp_path):
    settings = {"standardize_inputs": True, "normalize_streams": True, "action_traces": (0.5,)}
    model = make_model(algorithm, **settings).learn(80)
    model.save(tmp_path / "model")
    loaded = algorithm.load(tmp_path / "model", env=arm(), device="cpu")
    for name, value in weights(model).items():
        assert torch.equal(weights(loaded)[name], value), name
    assert model.stream_scale.mean_square.all()
    assert torch.equal(loaded.stream_scale.mean_square, model.stream_scale.mean_square)
    loaded.learn(40)
    with pytest.raises(ValueError, match="a saved model keeps it"):
        algorithm.load(tmp_path / "model", standardize_inputs=False, device="cpu")


@each_algorithm
def test_a_model_saved_before_there_were_these_settings_loads(algorithm, tmp_path):
    model = make_model(algorithm, loss="combined", seed=0).learn(60)
    for name in ("action_traces", "standardize_inputs", "actor_value", "normalize_streams", "_last_traces"):
        del vars(model)[name]
    model.policy_kwargs = {"n_streams": 1}
    model.save(tmp_path / "model")
    loaded = algorithm.load(tmp_path / "model", env=arm(), device="cpu")
    assert loaded.actor_value == ("first" if algorithm is HemisphericTD3 else "min")
    loaded.learn(60, reset_num_timesteps=False)
    stock = STOCK[algorithm]("CallosalPolicy", arm(), learning_starts=20, device="cpu")
    assert {*stock.policy.state_dict()} == {*loaded.policy.state_dict()}


@pytest.mark.parametrize("value", ["min", "mean", "first"])
@each_algorithm
def test_the_network_follows_the_chosen_value(algorithm, value):
    """Its gradient is that of the value by finite differences of a read-out bias."""
    settings = {} if algorithm is HemisphericTD3 else {"ent_coef": 1e-9}
    model = collect(make_model(algorithm, actor_value=value, loss="dominant", weight_penalty=0.0, **settings))
    policy, batch = model.policy, model.replay_buffer.sample(40)
    model.replay_buffer.sample = lambda *_, **__: batch
    with torch.no_grad():  # no noise, and critics that the update leaves alone
        if algorithm is not HemisphericTD3:
            policy.actor.log_std.fill_(-20.0)
    model.critic.optimizer.step = lambda *_: None
    routed = gradients_of_update(model)
    name = "actor.network.output.bias"
    bias = policy.motor_network.output.bias

    def mean_value():
        observations = batch.observations.double()
        inputs = torch.cat([observations, torch.tanh(policy.motor_network(observations) / 2)], dim=1)
        values = torch.cat([network(inputs) for network in policy.critic.q_networks], dim=1)
        chosen = {"min": values.amin(dim=1), "mean": values.mean(dim=1), "first": values[:, 0]}[value]
        return chosen.mean().item()

    policy.double()
    for j in range(6):
        with torch.no_grad():
            bias[j] += 1e-5
            up = mean_value()
            bias[j] -= 2e-5
            down = mean_value()
            bias[j] += 1e-5
        assert routed[name][j].item() == pytest.approx(-(up - down) / 2e-5, rel=2e-3, abs=1e-7)


def test_an_unknown_value_is_refused(tmp_path):
    with pytest.raises(ValueError, match="actor_value must be one of min, mean, first, not 'max'"):
        make_model(HemisphericTD3, actor_value="max")
    make_model(HemisphericTD3).save(tmp_path / "model")
    with pytest.raises(ValueError, match="actor_value must be one of min, mean, first, not 'max'"):
        HemisphericTD3.load(tmp_path / "model", actor_value="max", device="cpu")


@each_algorithm
def test_a_replay_buffer_saved_before_there_were_traces_goes_on(algorithm, tmp_path):
    model = make_model(algorithm, seed=0).learn(60)
    for name in ("traces", "action_traces"):
        del vars(model.replay_buffer)[name]
    model.save_replay_buffer(tmp_path / "buffer")
    model.load_replay_buffer(tmp_path / "buffer")
    kept = model.replay_buffer.pos
    model.learn(40, reset_num_timesteps=False)
    assert model.replay_buffer.pos > kept


def test_the_scale_of_streams_is_a_running_root_mean_square():
    scale, total, weight = StreamScale(2), np.zeros(2), 0.0
    generator = torch.Generator().manual_seed(0)
    for _ in range(5):
        gradients = torch.randn(2, 8, 3, generator=generator) * torch.tensor([1.0, 7.0])[:, None, None]
        scale.update(gradients)
        total = 0.999 * total + 0.001 * (gradients.numpy() ** 2).sum(axis=2).mean(axis=1)
        weight = 0.999 * weight + 0.001
    np.testing.assert_allclose(scale.root_mean_square(), np.sqrt(total / weight), rtol=1e-3)


@each_algorithm
def test_normalized_streams_are_divided_by_their_scale_and_so_is_the_penalty(algorithm):
    """A louder stream moves its side no more than before, and the penalty keeps its weight in the stream's loss."""
    arguments = {"weight_penalty": 0.01, "policy_kwargs": {"units": 8}}
    arguments |= {} if algorithm is HemisphericTD3 else {"ent_coef": 1e-9}
    routed, scales = [], []
    for normalize in (False, True):
        model = collect(make_model(algorithm, normalize_streams=normalize, **arguments))
        batch = model.replay_buffer.sample(40)
        model.replay_buffer.sample = lambda *_, batch=batch, **__: batch
        torch.manual_seed(0)
        routed.append(gradients_of_update(model))
        scales.append(model.stream_scale.root_mean_square().tolist())
    groups = names_by_group(model)
    for stream, group in enumerate(("dominant", "non_dominant")):
        for name in groups[group]:
            torch.testing.assert_close(
                routed[1][name], routed[0][name] / scales[1][stream], rtol=1e-4, atol=1e-6, msg=name
            )
