"""The streams' losses: their weights (paper section 4), their values, and their gradients."""

import itertools

import pytest
import torch
from hemispheric_models import PENALTY_ON_GROUP

from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.losses import StreamLosses
from bilateral_rl.bptt.optimizer import StackedAdam
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.envs import ArmParameters
from bilateral_rl.policies import make_network
from bilateral_rl.vocabulary import LOSSES, PENALTIES

# Weights of Cartesian 1, Cartesian 2 and activation, and of the weight penalty.
DOMINANT, NON_DOMINANT, COMBINED = ([0.0, 5.0, 2.0], 0.0), ([5.0, 0.0, 0.0], 2.0), ([2.5, 2.5, 1.0], 1.0)
STREAMS = {
    "combined": [COMBINED],
    "dominant": [DOMINANT],
    "non_dominant": [NON_DOMINANT],
    "specialized": [DOMINANT, NON_DOMINANT],
}
STREAMS_OF_MODEL = {
    "uni_b": [COMBINED],
    "uni_dl": [DOMINANT],
    "uni_ndl": [NON_DOMINANT],
    "bi_ns": [COMBINED],
    "bi_s": [DOMINANT, NON_DOMINANT],
    "cc_ns": [COMBINED],
    "cc_s": [DOMINANT, NON_DOMINANT],
}
OPTIMAL_LENGTH = (0.12, 0.15, 0.09, 0.10, 0.13, 0.14)
OTHER_ARM = ArmParameters(timestep=0.008, normalized_max_velocity=8.0, optimal_muscle_length=OPTIMAL_LENGTH)
SHAPES = [("unilateral", 10, 2), ("unilateral", 4, 3), ("bilateral", 2, 1), ("bilateral", 6, 3), ("callosal", 10, 2)]
PAPERS = ("callosal", 10, 2)
LENGTH, VELOCITY = 1, 2
# Losses divide their weights by the number of samples in float32: only a power of two is exact.
TRIALS, STEPS = 4, 8

each_shape = pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: "-".join(map(str, shape)))


def losses_of(model, kind="weights", coefficient=0.1):
    layout = Layout(make_network(MODELS[model].architecture, n_inputs=16, n_outputs=6))
    return StreamLosses(MODELS[model].loss, kind, coefficient, layout, ArmParameters())


def size_and_rate(x, dt):
    """(S,): mean x² + 0.05 · mean ẋ² of each network's ``x`` (S, B, T, …)."""
    rate = (x[:, :, 1:] - x[:, :, :-1]) / dt
    return x.square().flatten(1).mean(1) + 0.05 * rate.square().flatten(1).mean(1)


def penalty_on_trajectories(kind, path, n_layers, arm):
    """(S,): the penalty of kind ``activity`` or ``released`` on ``path``, unweighted."""
    if kind == "activity":
        return sum(size_and_rate(path.hidden[:, :, :, layer], arm.timestep) for layer in range(n_layers))
    optimal = torch.tensor(arm.optimal_muscle_length, dtype=torch.float64)
    length = path.muscle[:, :, :, LENGTH] / optimal
    velocity = path.muscle[:, :, :, VELOCITY] / (arm.normalized_max_velocity * optimal)
    outputs = [path.joint, path.muscle, torch.cat([length, velocity], dim=-1), path.hand]
    return sum(size_and_rate(x, arm.timestep) for x in outputs[:n_layers])


def losses_on(path, target, loss, penalty):
    """(S,) for each stream: the losses with a ``penalty`` (S,)."""
    error = path.hand - target[:, :, None]
    terms = [error.abs(), 10 * error.square(), path.excitation.square()]
    means = torch.stack([term.flatten(1).mean(1) for term in terms])
    return [torch.tensor(w, dtype=torch.float64) @ means + of_penalty * penalty for w, of_penalty in STREAMS[loss]]


def rollout_for(make_rollout, networks, losses, n_trials=TRIALS, n_steps=STEPS, arm=None):
    """A rollout with room for what ``losses`` need."""
    room = {"watches_state": losses.watches_state, "watches_activity": losses.watches_activity}
    rollout = make_rollout(networks, n_trials, n_steps, arm, n_streams=losses.n_streams, **room)
    rollout.forward()
    return rollout


def routed(rollout, losses, loss):
    """What moves each variable, by name."""
    optimizer = StackedAdam(rollout, losses, loss, learning_rate=1e-3, epsilon=1e-7, clip_norm=1.0)
    optimizer.gradient()
    return rollout.layout.unpack(optimizer.routed)


def test_weights_of_terms_and_penalty_are_the_papers():
    for model, streams in STREAMS_OF_MODEL.items():
        losses = losses_of(model)
        assert losses.term_weights.tolist() == [terms for terms, _ in streams]
        assert losses.penalty_weights == tuple(penalty for _, penalty in streams)
        assert losses.n_streams == len(streams)
    assert STREAMS_OF_MODEL.keys() == MODELS.keys()


def test_default_coefficients_are_the_papers():
    assert PENALTIES == {"weights": 0.001, "activity": 0.01, "released": 0.01}


def test_weights_decay_by_the_penalty_on_them_only():
    for model, streams in STREAMS_OF_MODEL.items():
        assert losses_of(model, "weights").weight_decay == [0.1 * penalty for _, penalty in streams]
        for kind in ("activity", "released"):
            assert set(losses_of(model, kind).weight_decay) == {0.0}


def test_losses_need_room_for_what_their_penalty_is_taken_of():
    for (model, streams), kind in itertools.product(STREAMS_OF_MODEL.items(), PENALTIES):
        has_penalty = any(penalty for _, penalty in streams)
        size = losses_of(model, kind).rollout_size(2, 3, 4)
        assert (size.n_networks, size.n_trials, size.n_steps, size.n_streams) == (2, 3, 4, len(streams))
        assert size.watches_state == (has_penalty and kind == "released")
        assert size.watches_activity == (has_penalty and kind == "activity")
        without = losses_of(model, kind, coefficient=0.0).rollout_size(2, 3, 4)
        assert not without.watches_state
        assert not without.watches_activity


@each_shape
def test_values_are_those_of_the_formula(random_networks, make_rollout, shape):
    networks = random_networks(*shape, n=3)
    rollout = make_rollout(networks, n_trials=5, n_steps=9, arm=OTHER_ARM)
    rollout.forward()
    squares = [sum(p.detach().square().sum() for p in network.parameters()) for network in networks]
    n_layers = rollout.hidden.shape[3]
    penalties = {"weights": 0.5 * torch.stack(squares)}
    penalties |= {
        kind: penalty_on_trajectories(kind, rollout, n_layers, OTHER_ARM) for kind in ("activity", "released")
    }
    for kind, loss in itertools.product(PENALTIES, LOSSES):
        losses = StreamLosses(loss, kind, 0.7, rollout.layout, OTHER_ARM)
        expected = torch.stack(losses_on(rollout, rollout.trials.target, loss, 0.7 * penalties[kind]))
        torch.testing.assert_close(losses.values(rollout), expected, rtol=1e-12, atol=0, msg=f"{kind}, {loss}")


def test_values_are_added_up_in_double_precision(random_networks, make_rollout):
    single = make_rollout(random_networks(*PAPERS, dtype=torch.float32), n_trials=64, n_steps=50)
    single.forward()
    losses = StreamLosses("specialized", "activity", 0.7, single.layout, ArmParameters())
    values = losses.values(single)
    assert values.dtype == torch.float64
    terms = single.terms.double().flatten(1, 2).mean(1)
    torch.testing.assert_close(values[0], terms @ torch.tensor(DOMINANT[0], dtype=torch.float64), rtol=1e-13, atol=0)


@each_shape
def test_gradients_of_penalties_on_trajectories_are_autograds(
    random_networks, make_rollout, roll_in_torch, gradient_rows, assert_rows_close, shape
):
    networks = random_networks(*shape)
    for kind, loss in itertools.product(("activity", "released"), LOSSES):
        losses = StreamLosses(loss, kind, 0.7, Layout(networks[0]), OTHER_ARM)
        rollout = rollout_for(make_rollout, networks, losses, arm=OTHER_ARM)
        path = roll_in_torch(networks, rollout, arm=OTHER_ARM)
        penalty = 0.7 * penalty_on_trajectories(kind, path, rollout.hidden.shape[3], OTHER_ARM)
        expected = [
            gradient_rows(rollout.layout, networks, of_stream.sum())
            for of_stream in losses_on(path, rollout.trials.target, loss, penalty)
        ]
        assert_rows_close(rollout.layout, losses.gradient(rollout), torch.stack(expected), rtol=1e-9)


def test_the_gradient_without_decay_is_that_of_the_terms(
    random_networks, make_rollout, roll_in_torch, gradient_rows, assert_rows_close
):
    networks = random_networks(*PAPERS)
    for loss in LOSSES:
        losses = StreamLosses(loss, "weights", 0.7, Layout(networks[0]), ArmParameters())
        rollout = rollout_for(make_rollout, networks, losses)
        of_streams = losses_on(roll_in_torch(networks, rollout), rollout.trials.target, loss, penalty=0.0)
        expected = torch.stack([gradient_rows(rollout.layout, networks, of_stream.sum()) for of_stream in of_streams])
        assert_rows_close(rollout.layout, losses.gradient(rollout), expected, rtol=1e-9)


@pytest.mark.parametrize("loss", LOSSES)
def test_the_penalty_on_weights_moves_each_group_as_the_routing_rule_says(random_networks, make_rollout, loss):
    (network,) = random_networks(*PAPERS, n=1)
    layout = Layout(network)
    with_penalty, without = (StreamLosses(loss, "weights", c, layout, ArmParameters()) for c in (0.7, 0.0))
    rollout = rollout_for(make_rollout, [network], with_penalty)
    before, after = routed(rollout, without, loss), routed(rollout, with_penalty, loss)
    for name, weights in network.named_parameters():
        expected = 0.7 * PENALTY_ON_GROUP[loss][network.group_of(name)] * weights.detach()
        if not expected.any():
            assert torch.equal(after[name], before[name]), name
        torch.testing.assert_close(after[name][0] - before[name][0], expected, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("kind", PENALTIES)
@pytest.mark.parametrize("loss", ["combined", "specialized"])
def test_a_network_of_a_stack_has_the_losses_and_gradients_it_has_alone(random_networks, make_rollout, kind, loss):
    networks = random_networks(*PAPERS, n=5, dtype=torch.float32)
    losses = StreamLosses(loss, kind, 0.01, Layout(networks[0]), ArmParameters())
    for size in ((3, 7), (64, 50)):
        stack = rollout_for(make_rollout, networks, losses, *size)
        values, gradient = losses.values(stack), losses.gradient(stack)
        for s in range(5):
            alone = rollout_for(make_rollout, networks[s : s + 1], losses, *size)
            for own, part in zip(alone.trials, stack.trials, strict=True):
                own[0] = part[s]
            alone.forward()
            assert torch.equal(losses.values(alone)[:, 0], values[:, s])
            assert torch.equal(losses.gradient(alone)[:, 0], gradient[:, s])
