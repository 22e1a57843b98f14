"""Noise on hidden units: where it enters a network, what it is drawn from, and who can train with it."""

import copy

import numpy as np
import pytest
import torch
from hemispheric_models import STOCK, arm, make_model
from stable_baselines3 import A2C, PPO, SAC, TD3

from bilateral_rl.policies import ARCHITECTURES, make_network
from bilateral_rl.policies.hidden_noise import HiddenNoise
from bilateral_rl.policies.lesions import LESIONS, NO_LESION

NOISY = {"hidden_noise": 0.3}
architectures = pytest.mark.parametrize("architecture", ARCHITECTURES)


@architectures
def test_noise_is_added_to_activity_before_callosum_and_next_layer(architecture, random_network, reference_forward):
    network = random_network(architecture, layers=3, units=12)
    generator = np.random.default_rng(0)
    observation = generator.uniform(-1, 1, (7, 16)).astype(np.float32)
    noise = generator.normal(0, 0.5, (7, *network.hidden_shape)).astype(np.float32)
    by_unit = noise.reshape(7, 3, network.sides, -1)  # layer by layer, in each the dominant side first
    for name in ("intact", *network.available_lesions()):
        with network.lesioned(name), torch.no_grad():
            output = network(torch.from_numpy(observation), torch.from_numpy(noise)).numpy()
        expected = reference_forward(network, observation, LESIONS.get(name, NO_LESION), by_unit)
        np.testing.assert_allclose(output, expected, rtol=0, atol=2e-6, err_msg=name)


@architectures
def test_no_noise_and_noise_of_zeros_are_the_same_bits(architecture, random_network):
    network, observation = random_network(architecture), torch.linspace(-1, 1, 48).reshape(3, 16)
    zeros = torch.zeros(3, *network.hidden_shape)
    assert torch.equal(network(observation), network(observation, zeros))
    assert torch.equal(network.excitation(observation), network.excitation(observation, zeros))
    assert network.noise.draw(3) is None


def test_a_side_that_is_lesioned_deeply_has_no_part_in_the_commands_whatever_its_noise(random_network):
    network, observation = random_network("bilateral"), torch.linspace(-1, 1, 48).reshape(3, 16)
    noise = torch.zeros(3, *network.hidden_shape)
    noise[:, 1::2] = 0.7  # of the non-dominant side
    with network.lesioned("deep_non_dominant"):
        assert torch.equal(network(observation), network(observation, noise))
    with network.lesioned("deep_dominant"):
        assert not torch.equal(network(observation), network(observation, noise))


def test_the_noise_is_normal_and_of_its_standard_deviation():
    noise = HiddenNoise(0.3, (4, 5))
    noise.seed(0)
    drawn = noise.draw(10_000)
    assert drawn.shape == (10_000, 4, 5)
    assert drawn.dtype == torch.float32
    # Mean, variance and fourth moment of 200,000 normal numbers, within five standard errors.
    z = drawn.double() / 0.3
    for moment, expected, error in ((1, 0, 1), (2, 1, 2**0.5), (4, 3, 96**0.5)):
        assert abs(float((z**moment).mean()) - expected) < 5 * error / 200_000**0.5
    correlation = np.corrcoef(z.reshape(10_000, 20).numpy().T)
    assert np.abs(correlation - np.eye(20)).max() < 0.05


def test_a_stream_begins_anew_by_its_seed_and_leaves_torchs_alone():
    noise, other = HiddenNoise(1.0, (2, 3)), HiddenNoise(1.0, (2, 3))
    before = torch.get_rng_state()
    noise.seed(5)
    first = torch.stack([noise.draw(4) for _ in range(3)])
    noise.seed(5)
    assert torch.equal(first, torch.stack([noise.draw(4) for _ in range(3)]))
    other.seed(6)
    assert not torch.equal(first[0], other.draw(4))
    assert torch.equal(torch.get_rng_state(), before)
    torch.manual_seed(1)
    unseeded = HiddenNoise(1.0, (2, 3)).draw(4)
    torch.manual_seed(1)
    assert torch.equal(unseeded, HiddenNoise(1.0, (2, 3)).draw(4))


def test_trials_have_noise_of_their_own_and_the_stream_goes_on_as_if_there_had_been_none():
    noise = HiddenNoise(1.0, (2, 3))

    def of(seeds, steps=40):
        with noise.of_trials(seeds):
            return torch.stack([noise.draw(len(seeds)) for _ in range(steps)], dim=1)

    noise.seed(5)
    noise.draw(2)
    expected = noise.draw(2)
    noise.seed(5)
    noise.draw(2)
    first = of([7, 8, 9])
    assert torch.equal(first, of([7, 8, 9]))
    assert torch.equal(first[1:], of([8, 9])), "whatever trials it is done with"
    assert len(set(first.flatten().tolist())) == first.numel(), "no number comes twice"
    with noise.of_trials([1, 2]), pytest.raises(ValueError, match="2 trials with noise of their own, and 3 samples"):
        noise.draw(3)
    assert torch.equal(noise.draw(2), expected)


def test_a_copy_of_a_network_has_a_stream_of_its_own_that_goes_on_alike():
    network = make_network("callosal", 16, 6, **NOISY)
    network.noise.seed(0)
    network.noise.draw(2)
    twin = copy.deepcopy(network)
    assert torch.equal(twin.noise.draw(2), network.noise.draw(2))
    twin.noise.seed(1)
    assert not torch.equal(twin.noise.draw(2), network.noise.draw(2))


@pytest.mark.parametrize("algorithm", [*STOCK, PPO, A2C, SAC, TD3])
def test_a_model_acts_by_noise_also_deterministically_and_keeps_it_when_saved(tmp_path, algorithm):
    observations = np.linspace(-1, 1, 64, dtype=np.float32).reshape(4, 16)
    model = make_model(algorithm, policy_kwargs=dict(NOISY))
    first, second = (model.predict(observations, deterministic=True)[0] for _ in range(2))
    assert not np.array_equal(first, second)
    again = make_model(algorithm, policy_kwargs=dict(NOISY))
    assert np.array_equal(again.predict(observations, deterministic=True)[0], first), "the seed tells the noise"
    model.save(tmp_path / "model.zip")
    loaded = algorithm.load(tmp_path / "model.zip", device="cpu")
    assert loaded.policy.motor_network.noise.std == 0.3
    assert make_model(algorithm).policy.motor_network.noise.std == 0


@pytest.mark.parametrize("algorithm", [PPO, A2C])
def test_stock_algorithms_that_would_forget_the_noise_are_refused_at_once(algorithm):
    model = make_model(algorithm, policy_kwargs=dict(NOISY))
    with pytest.raises(ValueError, match=r"forget the noise .*: train by HemisphericPPO or HemisphericA2C"):
        model.learn(80)
    assert model.num_timesteps == 0
    with pytest.raises(ValueError, match="forget the noise"):
        model.policy.evaluate_actions(torch.zeros(2, 16), torch.zeros(2, 6))


@pytest.mark.parametrize("algorithm", [SAC, TD3])
def test_stock_algorithms_that_draw_anew_learn_with_noise(algorithm):
    def trained(**kwargs):
        model = make_model(algorithm, policy_kwargs=kwargs).learn(80)
        return torch.cat([p.flatten() for p in model.policy.actor.network.parameters()])

    noisy = trained(**NOISY)
    assert torch.equal(noisy, trained(**NOISY))
    assert not torch.equal(noisy, trained())


def test_an_actor_and_its_target_never_have_the_same_noise():
    policy = make_model(TD3, policy_kwargs=dict(NOISY), env=arm()).policy
    assert policy.actor_target.network.noise is policy.actor.network.noise
