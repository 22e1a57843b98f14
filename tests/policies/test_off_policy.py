"""The policies for SAC and TD3: sampled actions with their density, critics by stream, targets."""

import numpy as np
import pytest
import torch
from gymnasium import spaces

from bilateral_rl.policies import SAC_ALIASES, TD3_ALIASES, BilateralSACPolicy, BilateralTD3Policy

MUSCLES = spaces.Box(-1.0, 1.0, (6,))
kinds = pytest.mark.parametrize("kind", [BilateralSACPolicy, BilateralTD3Policy])


def make_policy(kind=SAC_ALIASES["CallosalPolicy"], actions=MUSCLES, **kwargs):
    return kind(spaces.Box(-1.0, 1.0, (16,)), actions, lambda _: 1e-3, **kwargs)


def observations(n=32):
    return torch.from_numpy(np.random.default_rng(0).uniform(-1, 1, (n, 16)).astype(np.float32))


def test_log_prob_is_the_density_of_the_squashed_gaussian():
    """The change of variables, from the network's output and the standard deviation."""
    policy, obs = make_policy(log_std_init=-0.7), observations(200)
    with torch.no_grad():
        actions, log_prob = policy.actor.action_log_prob(obs)
        mean = policy.motor_network(obs).double() / 2
        latent = torch.atanh(actions.double())
        gaussian = torch.distributions.Normal(mean, np.exp(-0.7)).log_prob(latent)
        density = gaussian - torch.log1p(-(actions.double() ** 2))
    assert log_prob.shape == (200,)
    torch.testing.assert_close(log_prob.double(), density.sum(dim=1), rtol=1e-3, atol=1e-3)


def test_sampled_actions_are_spread_around_the_networks_output_before_the_squashing():
    policy, obs = make_policy(log_std_init=-1.0), observations(1).expand(4000, -1)
    with torch.no_grad():
        sampled = policy.actor(obs, deterministic=False)
        mean = policy.motor_network(obs[:1]) / 2
    latent = torch.atanh(sampled)
    torch.testing.assert_close(latent.mean(dim=0), mean[0], rtol=0, atol=0.03)
    torch.testing.assert_close(latent.std(dim=0), torch.full((6,), np.exp(-1.0)), rtol=0.05, atol=0)


@pytest.mark.parametrize(("log_std", "bounded"), [(9.0, 2.0), (-30.0, -20.0), (0.5, 0.5)])
def test_the_standard_deviation_is_bounded_as_in_sb3(log_std, bounded):
    policy, obs = make_policy(log_std_init=log_std), observations()
    expected = make_policy(log_std_init=bounded)
    expected.load_state_dict(policy.state_dict() | {"actor.log_std": torch.full((6,), bounded)})
    results = []
    for each in (policy, expected):
        torch.manual_seed(0)
        with torch.no_grad():
            results.append(each.actor.action_log_prob(obs))
    for mine, other in zip(*results, strict=True):
        assert torch.equal(mine, other)


def test_td3s_policy_is_deterministic():
    policy = make_policy(TD3_ALIASES["CallosalPolicy"])
    assert not policy.actor.is_stochastic
    assert not any("log_std" in name for name in policy.state_dict())
    obs = observations().numpy()
    np.testing.assert_array_equal(policy.predict(obs)[0], policy.predict(obs, deterministic=True)[0])


@kinds
@pytest.mark.parametrize(("n_streams", "n_critics"), [(1, 2), (3, 4)])
def test_each_streams_critics_stand_together(kind, n_streams, n_critics):
    policy, obs = make_policy(kind, n_streams=n_streams, n_critics=n_critics), observations()
    actions = torch.tanh(torch.randn(32, 6))
    with torch.no_grad():
        values = torch.cat(policy.critic(obs, actions), dim=1)
        by_stream = actions.repeat(n_streams, 1, 1)
        first, every = (policy.critic.values_by_stream(obs, by_stream, None, n_critics, n) for n in (1, n_critics))
    assert values.shape == (32, n_streams * n_critics)
    torch.testing.assert_close(first[..., 0], values[:, ::n_critics])
    torch.testing.assert_close(every, policy.stream_values(policy.critic, obs, actions))
    torch.testing.assert_close(every.flatten(1), values)
    for stream in range(n_streams):
        names = {f"qf{stream * n_critics + k}" for k in range(n_critics)}
        owned = {id(p) for p in policy.parameter_groups()[f"critic_{stream}"]}
        assert owned == {id(p) for name, p in policy.critic.named_parameters() if name.split(".")[0] in names}


@kinds
def test_targets_begin_as_what_they_follow_and_belong_to_no_group(kind):
    policy = make_policy(kind, n_streams=2)
    grouped = {id(p) for group in policy.parameter_groups().values() for p in group}
    followed = [(policy.critic, policy.critic_target)]
    followed += [(policy.actor, policy.actor_target)] if kind is BilateralTD3Policy else []
    for network, target in followed:
        for parameter, other in zip(network.parameters(), target.parameters(), strict=True):
            assert torch.equal(parameter, other)
            assert id(parameter) in grouped
            assert id(other) not in grouped


@kinds
def test_the_critics_size_follows_its_argument(kind):
    critic = make_policy(kind, critic_arch=(8, 4)).critic
    widths = [layer.out_features for layer in critic.q_networks[0] if isinstance(layer, torch.nn.Linear)]
    assert widths == [8, 4, 1]
