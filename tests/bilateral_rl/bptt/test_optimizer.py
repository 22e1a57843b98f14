"""Updates of stacked networks: routing, clipping by variable and Keras's Adam, each network by itself."""

import contextlib
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.losses import StreamLosses
from bilateral_rl.bptt.optimizer import StackedAdam
from bilateral_rl.bptt.workers import Workers
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.envs import ArmParameters

PAPERS = ("callosal", 10, 2)
RATE, EPSILON, BETA_1, BETA_2 = 1e-3, 1e-7, 0.9, 0.999
TRIALS, STEPS = 4, 8
MOVED = ("first", "second", "weights")


@pytest.fixture
def given_gradients(random_networks, make_rollout):
    """A rollout and an optimizer whose next gradient is what its ``given`` (S, width) holds."""

    def make(n=1, dtype=torch.float64, clip_norm=1.0, learning_rate=RATE, epsilon=EPSILON, step=0):
        rollout = make_rollout(random_networks(*PAPERS, n=n, dtype=dtype))
        given = torch.zeros_like(rollout.weights)
        losses = SimpleNamespace(n_streams=1, weight_decay=[0.0], gradient=lambda _: given[None])
        optimizer = StackedAdam(rollout, losses, "combined", learning_rate, epsilon, clip_norm, step)
        return SimpleNamespace(rollout=rollout, layout=rollout.layout, optimizer=optimizer, given=given)

    return make


@pytest.fixture
def training(random_networks, make_rollout):
    """Networks and the optimizer that trains them on the same trials over and over, penalty of kind ``released``."""

    def make(s=slice(None), n=5, loss="specialized", dtype=torch.float32, step=0, **settings):
        networks = random_networks(*PAPERS, n=n, dtype=dtype)
        losses = StreamLosses(loss, "released", 0.01, Layout(networks[0]), ArmParameters())
        every = make_rollout(networks, TRIALS, STEPS)
        rollout = make_rollout(
            networks[s], TRIALS, STEPS, n_streams=losses.n_streams, watches_state=losses.watches_state, **settings
        )
        for own, part in zip(rollout.trials, every.trials, strict=True):
            own.copy_(part[s])
        return rollout, StackedAdam(rollout, losses, loss, RATE, EPSILON, clip_norm=1.0, step=step)

    return make


def update(rollout, optimizer, moves=None):
    rollout.forward()
    finite = optimizer.gradient()
    optimizer.step(moves)
    return finite


def state_of(rollout, optimizer):
    """Copies of the moments and the weights."""
    return {"first": optimizer.first.clone(), "second": optimizer.second.clone(), "weights": rollout.weights.clone()}


def random_gradients(layout, n_steps, n=1, scale=1.0, seed=0):
    """(n_steps, n, width): of very different size from variable to variable, 0 in the padding."""
    generator = torch.Generator().manual_seed(seed)
    gradients = torch.zeros(n_steps, n, layout.width, dtype=torch.float64)
    for i, v in enumerate(layout.variables):
        size = scale * 10.0 ** (i % 5 - 3)
        shape = (n_steps, n, v.size)
        here = slice(v.offset, v.offset + v.size)
        gradients[..., here] = size * torch.randn(shape, generator=generator, dtype=torch.float64)
    return gradients


def clipped_by_variable(layout, gradient, clip_norm):
    """As tf.clip_by_norm clips each."""
    gradient = gradient.copy()
    for v in layout.variables:
        part = gradient[v.offset : v.offset + v.size]
        part *= clip_norm / max(clip_norm, np.linalg.norm(part))
    return gradient


def keras_adam(layout, weights, gradients, clip_norm, learning_rate, epsilon):
    """Moments and weights after updates by ``gradients`` (n_steps, width), as in Keras 2.13."""
    weights, m, v = weights.copy(), np.zeros_like(weights), np.zeros_like(weights)
    for t, full in enumerate(gradients, start=1):
        g = clipped_by_variable(layout, full, clip_norm)
        m += (g - m) * (1 - BETA_1)
        v += (g**2 - v) * (1 - BETA_2)
        alpha = learning_rate * np.sqrt(1 - BETA_2**t) / (1 - BETA_1**t)
        weights -= alpha * m / (np.sqrt(v) + epsilon)
        for variable in layout.variables:
            if variable.name.startswith("combination"):
                weights[variable.offset] = max(weights[variable.offset], 0.0)
    return {"first": m, "second": v, "weights": weights}


@pytest.mark.parametrize("model", ["bi_s", "cc_s"])
def test_the_routed_gradient_is_assembled_from_two_ordinary_backward_passes(
    random_networks, make_rollout, roll_in_torch, rows_of, assert_rows_close, model
):
    networks = random_networks(MODELS[model].architecture)
    losses = StreamLosses("specialized", "weights", 0.001, Layout(networks[0]), ArmParameters())
    rollout = make_rollout(networks, TRIALS, STEPS, n_streams=2)
    optimizer = StackedAdam(rollout, losses, "specialized", RATE, EPSILON, clip_norm=1.0)
    rollout.forward()
    assert optimizer.gradient().tolist() == [True, True]

    def backward(of_loss):
        """Every parameter's gradient of a loss by an ordinary backward pass."""
        path = roll_in_torch(networks, rollout)
        error = path.hand - rollout.trials.target[:, :, None]
        for s, network in enumerate(networks):
            network.zero_grad()
            of_loss(error[s], path.excitation[s], network).backward(retain_graph=True)
        return [{name: p.grad.clone() for name, p in network.named_parameters()} for network in networks]

    def dominant_loss(error, u, network):
        return 5 * 10 * error.square().mean() + 2 * u.square().mean()

    def non_dominant_loss(error, u, network):
        return 5 * error.abs().mean() + 2 * 0.001 / 2 * sum(p.square().sum() for p in network.parameters())

    expected = []
    for network, d, n in zip(networks, backward(dominant_loss), backward(non_dominant_loss), strict=True):
        shared = {name: (d[name] + n[name]) / 2 for name in d}
        of_group = {"dominant": d, "non_dominant": n, "shared": shared}
        expected.append({name: of_group[network.group_of(name)][name] for name in d})
    expected = rows_of(rollout.layout, expected)
    assert_rows_close(rollout.layout, optimizer.routed, expected, rtol=1e-9)
    for i, v in enumerate(rollout.layout.variables):
        norms = expected[:, v.offset : v.offset + v.size].norm(dim=1)
        torch.testing.assert_close(optimizer.norms[:, i], norms, rtol=1e-9, atol=0)


def test_a_single_stream_moves_everything_in_full(training):
    for loss in ("combined", "dominant", "non_dominant"):
        rollout, optimizer = training(n=2, loss=loss, dtype=torch.float64)
        rollout.forward()
        optimizer.gradient()
        assert (optimizer.routed != 0).any()
        assert torch.equal(optimizer.routed, rollout.gradient[0])


def test_every_variable_is_clipped_by_its_own_norm(given_gradients):
    for scale, clip_norm in ((0.1, 0.5), (10.0, 1.0), (10.0, 20.0)):
        case = given_gradients(clip_norm=clip_norm)
        case.given.copy_(random_gradients(case.layout, 1, scale=scale)[0])
        case.optimizer.gradient()
        case.optimizer.step()
        clipped = clipped_by_variable(case.layout, case.given[0].numpy(), clip_norm)
        moment = case.optimizer.first[0] / (1 - BETA_1)
        norms = {}
        for i, v in enumerate(case.layout.variables):
            here = slice(v.offset, v.offset + v.size)
            norms[v.name] = case.given[0, here].norm().item()
            assert case.optimizer.norms[0, i].item() == pytest.approx(norms[v.name], rel=1e-12)
            assert moment[here].norm().item() == pytest.approx(min(norms[v.name], clip_norm), rel=1e-6), v.name
            np.testing.assert_allclose(moment[here], clipped[here], rtol=1e-6)
        if clip_norm == 1.0:  # clips some kernels, biases and scalars and spares others
            for kind in ("weight", "bias"):
                assert {norm > 1 for name, norm in norms.items() if name.endswith(kind)} == {True, False}
            assert norms["combination_non_dominant"] > 1


@pytest.mark.parametrize(("clip_norm", "learning_rate", "epsilon"), [(1.0, RATE, EPSILON), (1e6, 0.05, 1e-3)])
def test_ten_steps_are_keras_adam(given_gradients, clip_norm, learning_rate, epsilon):
    """Its epsilon counts before the bias correction: the first step is rate · g / (g + ε / √(1 - β₂))."""
    n_steps = 10
    case = given_gradients(n=2, clip_norm=clip_norm, learning_rate=learning_rate, epsilon=epsilon)
    before = case.rollout.weights.clone().numpy()
    gradients = random_gradients(case.layout, n_steps, n=2)
    for gradient in gradients:
        case.given.copy_(gradient)
        case.optimizer.gradient()
        case.optimizer.step()
    for s in range(2):
        expected = keras_adam(case.layout, before[s], gradients[:, s].numpy(), clip_norm, learning_rate, epsilon)
        for name, values in state_of(case.rollout, case.optimizer).items():
            np.testing.assert_allclose(values[s], expected[name], rtol=1e-11, atol=1e-18, err_msg=name)


def test_combination_weights_never_go_below_zero_and_others_may(given_gradients):
    case = given_gradients(learning_rate=0.1)
    case.rollout.weights.fill_(0.25)
    lowest = []
    for gradient in [1.0] * 5 + [-1.0] * 30:
        case.given.fill_(gradient)
        case.optimizer.gradient()
        case.optimizer.step()
        lowest.append({name: values.min().item() for name, values in case.layout.unpack(case.rollout.weights).items()})
    combination = ("combination_dominant", "combination_non_dominant")
    for name in lowest[0]:
        assert (min(low[name] for low in lowest) == 0.0) == (name in combination), name
        assert (lowest[4][name] < 0) == (name not in combination), name
        assert lowest[-1][name] > 0.1, "it comes back"


def test_networks_that_do_not_move_keep_weights_and_moments_to_the_last_bit(training):
    (rollout, optimizer), (reference, all_move) = training(), training()
    for _ in range(2):
        update(rollout, optimizer)
        update(reference, all_move)
    before = state_of(rollout, optimizer)
    moves = torch.tensor([True, False, True, False, False])
    update(rollout, optimizer, moves)
    update(reference, all_move)
    after, everywhere = state_of(rollout, optimizer), state_of(reference, all_move)
    for name in MOVED:
        assert torch.equal(after[name][~moves], before[name][~moves]), name
        assert torch.equal(after[name][moves], everywhere[name][moves]), name
        assert (after[name][moves] != before[name][moves]).any(dim=1).all(), name


def test_a_step_that_names_no_networks_moves_all_again(training):
    rollout, optimizer = training()
    update(rollout, optimizer, torch.tensor([True, False, True, False, False]))
    before = rollout.weights.clone()
    update(rollout, optimizer)
    assert (rollout.weights != before).any(dim=1).all()


@pytest.mark.parametrize("bad", [torch.nan, torch.inf])
def test_a_gradient_that_is_not_finite_is_named_and_leaves_the_others_alone(training, bad):
    (rollout, optimizer), (reference, sound) = training(), training()
    update(rollout, optimizer)
    update(reference, sound)
    rollout.trials.target[1, 2, 0] = bad
    rollout.weights[3, next(v.offset for v in rollout.layout.variables if v.name == "output.bias")] = bad
    rollout.forward()
    reference.forward()
    finite = optimizer.gradient()
    assert sound.gradient().tolist() == [True] * 5
    assert finite.tolist() == [True, False, True, False, True]
    assert torch.equal(optimizer.routed[finite], sound.routed[finite])
    assert torch.equal(optimizer.norms[finite], sound.norms[finite])
    before = state_of(rollout, optimizer)
    optimizer.step(finite)
    sound.step()
    after, expected = state_of(rollout, optimizer), state_of(reference, sound)
    for name in MOVED:
        assert torch.equal(after[name][finite], expected[name][finite]), name
        assert torch.equal(after[name][~finite].nan_to_num(), before[name][~finite].nan_to_num()), name


def test_a_gradient_that_is_not_finite_is_named_wherever_it_is(given_gradients):
    case = given_gradients(n=3)
    for v in case.layout.variables:
        for bad in (torch.nan, torch.inf, -torch.inf):
            case.given.fill_(0.1)
            case.given[1, v.offset + v.size - 1] = bad
            assert case.optimizer.gradient().tolist() == [True, False, True], v.name
    case.given.fill_(0.1)
    assert case.optimizer.gradient().tolist() == [True, True, True]


@pytest.mark.parametrize("loss", ["combined", "specialized"])
def test_a_network_of_a_stack_trains_as_it_does_alone_to_the_last_bit(training, loss):
    with contextlib.closing(Workers(2)) as workers:
        stack = training(loss=loss, workers=workers)
        each_alone = [training(slice(s, s + 1), loss=loss) for s in range(5)]
        for _ in range(5):
            for trained in (stack, *each_alone):
                assert update(*trained).all()
            for s, alone in enumerate(each_alone):
                for name, values in state_of(*alone).items():
                    assert torch.equal(state_of(*stack)[name][s : s + 1], values), name
