"""The noise of rollouts: of the size that settings say, and a function of seed, purpose, epoch and batch."""

import itertools
from types import SimpleNamespace

import torch

from bilateral_rl.bptt.conditions import Conditions
from bilateral_rl.bptt.noise import draw_noise
from bilateral_rl.bptt.workers import Workers
from bilateral_rl.envs import TrialSettings

SETTINGS = TrialSettings(length_noise=0.5, velocity_noise=0.25, vision_noise=0.01, motor_noise=0.1)
NOISY = Conditions(settings=SETTINGS, hidden_noise=0.2)


def noise(seeds, *moment, purpose="training", conditions=NOISY, n_trials=8):
    """The noise of networks of some seeds: (S, B, T, 20), and that of hidden units (S, B, T, 4, 2)."""
    shape = (len(seeds), n_trials, 8)
    rollout = SimpleNamespace(
        conditions=conditions,
        noise=torch.zeros(*shape, 20),
        hidden_noise=torch.zeros(*shape, 4, 2),
        share=Workers(2).share,
    )
    draw_noise(rollout, seeds, purpose, *moment)
    return rollout.noise, rollout.hidden_noise


def test_every_number_has_its_standard_deviation_and_none_goes_with_another():
    of_step, hidden = noise([3], n_trials=1000)
    columns = torch.cat([of_step.flatten(0, 2), hidden.flatten(0, 2).flatten(1)], dim=1)  # (8000, 28)
    scale = torch.tensor([*SETTINGS.noise_scale, *[0.2] * 8])
    standard = columns / scale
    assert standard.mean(0).abs().max() < 0.05
    assert (standard.T.cov() - torch.eye(28)).abs().max() < 0.07
    over_time = standard.view(1000, 8, 28)
    assert (over_time[:, 1:] * over_time[:, :-1]).mean((0, 1)).abs().max() < 0.05


def test_noise_comes_again_for_a_seed_a_purpose_and_a_batch_and_for_no_other():
    moments = [
        (purpose, *at) for purpose in ("training", "validation", "retraining") for at in ((0, 0), (0, 1), (1, 0))
    ]
    drawn = [noise([seed], *at, purpose=purpose) for seed, (purpose, *at) in itertools.product((0, 1), moments)]
    for part in range(2):
        assert len({float(each[part][0, 0, 0].flatten()[0]) for each in drawn}) == len(drawn)
    again = noise([1], 1, 0, purpose="retraining")
    assert all(torch.equal(*pair) for pair in zip(again, drawn[-1], strict=True))


def test_a_network_of_a_stack_has_the_noise_that_it_has_alone():
    together = noise([5, 2, 5], 3, 1)
    for index, seed in enumerate((5, 2, 5)):
        assert all(torch.equal(a[index], b[0]) for a, b in zip(together, noise([seed], 3, 1), strict=True))


def test_without_noise_nothing_is_drawn():
    of_step, hidden = noise([0], conditions=Conditions(settings=TrialSettings(vision_delay=2)))
    assert not of_step.any()
    assert not hidden.any()
