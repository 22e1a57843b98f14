"""What follows a lesion: what adapts, by the combined loss, under the lesion; everything else stays bit for bit."""

import itertools
from dataclasses import replace

import pytest
import torch
from one_arm_tasks import ONE_ARM_TASKS
from rich_tasks import RICH_SETTINGS, Rich

from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.trials import retraining_order, retraining_trials, training_trials
from bilateral_rl.config.hyperparameters import BPTTHyperparameters
from bilateral_rl.config.resolve import resolve, supervised
from bilateral_rl.config.schema import BPTTConfig, RLConfig
from bilateral_rl.envs import TASKS, Arm
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.tasks import make_task
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import LESIONS, NO_LESION, RELEASED_LESIONS, find_lesion
from bilateral_rl.training.moments import Moments
from bilateral_rl.training.retraining import Retraining
from bilateral_rl.vocabulary import PENALTIES

TRIAL = TrialSettings(trial_length=12)
SETTINGS = BPTTHyperparameters(trials=24, batch_size=8)
CONFIG = BPTTConfig(model="cc_s", bptt=SETTINGS, trial=TRIAL)
CUT_WEIGHTS = {"cartesian_1": 2.5, "cartesian_2": 2.5, "activation": 1.0}
SEEDS = [3, 4]
OUTPUT = ("output.weight", "output.bias")
OF_ARCHITECTURE = {"unilateral": "uni_b", "bilateral": "bi_s", "callosal": "cc_s"}
OUTPUT_LAYER, EVERYTHING = Protocol("output"), Protocol("everything")


def retrain(rows, lesion=NO_LESION, protocol=OUTPUT_LAYER, config=CONFIG, seeds=SEEDS, moments=None, threads=1, **rest):
    retraining = Retraining(config, protocol, threads=threads)
    return retraining.run(rows, seeds, [lesion] * len(seeds), moments, **rest)


def of_task(task):
    return replace(CONFIG, task=task)


@pytest.fixture
def networks(random_networks):
    return random_networks("callosal", n=len(SEEDS), dtype=torch.float32)


@pytest.fixture
def rows(networks, rows_of):
    return rows_of(Layout(networks[0]), [dict(network.named_parameters()) for network in networks])


@pytest.fixture
def moments(networks, rows_of):
    """Of networks that were updated 40 and 70 times, with gradients like those of a training."""
    layout, generator = Layout(networks[0]), torch.Generator().manual_seed(5)
    gradients = [
        {name: 1e-3 * torch.randn(p.shape, generator=generator) for name, p in network.named_parameters()}
        for network in networks
    ]
    first = rows_of(layout, gradients)
    return Moments(first, rows_of(layout, gradients).square() + 1e-7 * (first != 0), [40, 70])


def silent(side):
    """What a side is silent with: the callosum pools two of its five units each, and drops the last one."""
    return {f"{side}.0": "last unit", f"{side}.1": "all", f"combination_{side}": "all"}


UNREACHED = {
    "intact": {},
    "shallow_dominant": {"dominant.0.weight": "all"},
    "shallow_non_dominant": {"non_dominant.0.weight": "all"},
    "deep_dominant": silent("dominant"),
    "deep_non_dominant": silent("non_dominant"),
    "callosum": {},
    "callosum_deep_dominant": {"dominant": "all", "combination_dominant": "all"},
    "callosum_deep_non_dominant": {"non_dominant": "all", "combination_non_dominant": "all"},
}
"""What has no way to the output of a callosal network, by lesion and by the beginning of the parameters' names."""


def is_unreached(lesion, name, shape):
    still = torch.zeros(shape, dtype=torch.bool)
    for beginning, which in UNREACHED[lesion].items():
        if name.startswith(beginning):
            still[...] = True
            if which == "last unit":
                still[:-1] = False
    return still


# Against plain torch


def adapting(network, kind):
    beginnings = {"output": ("output",), "combination": ("output", "combination"), "everything": ("",)}[kind]
    return {name: p for name, p in network.named_parameters() if name.startswith(beginnings)}


def data_loss(network, trials):
    """The combined loss of a batch but for the penalty, by autograd through ``Arm.step``."""
    arm, (start, target, load) = Arm(TRIAL.arm), trials
    state, terms = arm.rest(start), 0.0
    for _ in range(TRIAL.trial_length):
        seen = torch.cat([arm.proprioception(state), state.cartesian[:, :2], target], dim=1)
        excitation = network.excitation(seen)
        state = arm.step(state, excitation, load)
        error = state.cartesian[:, :2] - target
        parts = (error.abs().mean(), 10 * error.square().mean(), excitation.square().mean())
        terms = terms + sum(w * part for w, part in zip(CUT_WEIGHTS.values(), parts, strict=True))
    return terms / TRIAL.trial_length


def retrain_in_torch(network, seed, task, lesion, protocol, coefficient=0.001, rate=0.001, moments=None):
    """What adapts is trained by autograd, clipped by variable, with Keras's Adam; the penalty only where data reach."""
    draw = training_trials if protocol.trials == "training" else retraining_trials
    trials = draw(seed, SETTINGS.trials, make_task(task), TRIAL)
    parameters = list(adapting(network, protocol.retrain).values())
    reached = [
        torch.full(p.shape, protocol.penalize_unreached) | ~is_unreached(lesion, name, p.shape)
        for name, p in adapting(network, protocol.retrain).items()
    ]
    first, second, step = moments or (*([torch.zeros_like(p) for p in parameters] for _ in range(2)), 0)
    for epoch, batch in itertools.product(range(protocol.epochs), range(3)):
        order = retraining_order(seed, epoch, SETTINGS.trials)[8 * batch : 8 * batch + 8]
        loss = data_loss(network, [part[order] for part in trials])
        gradients = torch.autograd.grad(loss, parameters, allow_unused=True)
        step += 1
        with torch.no_grad():
            for p, g, m, v, moves in zip(parameters, gradients, first, second, reached, strict=True):
                full = torch.where(moves, (0.0 if g is None else g) + coefficient * p, 0.0)
                clipped = full / full.norm().clamp(min=1.0)
                m += 0.1 * (clipped - m)
                v += 0.001 * (clipped.square() - v)
                corrected = rate * (1 - 0.999**step) ** 0.5 / (1 - 0.9**step)
                p -= torch.where(moves, corrected * m / (v.sqrt() + 1e-7), 0.0)
            network.constrain()


def assert_as_in_torch(networks, rows, lesion, protocol, task="random_reach", moments=None, atol=2e-5, **numbers):
    layout = Layout(networks[0])
    after = layout.unpack(retrain(rows, find_lesion(lesion), protocol, of_task(task), moments=moments))
    for index, (network, seed) in enumerate(zip(networks, SEEDS, strict=True)):
        network.set_lesion(lesion)
        mine = None
        if moments:
            parts = [layout.unpack(part[index : index + 1]) for part in (moments.first, moments.second)]
            names = [name for name, _ in network.named_parameters()]
            mine = (*([part[name][0].clone() for name in names] for part in parts), moments.steps[index])
        retrain_in_torch(network, seed, task, lesion, protocol, moments=mine, **numbers)
        for name, parameter in network.named_parameters():
            torch.testing.assert_close(after[name][index], parameter.detach(), rtol=0, atol=atol, msg=name)


@pytest.mark.parametrize(
    ("lesion", "task", "kind"),
    [
        *zip(
            ["intact", *LESIONS],
            itertools.cycle(ONE_ARM_TASKS),
            itertools.cycle(["output", "everything", "combination"]),
            strict=False,
        ),
        ("callosum", "random_reach", "everything"),
        ("deep_dominant", "random_reach", "everything"),
        ("callosum_deep_non_dominant", "hold_position", "everything"),
        ("intact", "random_reach", "everything"),
    ],
)
def test_an_epoch_brings_what_plain_torch_brings(networks, rows, task, lesion, kind):
    assert_as_in_torch(networks, rows, lesion, Protocol(kind), task)


@pytest.mark.parametrize("kind", ["output", "everything"])
def test_epochs_learning_rate_coefficient_and_trials_are_the_protocols(networks, rows, kind):
    protocol = Protocol(kind, epochs=2, learning_rate=0.003, penalty_coefficient=0.05, trials="training")
    numbers = {"coefficient": 0.05, "rate": 0.003}
    assert_as_in_torch(networks, rows, "callosum", protocol, atol=1e-4, **numbers)


def test_the_penalty_can_move_what_the_data_loss_cannot_reach(networks, rows, same_bits):
    protocol = Protocol("everything", penalize_unreached=True, penalty_coefficient=0.05)
    lesion, layout = "callosum_deep_dominant", Layout(networks[0])
    assert_as_in_torch(networks, rows, lesion, protocol, coefficient=0.05)
    before, after = layout.unpack(rows), layout.unpack(retrain(rows, LESIONS[lesion], protocol))
    kernels = [name for name in before if name.startswith("dominant.") and name.endswith("weight")]
    assert kernels
    assert all((before[name] != after[name]).all() for name in kernels)


def test_the_optimizer_continues_each_network_with_its_moments_and_its_own_step_count(networks, rows, moments):
    protocol = Protocol("everything", optimizer="continued")
    assert_as_in_torch(networks, rows, "callosum_deep_dominant", protocol, moments=moments)
    fresh = retrain(rows, LESIONS["callosum_deep_dominant"], EVERYTHING)
    continued = retrain(rows, LESIONS["callosum_deep_dominant"], protocol, moments=moments)
    assert (fresh - continued).abs().max() > 1e-3


# What must not move


@pytest.mark.parametrize(
    ("architecture", "penalty"), [*zip(["unilateral", "bilateral", "callosal"], PENALTIES, strict=True)]
)
def test_only_the_output_layer_changes(random_networks, rows_of, same_bits, architecture, penalty):
    networks = random_networks(architecture, dtype=torch.float32)
    layout = Layout(networks[0])
    rows = rows_of(layout, [dict(network.named_parameters()) for network in networks])
    before, given = layout.unpack(rows), rows.clone()
    config = replace(CONFIG, model=OF_ARCHITECTURE[architecture])
    after = layout.unpack(retrain(rows, protocol=Protocol("output", penalty=penalty), config=config))
    assert same_bits(rows, given), "the weights given must not change"
    for name in before:
        assert same_bits(before[name], after[name]) == (name not in OUTPUT), name
    assert set(OUTPUT) <= set(before)


@pytest.mark.parametrize("lesion", UNREACHED)
@pytest.mark.parametrize("penalty", ["weights", "activity"])
def test_what_the_data_loss_cannot_reach_stays_bit_for_bit_and_all_else_moves(
    networks, rows, moments, same_bits, lesion, penalty
):
    protocol = Protocol("everything", penalty=penalty, penalty_coefficient=0.1, optimizer="continued")
    layout = Layout(networks[0])
    after = layout.unpack(retrain(rows, find_lesion(lesion), protocol, moments=moments))
    for name, before in layout.unpack(rows).items():
        still = is_unreached(lesion, name, before.shape[1:])
        assert same_bits(before[:, still], after[name][:, still]), name
        assert (before != after[name])[:, ~still].all(), name


def test_what_is_not_reached_does_not_shorten_the_gradient_of_what_is(networks, rows):
    """The weights of a unit that sends nothing count for nothing in the norm by which their kernel is clipped."""
    layout, lesion = Layout(networks[0]), LESIONS["deep_dominant"]
    huge = layout.unpack(rows)
    huge["dominant.0.weight"][:, -1] = 1e4
    loud = layout.pack([{name: tensor[i] for name, tensor in huge.items()} for i in range(len(SEEDS))])
    calm, loud = (layout.unpack(retrain(r, lesion, EVERYTHING))["dominant.0.weight"] for r in (rows, loud))
    torch.testing.assert_close(calm[:, :-1], loud[:, :-1], rtol=0, atol=0)


# As if alone


@pytest.mark.parametrize("kind", ["output", "everything"])
def test_every_network_ends_as_if_it_were_alone_whatever_the_threads(networks, rows, moments, same_bits, kind):
    lesions = [LESIONS["deep_dominant"], LESIONS["callosum"]]
    protocol = Protocol(kind, epochs=2, optimizer="continued")
    both = Retraining(CONFIG, protocol, threads=2).run(rows, SEEDS, lesions, moments)
    for i, (seed, lesion) in enumerate(zip(SEEDS, lesions, strict=True)):
        own = Moments(moments.first[i : i + 1], moments.second[i : i + 1], moments.steps[i : i + 1])
        assert same_bits(both[i], retrain(rows[i : i + 1], lesion, protocol, seeds=[seed], moments=own)[0])


def test_networks_adapt_to_their_lesion(rows):
    results = {
        lesion: retrain(rows, RELEASED_LESIONS[lesion])
        for lesion in ("deep_dominant", "callosum_deep_dominant", "callosum")
    }
    for one, first in results.items():
        for other, second in results.items():
            assert one == other or not torch.equal(first, second), (one, other)


def test_new_trials_are_others_than_those_of_training():
    task = make_task("random_reach")
    for seed in range(5):
        new, old = (draw(seed, 50, task, TRIAL).start for draw in (retraining_trials, training_trials))
        assert not (new[:, None] == old[None]).all(-1).any()


def test_epochs_shuffle_the_trials_in_an_order_of_the_seed_and_the_epoch():
    orders = {(seed, epoch): retraining_order(seed, epoch, 50).tolist() for seed in (0, 1) for epoch in (0, 1, 2)}
    assert orders[0, 0] == orders[1, 0] == list(range(50))
    shuffled = [order for (_, epoch), order in orders.items() if epoch]
    assert all(sorted(order) == list(range(50)) for order in shuffled)
    assert len({tuple(order) for order in shuffled}) == 4


def test_it_says_how_far_it_is(rows):
    heard = []
    retrain(rows, protocol=Protocol("output", epochs=2), on_update=heard.append)
    assert heard == [1, 2, 3, 4, 5, 6]


def test_a_network_beyond_all_numbers_harms_no_other(rows, same_bits):
    broken = rows.clone()
    broken[0] = 1e38
    after = retrain(broken, protocol=EVERYTHING)
    assert same_bits(after[1], retrain(rows, protocol=EVERYTHING)[1])


# Of which training


@pytest.mark.parametrize("algo", ["ppo", "sac", "bptt"])
@pytest.mark.parametrize(
    ("task", "coefficient"),
    [*((task, 0.001) for task in ONE_ARM_TASKS), ("curl_field", 0.001), ("reach_and_hold", 0.0001),
     ("bimanual_curl_field", 0.0001)],
)  # fmt: skip
def test_the_numbers_are_those_of_bptt_in_the_task_and_the_rate_the_papers(algo, task, coefficient):
    used = Retraining(resolve(algo, task), Protocol("output")).used
    assert used == Protocol("output", 1, 0.001, "weights", coefficient)


@pytest.mark.parametrize("task", [*ONE_ARM_TASKS, "reach_and_hold"])
def test_after_training_by_rewards_all_settings_are_those_of_bptt_in_the_task(task):
    usual = resolve("bptt", task)
    assert supervised(resolve("td3", task)).bptt == usual.bptt
    assert supervised(usual) is usual
    own = resolve("bptt", task, [{"bptt": {"batch_size": 32}}])
    assert supervised(own) is own


# Refused


@pytest.mark.parametrize(("name", "value"), [("optimizer", "continued"), ("trials", "training")])
def test_a_run_of_reinforcement_learning_has_nothing_of_a_supervised_training(name, value):
    with pytest.raises(UserError, match=f"not trained by BPTT and has no {name} .* use --retrain-{name}"):
        Retraining(RLConfig(), Protocol(**{name: value}))


def test_networks_of_a_task_with_everything_are_retrained_as_if_each_were_alone(rows, monkeypatch):
    """Timelines, forces, losses, noise and delays; a network has the same noise under every lesion."""
    monkeypatch.setitem(TASKS, "rich", Rich)
    trial, noisy = TrialSettings(trial_length=20, **RICH_SETTINGS), replace(CONFIG.network, hidden_noise=0.05)
    config = replace(CONFIG, task="rich", trial=trial, network=noisy)
    both = retrain(rows, find_lesion("callosum"), config=config, threads=2)
    for index, seed in enumerate(SEEDS):
        one = slice(index, index + 1)
        assert torch.equal(retrain(rows[one], find_lesion("callosum"), config=config, seeds=[seed]), both[one])
    without = replace(config, network=CONFIG.network)
    assert not torch.equal(retrain(rows, find_lesion("callosum"), config=without), both)
