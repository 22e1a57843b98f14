"""Noise on hidden units in training: kept with the steps on-policy, drawn anew off-policy, none by default."""

import numpy as np
import pytest
import torch
from hemispheric_models import (
    ALGORITHMS,
    OFF_POLICY,
    ON_POLICY,
    WHOLE_ROLLOUT,
    changed,
    collect,
    make_model,
    weights,
)

from bilateral_rl.policies.hidden_noise import HiddenNoise


def noisy(algorithm, **kwargs):
    return make_model(algorithm, policy_kwargs={"hidden_noise": 0.2}, **kwargs)


@pytest.mark.parametrize("algorithm", ON_POLICY)
def test_actions_have_the_density_they_were_taken_with_until_the_first_update(algorithm):
    model = collect(noisy(algorithm))
    (batch,) = model.rollout_buffer.get()
    with torch.no_grad():
        log_ratio = model._log_prob(batch) - batch.old_log_prob
        torch.testing.assert_close(log_ratio, torch.zeros_like(log_ratio), rtol=0, atol=1e-5)
        other = model._log_prob(batch._replace(hidden_noise=batch.hidden_noise.roll(1, dims=0)))
    assert float((other - batch.old_log_prob).abs().mean()) > 0.01, "the noise matters"


@pytest.mark.parametrize("algorithm", ON_POLICY)
def test_every_step_of_every_arm_has_noise_of_its_own(algorithm):
    noise = collect(noisy(algorithm)).rollout_buffer.hidden_noise
    assert noise.shape == (20, 4, 4, 5)
    assert len(np.unique(noise)) == noise.size
    assert abs(noise.std() - 0.2) < 0.02


@pytest.mark.parametrize("algorithm", OFF_POLICY)
def test_gradients_go_through_fresh_noise(algorithm, monkeypatch):
    """Through actions with the noise that is drawn: the gradient by weights is that of finite differences."""
    model = collect(noisy(algorithm, policy="BilateralPolicy", **WHOLE_ROLLOUT[algorithm]))  # the callosum has kinks
    batch, network = model.replay_buffer.sample(40), model.policy.motor_network
    noise = torch.randn(40, *network.hidden_shape, generator=torch.Generator().manual_seed(1)) * 0.2
    monkeypatch.setattr(HiddenNoise, "draw", lambda *_: noise)
    actor, direction = model.policy.actor, torch.linspace(-1, 1, 6)

    def loss():
        return (actor(batch.observations, deterministic=True) * direction).sum(dim=1).mean()

    weight = network.dominant[0].weight
    (gradient,) = torch.autograd.grad(loss(), weight)
    numeric, step = torch.zeros_like(weight), 1e-2
    with torch.no_grad():
        for index in np.ndindex(*weight.shape):
            before = weight[index].item()
            values = []
            for sign in (1, -1):
                weight[index] = before + sign * step
                values.append(float(loss()))
            weight[index] = before
            numeric[index] = (values[0] - values[1]) / (2 * step)
    torch.testing.assert_close(gradient, numeric, rtol=1e-2, atol=2e-5)
    drawn, draw = [], HiddenNoise.draw
    monkeypatch.setattr(HiddenNoise, "draw", lambda *a: drawn.append(a[1]) or draw(*a))
    model.train(1, 40)
    assert drawn == [40, 40], "of the actions that are learned by, and of the next ones"


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_noise_shows_in_training_is_told_by_the_seed_and_zero_is_none(algorithm):
    def trained(**kwargs):
        model = make_model(algorithm, policy_kwargs=kwargs)
        model.learn(160)
        return model

    plain, loud = trained(), trained(hidden_noise=0.2)
    assert changed(loud, weights(trained(hidden_noise=0.2))) == set()
    assert changed(loud, weights(plain))
    assert changed(plain, weights(trained(hidden_noise=0.0))) == set()


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_seeding_a_model_anew_seeds_its_noise(algorithm):
    model, observations = noisy(algorithm), np.zeros((3, 16), dtype=np.float32)
    first = model.predict(observations, deterministic=True)[0]
    assert not np.array_equal(model.predict(observations, deterministic=True)[0], first)
    model.set_random_seed(0)
    assert np.array_equal(model.predict(observations, deterministic=True)[0], first)
