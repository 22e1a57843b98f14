"""The policies for PPO and A2C: densities of given actions, values of streams."""

import numpy as np
import pytest
import torch
from gymnasium import spaces
from hemispheric_models import LearnedFeatures

from bilateral_rl.policies import CallosalPolicy


def make_policy(**kwargs):
    return CallosalPolicy(spaces.Box(-1.0, 1.0, (16,)), spaces.Box(-1.0, 1.0, (6,)), lambda _: 1e-3, **kwargs)


def observations(n=32):
    return torch.from_numpy(np.random.default_rng(0).uniform(-1, 1, (n, 16)).astype(np.float32))


@pytest.mark.parametrize("n_streams", [1, 2])
def test_evaluate_actions_agrees_with_the_forward_pass(n_streams):
    policy, obs = make_policy(n_streams=n_streams, log_std_init=-0.7), observations(200)
    with torch.no_grad():
        actions, values, log_prob = policy(obs)
        values_again, log_prob_again, entropy = policy.evaluate_actions(obs, actions)
        predicted = policy.predict_values(obs)
    assert values.shape == values_again.shape == predicted.shape == (200, 1)
    torch.testing.assert_close(values_again, values)
    torch.testing.assert_close(predicted, values)
    torch.testing.assert_close(log_prob_again, log_prob, rtol=1e-4, atol=1e-4)
    assert entropy is None, "a squashed Gaussian's entropy has no closed form"


def test_log_prob_is_the_density_of_the_squashed_gaussian():
    """The change of variables, from the network's output and the standard deviation."""
    policy, obs = make_policy(log_std_init=-0.7), observations(200)
    with torch.no_grad():
        actions, _, log_prob = policy(obs)
        mean = policy.motor_network(obs).double() / 2
        latent = torch.atanh(actions.double())
        gaussian = torch.distributions.Normal(mean, np.exp(-0.7)).log_prob(latent)
        density = gaussian - torch.log1p(-(actions.double() ** 2))
    torch.testing.assert_close(log_prob.double(), density.sum(dim=1), rtol=1e-3, atol=1e-3)


def test_the_scalar_value_is_the_mean_of_the_streams():
    policy, obs = make_policy(n_streams=2), observations()
    with torch.no_grad():
        streams = policy.predict_stream_values(obs)
        torch.testing.assert_close(policy.predict_values(obs), streams.mean(dim=1, keepdim=True))
        torch.testing.assert_close(policy(obs)[1], streams.mean(dim=1, keepdim=True))
    assert streams.shape == (32, 2)
    assert not torch.allclose(streams[:, 0], streams[:, 1])


@pytest.mark.parametrize("share", [True, False])
def test_values_see_the_features_of_their_extractor(share):
    kwargs = {"features_extractor_class": LearnedFeatures, "share_features_extractor": share, "n_streams": 2}
    policy, obs = make_policy(**kwargs), observations()
    policy.set_training_mode(False)
    features = policy.vf_features_extractor(obs)
    expected = torch.cat([critic(features) for critic in policy.mlp_extractor.critics], dim=1)
    torch.testing.assert_close(policy.predict_stream_values(obs), expected)
    torch.testing.assert_close(policy.predict_values(obs), expected.mean(dim=1, keepdim=True))
