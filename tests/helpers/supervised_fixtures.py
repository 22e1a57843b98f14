"""Stacked rollouts of random networks, and the same trials in torch: the arm's step, the modules and autograd."""

from types import SimpleNamespace

import pytest
import torch
from torch.utils.tensorboard import SummaryWriter

from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.rollout import Rollout
from bilateral_rl.bptt.rollout_arrays import RolloutSize
from bilateral_rl.envs import Arm, ArmParameters
from bilateral_rl.policies import make_network
from bilateral_rl.training import supervised
from bilateral_rl.training.run import train
from bilateral_rl.vocabulary import SIDES

TRAJECTORIES = ("joint", "muscle", "hand", "excitation", "terms", "hidden", "observation")
UPPER = torch.tensor([135.0, 155.0]).deg2rad()


def _random_networks(architecture, units=10, layers=2, n=2, dtype=torch.float64, seed=0, n_arms=1, **paths):
    """Networks whose every parameter, biases too, is random and not representable in float32; what is fixed is not."""
    generator = torch.Generator().manual_seed(seed)
    sizes = (16 if n_arms == 1 else 40, 6 * n_arms, units, layers)
    networks = [make_network(architecture, *sizes, n_arms=n_arms, **paths).to(dtype) for _ in range(n)]
    for network in networks:
        for name, parameter in network.named_parameters():
            values = torch.randn(parameter.shape, generator=generator, dtype=torch.float64)
            if parameter.requires_grad:  # combination weights are random, not negative
                parameter.data.copy_(0.3 + values.abs() if name.startswith("combination") else 0.5 * values)
    return networks


def _rows(layout, named):
    """(S, width): tensors by parameter name of each network, without the rounding of ``Layout.pack``."""
    dtype = next(iter(named[0].values())).dtype
    rows = torch.zeros(len(named), layout.width, dtype=dtype)
    for row, values in zip(rows, named, strict=True):
        for v in layout.variables:
            row[v.offset : v.offset + v.size] = values[v.name].detach().t().reshape(-1)
    return rows


def _make_rollout(
    networks, n_trials=4, n_steps=8, arm=None, seed=0, limits=False, workers=None, conditions=None, fill=None, **wanted
):
    """A rollout of ``networks`` with random trials; with ``limits``, some start in a corner of the joints' range.

    ``fill`` fills the trials in another way.
    """
    layout, dtype = Layout(networks[0]), next(networks[0].parameters()).dtype
    size = RolloutSize(len(networks), n_trials, n_steps, **wanted)
    rollout = Rollout(layout, arm or ArmParameters(), size, dtype=dtype, workers=workers, conditions=conditions)
    rollout.weights.copy_(_rows(layout, [dict(network.named_parameters()) for network in networks]))
    if fill:
        fill(rollout.trials)
        return rollout
    generator = torch.Generator().manual_seed(seed)

    def uniform(low, high):
        shape = rollout.trials.start.shape
        return low + (high - low) * torch.rand(shape, generator=generator, dtype=torch.float64).to(dtype)

    rollout.trials.start.copy_(uniform(0.15, 0.85) * UPPER)
    rollout.trials.target.copy_(uniform(-0.3, 0.5))
    rollout.trials.load.copy_(uniform(-10.0, 10.0))
    if limits:
        rollout.trials.start[:, 0] = 0.0
        rollout.trials.start[:, 1] = UPPER
    return rollout


def _hidden_layers(network):
    """In the order of ``Rollout.hidden``: layer by layer, the dominant side first."""
    stacks = [network.hidden] if network.architecture == "unilateral" else [getattr(network, side) for side in SIDES]
    return [stack[k] for k in range(network.layers) for stack in stacks]


def _trial_in_torch(network, arm, start, target, load, n_steps):
    """The trajectories (B, T, …) of one network, by name."""
    driven = {}
    hooks = [
        layer.register_forward_hook(lambda _module, _inputs, output, i=i: driven.update({i: output}))
        for i, layer in enumerate(_hidden_layers(network))
    ]
    state, steps = arm.rest(start), []
    for _ in range(n_steps):
        observation = torch.cat([arm.proprioception(state), state.cartesian[:, :2], target], dim=1)
        excitation = network.excitation(observation)
        state = arm.step(state, excitation, load)
        hand = state.cartesian[:, :2]
        error = hand - target
        terms = [error.abs().mean(1), 10 * error.square().mean(1), excitation.square().mean(1)]
        hidden = torch.stack([driven[i].tanh() for i in range(len(hooks))], dim=1)
        steps.append((state.joint, state.muscle, hand, excitation, torch.stack(terms, dim=1), hidden, observation))
    for hook in hooks:
        hook.remove()
    return {name: torch.stack(parts, dim=1) for name, parts in zip(TRAJECTORIES, zip(*steps, strict=True), strict=True)}


def _roll_in_torch(networks, rollout, arm=None):
    """The trials of ``rollout`` (S, B, T, …) by ``Arm.step`` and the torch networks, differentiable."""
    arm = Arm(arm, dtype=rollout.weights.dtype)
    paths = [
        _trial_in_torch(network, arm, *(part[s] for part in rollout.trials), rollout.size.n_steps)
        for s, network in enumerate(networks)
    ]
    return SimpleNamespace(**{name: torch.stack([path[name] for path in paths]) for name in TRAJECTORIES})


def _gradient_rows(layout, networks, loss):
    """(S, width): autograd's gradient of ``loss``, 0 for parameters that it does not depend on."""
    named = []
    for network in networks:
        parameters = dict(network.named_parameters())
        gradients = torch.autograd.grad(loss, list(parameters.values()), retain_graph=True, allow_unused=True)
        named.append(
            {
                name: torch.zeros_like(parameter) if gradient is None else gradient
                for (name, parameter), gradient in zip(parameters.items(), gradients, strict=True)
            }
        )
    return _rows(layout, named)


def _assert_rows_close(layout, rows, expected, rtol):
    """In every variable of every row by itself: the norm of the difference over the norm."""
    assert rows.shape == expected.shape
    for index, (row, other) in enumerate(zip(rows.flatten(0, -2), expected.flatten(0, -2), strict=True)):
        for v in layout.variables:
            here = slice(v.offset, v.offset + v.size)
            difference, norm = (row[here] - other[here]).norm(), other[here].norm()
            assert difference <= rtol * norm, f"row {index}, {v.name}: {difference} of {norm}"


def _set_lesions(rollout, networks, lesions):
    rollout.set_lesions(lesions)
    for network, lesion in zip(networks, lesions, strict=True):
        network.set_lesion(lesion)


@pytest.fixture
def random_networks():
    """Builder of networks of one shape with random parameters."""
    return _random_networks


@pytest.fixture
def make_rollout():
    """Builder of a rollout of given networks with random trials."""
    return _make_rollout


@pytest.fixture
def roll_in_torch():
    """The trials of a rollout done in torch."""
    return _roll_in_torch


@pytest.fixture
def gradient_rows():
    """Autograd's gradients in a rollout's layout."""
    return _gradient_rows


@pytest.fixture
def rows_of():
    """Tensors by parameter name in a rollout's layout."""
    return _rows


@pytest.fixture
def assert_rows_close():
    """Compares gradients variable by variable."""
    return _assert_rows_close


@pytest.fixture
def set_lesions():
    """Lesions the networks of a rollout and their torch modules alike."""
    return _set_lesions


@pytest.fixture
def trajectories():
    """Names of a rollout's trajectories."""
    return TRAJECTORIES


@pytest.fixture
def assert_same_end(same_bits):
    """Asserts that two runs ended with the same bits, in everything that training reads and people see."""

    def check(first, second):
        for name in ("final", "best"):
            assert same_bits(first.load_weights(name), second.load_weights(name)), name
        assert same_bits(first.load_resume(), second.load_resume())
        assert (first.path / "epochs.csv").read_bytes() == (second.path / "epochs.csv").read_bytes()
        assert first.status() == second.status()

    return check


@pytest.fixture(scope="module")
def longer(small_bptt):
    """Three epochs of four updates of two seeds."""
    return small_bptt(bptt={"trials": 64, "learning_rate": 0.02})


@pytest.fixture(scope="module")
def whole(longer, tmp_path_factory):
    """That training in one go."""
    return train(longer, tmp_path_factory.mktemp("whole")).folder


@pytest.fixture
def no_pictures(monkeypatch):
    """Pictures take longer than these trainings; those of ``bptt_run`` are drawn before this."""
    monkeypatch.setattr(supervised, "hand_paths", lambda *_: None)
    monkeypatch.setattr(SummaryWriter, "add_figure", lambda *_, **__: None)
