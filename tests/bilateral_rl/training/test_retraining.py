"""The epoch after a lesion: only the output layer adapts, by the combined loss, under the lesion."""

import itertools

import pytest
import torch

from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.trials import retraining_trials, training_trials
from bilateral_rl.config.hyperparameters import BPTTHyperparameters
from bilateral_rl.envs import TASKS, Arm
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.tasks import make_task
from bilateral_rl.policies.lesions import LESIONS, NO_LESION, RELEASED_LESIONS, find_lesion
from bilateral_rl.training.retraining import TRAINED, Retraining
from bilateral_rl.vocabulary import PENALTIES

TRIAL = TrialSettings(trial_length=12)
SETTINGS = BPTTHyperparameters(trials=24, batch_size=8)
CUT_WEIGHTS = {"cartesian_1": 2.5, "cartesian_2": 2.5, "activation": 1.0}
SEEDS = [3, 4]


def make(layout, task="random_reach", settings=SETTINGS, penalty="weights", coefficient=0.001, threads=1):
    return Retraining(layout, task, TRIAL, settings, penalty, coefficient, threads)


@pytest.fixture
def networks(random_networks):
    return random_networks("callosal", n=len(SEEDS), dtype=torch.float32)


@pytest.fixture
def rows(networks, rows_of):
    return rows_of(Layout(networks[0]), [dict(network.named_parameters()) for network in networks])


def by_name(layout, rows):
    return layout.unpack(rows)


def an_epoch_in_torch(network, seed, task, coefficient):
    """The output layer trained by autograd through ``Arm.step``, clipped by variable, with Keras's Adam."""
    trials = retraining_trials(seed, SETTINGS.trials, make_task(task), TRIAL)
    arm, output = Arm(TRIAL.arm), list(network.output.parameters())
    first, second = ([torch.zeros_like(p) for p in output] for _ in range(2))
    for step in range(1, SETTINGS.trials // SETTINGS.batch_size + 1):
        batch = slice((step - 1) * SETTINGS.batch_size, step * SETTINGS.batch_size)
        start, target, load = (part[batch] for part in trials)
        state, terms = arm.rest(start), 0.0
        for _ in range(TRIAL.trial_length):
            seen = torch.cat([arm.proprioception(state), state.cartesian[:, :2], target], dim=1)
            excitation = network.excitation(seen)
            state = arm.step(state, excitation, load)
            error = state.cartesian[:, :2] - target
            parts = (error.abs().mean(), 10 * error.square().mean(), excitation.square().mean())
            terms = terms + sum(w * part for w, part in zip(CUT_WEIGHTS.values(), parts, strict=True))
        penalty = coefficient * 0.5 * sum(p.square().sum() for p in network.parameters())
        gradients = torch.autograd.grad(terms / TRIAL.trial_length + penalty, output)
        with torch.no_grad():
            for p, g, m, v in zip(output, gradients, first, second, strict=True):
                clipped = g / g.norm().clamp(min=1.0)
                m += 0.1 * (clipped - m)
                v += 0.001 * (clipped.square() - v)
                rate = 0.001 * (1 - 0.999**step) ** 0.5 / (1 - 0.9**step)
                p -= rate * m / (v.sqrt() + 1e-7)


@pytest.mark.parametrize(("lesion", "task"), [*zip(["intact", *LESIONS], itertools.cycle(TASKS), strict=False)])
def test_an_epoch_brings_what_plain_torch_brings(networks, rows, task, lesion):
    layout = Layout(networks[0])
    after = by_name(layout, make(layout, task).run(rows, SEEDS, find_lesion(lesion)))
    for index, (network, seed) in enumerate(zip(networks, SEEDS, strict=True)):
        network.set_lesion(lesion)
        an_epoch_in_torch(network, seed, task, 0.001)
        for name, parameter in network.named_parameters():
            torch.testing.assert_close(after[name][index], parameter.detach(), rtol=0, atol=2e-5)


@pytest.mark.parametrize(
    ("architecture", "penalty"), [*zip(["unilateral", "bilateral", "callosal"], PENALTIES, strict=True)]
)
def test_only_the_output_layer_changes(random_networks, rows_of, same_bits, architecture, penalty):
    networks = random_networks(architecture, dtype=torch.float32)
    layout = Layout(networks[0])
    rows = rows_of(layout, [dict(network.named_parameters()) for network in networks])
    before, given = by_name(layout, rows), rows.clone()
    after = by_name(layout, make(layout, penalty=penalty, coefficient=PENALTIES[penalty]).run(rows, SEEDS, NO_LESION))
    assert same_bits(rows, given), "the weights given must not change"
    for name in before:
        assert same_bits(before[name], after[name]) == (name not in TRAINED), name
    assert set(TRAINED) <= set(before)


def test_every_network_ends_as_if_it_were_alone_whatever_the_threads(networks, rows, same_bits):
    layout, lesion = Layout(networks[0]), LESIONS["deep_dominant"]
    both = make(layout, threads=2).run(rows, SEEDS, lesion)
    for index, seed in enumerate(SEEDS):
        assert same_bits(both[index], make(layout).run(rows[index : index + 1], [seed], lesion)[0])


def test_the_output_layer_adapts_to_its_lesion(networks, rows):
    layout = Layout(networks[0])
    results = {
        lesion: make(layout).run(rows, SEEDS, RELEASED_LESIONS[lesion])
        for lesion in ("deep_dominant", "callosum_deep_dominant", "callosum")
    }
    for one, first in results.items():
        for other, second in results.items():
            assert one == other or not torch.equal(first, second), (one, other)


def test_its_trials_are_others_than_those_of_training():
    task = make_task("random_reach")
    for seed in range(5):
        new, old = (draw(seed, 50, task, TRIAL).start for draw in (retraining_trials, training_trials))
        assert not (new[:, None] == old[None]).all(-1).any()


def test_it_says_how_far_it_is(networks, rows):
    heard = []
    make(Layout(networks[0])).run(rows, SEEDS, NO_LESION, heard.append)
    assert heard == [1, 2, 3]


def test_a_network_beyond_all_numbers_harms_no_other(networks, rows, same_bits):
    layout = Layout(networks[0])
    broken = rows.clone()
    broken[0] = 1e38
    after = make(layout).run(broken, SEEDS, NO_LESION)
    assert same_bits(after[1], make(layout).run(rows, SEEDS, NO_LESION)[1])
