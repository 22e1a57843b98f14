"""The stacked rollout is the arm's step and the torch network in a loop, and its gradients are theirs."""

import itertools
from types import SimpleNamespace

import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bilateral_rl.analysis.modulation import contributions
from bilateral_rl.bptt.rollout import TrajectoryGradients
from bilateral_rl.bptt.workers import Workers
from bilateral_rl.envs import ArmParameters
from bilateral_rl.policies.lesions import NO_LESION, RELEASED_LESIONS, find_lesion

# Every one of these costs a compilation: other tests use the same.
SHAPES = [
    ("unilateral", 10, 2),
    ("unilateral", 7, 1),
    ("unilateral", 4, 3),
    ("bilateral", 10, 2),
    ("bilateral", 2, 1),
    ("bilateral", 6, 3),
    ("callosal", 10, 2),
    ("callosal", 8, 4),
]
TWO_SIDED = [shape for shape in SHAPES if shape[0] != "unilateral"]
THREE = [("unilateral", 4, 3), ("bilateral", 6, 3), ("callosal", 10, 2)]
PAPERS = ("callosal", 10, 2)
TERM_WEIGHTS = torch.tensor([[1.0, 2.0, 3.0], [0.5, 0.0, 1.0]], dtype=torch.float64)
OTHER_ARM = ArmParameters(
    timestep=0.008,
    normalized_slack_muscle_length=1.3,
    normalized_max_velocity=8.0,
    min_activation=0.02,
    optimal_muscle_length=(0.12, 0.15, 0.09, 0.10, 0.13, 0.14),
)
WATCHED = ("joint", "muscle", "hand", "hidden")

few = settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
each_shape = pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: "-".join(map(str, shape)))
each_two_sided_shape = pytest.mark.parametrize("shape", TWO_SIDED, ids=lambda shape: "-".join(map(str, shape)))


def offsets(rollout):
    return {v.name: v.offset for v in rollout.layout.variables}


@pytest.fixture(scope="module")
def workers():
    """Workers by their number."""
    by_number = {n: Workers(n) for n in range(1, 6)}
    yield by_number
    for some in by_number.values():
        some.close()


@pytest.fixture
def assert_same_trajectories(trajectories):
    def check(rollout, path):
        for name in trajectories:
            own, expected = getattr(rollout, name), getattr(path, name).detach()
            assert own.shape == expected.shape, name
            torch.testing.assert_close(own, expected, rtol=1e-11, atol=1e-12, msg=lambda m, name=name: f"{name}: {m}")

    return check


def lesions_of(network):
    """Every state that its architecture can have, the released code's own lesions too."""
    available = [find_lesion(name) for name in network.available_lesions()]
    own = [lesion for lesion in RELEASED_LESIONS.values() if lesion not in available]
    return [NO_LESION, *available, *(own if network.architecture == "callosal" else [])]


def weighted(term_weights, terms):
    """A loss of each stream: the sum over networks, trials and steps of the weighted terms."""
    return [(terms * weights).sum() for weights in term_weights]


def random_upstream(rollout, names, seed=0):
    """Gradients of each stream's loss with respect to trajectories, of the size of the terms' or so."""
    generator = torch.Generator().manual_seed(seed)
    scale = {"joint": 0.3, "muscle": 0.01, "hand": 1.0, "hidden": 0.3}
    streams = rollout.size.n_streams
    return TrajectoryGradients(
        **{
            name: scale[name]
            * torch.randn(streams, *getattr(rollout, name).shape, generator=generator, dtype=torch.float64)
            for name in names
        }
    )


def with_upstream(losses, upstream, path):
    """The streams' losses plus those that have the gradients ``upstream`` with respect to ``path``."""
    given_seeds = {name: seed for name, seed in upstream._asdict().items() if seed is not None}
    return [
        loss + sum((seed[stream] * getattr(path, name)).sum() for name, seed in given_seeds.items())
        for stream, loss in enumerate(losses)
    ]


@each_shape
def test_trajectories_and_gradients_are_those_of_the_arms_step_and_the_torch_network(
    random_networks, make_rollout, roll_in_torch, gradient_rows, assert_same_trajectories, assert_rows_close, shape
):
    networks = random_networks(*shape)
    rollout = make_rollout(networks, n_trials=4, n_steps=20, n_streams=2, limits=True)
    rollout.forward()
    path = roll_in_torch(networks, rollout)
    assert_same_trajectories(rollout, path)
    assert (path.joint[..., 2:] == 0).any(), "some joint is stopped at its limit"
    assert (path.hand[:, :, 0] - path.hand[:, :, -1]).norm(dim=-1).max() > 0.02, "something moves"
    gradient = rollout.backward(TERM_WEIGHTS)
    losses = weighted(TERM_WEIGHTS, path.terms)
    expected = torch.stack([gradient_rows(rollout.layout, networks, loss) for loss in losses])
    assert_rows_close(rollout.layout, gradient, expected, rtol=1e-9)
    end = sum(v.size for v in rollout.layout.variables)
    assert (gradient[..., end:] == 0).all()


@each_two_sided_shape
def test_networks_with_each_a_lesion_of_its_own_have_torchs_trajectories_and_gradients(
    random_networks, make_rollout, roll_in_torch, gradient_rows, set_lesions, assert_same_trajectories,
    assert_rows_close, shape,
):  # fmt: skip
    """A gradient of 0, where a lesion closes the way, is exactly 0: the comparison is relative to each norm."""
    lesions = lesions_of(random_networks(*shape, n=1)[0])
    networks = random_networks(*shape, n=len(lesions))
    rollout = make_rollout(networks, n_trials=2, n_streams=2, watches_state=True, watches_activity=True)
    set_lesions(rollout, networks, lesions)
    rollout.forward()
    path = roll_in_torch(networks, rollout)
    assert_same_trajectories(rollout, path)
    for upstream in (TrajectoryGradients(), random_upstream(rollout, WATCHED)):
        losses = with_upstream(weighted(TERM_WEIGHTS, path.terms), upstream, path)
        expected = torch.stack([gradient_rows(rollout.layout, networks, loss) for loss in losses])
        assert_rows_close(rollout.layout, rollout.backward(TERM_WEIGHTS, upstream), expected, rtol=1e-9)


@each_two_sided_shape
def test_what_each_side_contributes_is_that_of_the_torch_network(random_networks, make_rollout, set_lesions, shape):
    lesions = lesions_of(random_networks(*shape, n=1)[0])
    networks = random_networks(*shape, n=len(lesions))
    rollout = make_rollout(networks, n_trials=2)
    set_lesions(rollout, networks, lesions)
    rollout.forward()
    for index, network in enumerate(networks):
        record = SimpleNamespace(observation=rollout.observation[index].numpy())
        for own, expected in zip(rollout.contributions(index), contributions(network, record.observation), strict=True):
            torch.testing.assert_close(own, torch.from_numpy(expected), rtol=1e-9, atol=1e-12)


def test_a_network_is_restored_from_its_lesion(random_networks, make_rollout, trajectories):
    rollout = make_rollout(random_networks(*PAPERS, n=1), n_streams=1)
    rollout.forward()
    before = [getattr(rollout, name).clone() for name in trajectories]
    gradient = rollout.backward(TERM_WEIGHTS[:1]).clone()
    rollout.set_lesions([find_lesion("callosum_deep_dominant")])
    rollout.forward()
    assert not torch.equal(rollout.hand, before[2])
    assert not torch.equal(rollout.backward(TERM_WEIGHTS[:1]), gradient)
    rollout.set_lesions([NO_LESION])
    rollout.forward()
    assert all(torch.equal(getattr(rollout, name), old) for name, old in zip(trajectories, before, strict=True))
    assert torch.equal(rollout.backward(TERM_WEIGHTS[:1]), gradient)


def test_every_network_needs_its_lesion(random_networks, make_rollout):
    rollout = make_rollout(random_networks(*PAPERS, n=3))
    with pytest.raises(ValueError):  # noqa: PT011
        rollout.set_lesions([NO_LESION] * 2)


def test_another_arm_has_its_own_trajectories_and_gradients(
    random_networks, make_rollout, roll_in_torch, gradient_rows, assert_same_trajectories, assert_rows_close
):
    networks = random_networks(*PAPERS)
    rollout = make_rollout(networks, arm=OTHER_ARM, n_steps=20, n_streams=2, limits=True)
    rollout.forward()
    path = roll_in_torch(networks, rollout, arm=OTHER_ARM)
    assert_same_trajectories(rollout, path)
    losses = weighted(TERM_WEIGHTS, path.terms)
    expected = torch.stack([gradient_rows(rollout.layout, networks, loss) for loss in losses])
    assert_rows_close(rollout.layout, rollout.backward(TERM_WEIGHTS), expected, rtol=1e-9)


@few
@given(
    n_networks=st.integers(1, 3),
    n_trials=st.integers(1, 5),
    n_steps=st.integers(1, 7),
    n_streams=st.integers(1, 3),
    n_threads=st.integers(1, 4),
    seed=st.integers(0, 100),
)
def test_any_number_of_networks_trials_steps_streams_and_threads(
    random_networks, make_rollout, roll_in_torch, gradient_rows, assert_same_trajectories, assert_rows_close,
    workers, n_networks, n_trials, n_steps, n_streams, n_threads, seed,
):  # fmt: skip
    networks = random_networks(*PAPERS, n=n_networks, seed=seed)
    rollout = make_rollout(networks, n_trials, n_steps, seed=seed, n_streams=n_streams, workers=workers[n_threads])
    rollout.forward()
    path = roll_in_torch(networks, rollout)
    assert_same_trajectories(rollout, path)
    term_weights = torch.rand(n_streams, 3, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    losses = weighted(term_weights, path.terms)
    expected = torch.stack([gradient_rows(rollout.layout, networks, loss) for loss in losses])
    assert_rows_close(rollout.layout, rollout.backward(term_weights), expected, rtol=1e-9)


@pytest.mark.parametrize("shape", THREE, ids=lambda shape: "-".join(map(str, shape)))
def test_gradients_of_losses_on_trajectories_are_autograds(
    random_networks, make_rollout, roll_in_torch, gradient_rows, assert_rows_close, shape
):
    networks = random_networks(*shape)
    rollout = make_rollout(networks, n_trials=3, n_streams=2, watches_state=True, watches_activity=True)
    rollout.forward()
    path = roll_in_torch(networks, rollout)
    for names, term_weights in itertools.product(
        [*((name,) for name in WATCHED), WATCHED], [0 * TERM_WEIGHTS, TERM_WEIGHTS]
    ):
        upstream = random_upstream(rollout, names)
        losses = with_upstream(weighted(term_weights, path.terms), upstream, path)
        expected = torch.stack([gradient_rows(rollout.layout, networks, loss) for loss in losses])
        assert_rows_close(rollout.layout, rollout.backward(term_weights, upstream), expected, rtol=1e-9)


@pytest.mark.parametrize("shape", [("unilateral", 7, 1), ("bilateral", 2, 1), ("callosal", 10, 2)], ids=str)
def test_gradients_are_finite_differences_of_the_loss(random_networks, make_rollout, assert_rows_close, shape):
    """Every weight is moved up and down by itself, in a stack of as many networks as that takes."""
    (network,) = random_networks(*shape, n=1)
    rollout = make_rollout([network], n_trials=3, n_streams=1, watches_state=True, watches_activity=True)
    rollout.forward()
    upstream = random_upstream(rollout, WATCHED)
    gradient = rollout.backward(TERM_WEIGHTS[:1], upstream)[0]

    n, step = sum(v.size for v in rollout.layout.variables), 1e-6
    moved = make_rollout([network] * (2 * n), n_trials=3)
    moves = step * torch.eye(n, rollout.layout.width, dtype=torch.float64)
    moved.weights += torch.cat([moves, -moves])
    for part, own in zip(moved.trials, rollout.trials, strict=True):
        part.copy_(own)
    moved.forward()
    losses = (moved.terms * TERM_WEIGHTS[0]).flatten(1).sum(1)
    losses += sum((getattr(moved, name) * getattr(upstream, name)[0]).flatten(1).sum(1) for name in WATCHED)
    difference = torch.zeros_like(gradient)
    difference[0, :n] = (losses[:n] - losses[n:]) / (2 * step)
    assert_rows_close(rollout.layout, gradient, difference, rtol=1e-6)


def test_seeds_of_one_backward_are_forgotten_by_the_next(random_networks, make_rollout):
    rollout = make_rollout(random_networks(*PAPERS), n_streams=2, watches_state=True, watches_activity=True)
    rollout.forward()
    before = rollout.backward(TERM_WEIGHTS).clone()
    rollout.backward(TERM_WEIGHTS, random_upstream(rollout, WATCHED))
    assert torch.equal(rollout.backward(TERM_WEIGHTS), before)
    assert torch.equal(rollout.backward(TERM_WEIGHTS, TrajectoryGradients()), before)


def test_seeds_without_room_are_refused(random_networks, make_rollout):
    for name in WATCHED:
        room = {"watches_state": name == "hidden", "watches_activity": name != "hidden"}
        rollout = make_rollout(random_networks(*PAPERS), n_streams=2, **room)
        rollout.forward()
        with pytest.raises(ValueError, match="without room for gradients"):
            rollout.backward(TERM_WEIGHTS, random_upstream(rollout, [name]))


def test_weights_and_trials_are_read_anew_each_time(random_networks, make_rollout, trajectories):
    rollout = make_rollout(random_networks(*PAPERS), n_streams=2)
    other = make_rollout(random_networks(*PAPERS, seed=1), n_streams=2, seed=1)
    results = []
    for each in (rollout, other):
        each.forward()
        each.backward(TERM_WEIGHTS)
        results.append([getattr(each, name).clone() for name in (*trajectories, "gradient")])
    rollout.weights.copy_(other.weights)
    for own, given_part in zip(rollout.trials, other.trials, strict=True):
        own.copy_(given_part)
    rollout.forward()
    rollout.backward(TERM_WEIGHTS)
    for name, first, second in zip((*trajectories, "gradient"), *results, strict=True):
        assert not torch.equal(first, second), name
        assert torch.equal(getattr(rollout, name), second), name


def in_single_precision(random_networks, make_rollout, s=slice(None), n_trials=4, n_steps=8, shape=PAPERS, **settings):
    """A rollout of those of five networks that ``s`` says, after forward and backward."""
    networks = random_networks(*shape, n=5, dtype=torch.float32)
    every = make_rollout(networks, n_trials, n_steps)
    rollout = make_rollout(
        networks[s], n_trials, n_steps, n_streams=2, watches_state=True, watches_activity=True, **settings
    )
    for own, part in zip(rollout.trials, every.trials, strict=True):
        own.copy_(part[s])
    rollout.forward()
    shapes = make_rollout(networks, n_trials, n_steps, n_streams=2)
    upstream = {name: seed[:, s].float() for name, seed in random_upstream(shapes, WATCHED)._asdict().items()}
    rollout.backward(TERM_WEIGHTS, TrajectoryGradients(**upstream))
    return rollout


@few
@given(s=st.integers(0, 4), n_trials=st.integers(1, 9), n_steps=st.integers(1, 12))
@pytest.mark.parametrize("shape", [("unilateral", 10, 2), ("callosal", 10, 2)], ids=str)
def test_a_network_of_a_stack_is_that_network_alone_to_the_last_bit(
    random_networks, make_rollout, trajectories, shape, s, n_trials, n_steps
):
    size = {"n_trials": n_trials, "n_steps": n_steps, "shape": shape}
    stack = in_single_precision(random_networks, make_rollout, **size)
    alone = in_single_precision(random_networks, make_rollout, slice(s, s + 1), **size)
    for name in trajectories:
        assert torch.equal(getattr(stack, name)[s : s + 1], getattr(alone, name)), name
    assert torch.equal(stack.gradient[:, s : s + 1], alone.gradient)


@few
@given(n_threads=st.integers(2, 5), n_trials=st.integers(1, 9), n_steps=st.integers(1, 12))
def test_threads_change_no_bit(random_networks, make_rollout, trajectories, workers, n_threads, n_trials, n_steps):
    size = {"n_trials": n_trials, "n_steps": n_steps}
    one = in_single_precision(random_networks, make_rollout, **size)
    several = in_single_precision(random_networks, make_rollout, **size, workers=workers[n_threads])
    for name in (*trajectories, "gradient"):
        assert torch.equal(getattr(one, name), getattr(several, name)), name


def test_the_papers_batch_is_the_same_alone_in_a_stack_and_by_two_threads(
    random_networks, make_rollout, trajectories, workers
):
    size = {"n_trials": 64, "n_steps": 50}
    stack = in_single_precision(random_networks, make_rollout, **size)
    threaded = in_single_precision(random_networks, make_rollout, **size, workers=workers[2])
    alone = in_single_precision(random_networks, make_rollout, slice(3, 4), **size)
    for name in trajectories:
        assert torch.equal(getattr(stack, name), getattr(threaded, name)), name
        assert torch.equal(getattr(stack, name)[3:4], getattr(alone, name)), name
    assert torch.equal(stack.gradient, threaded.gradient)
    assert torch.equal(stack.gradient[:, 3:4], alone.gradient)


def test_what_is_not_a_number_in_one_network_stays_there(random_networks, make_rollout, trajectories):
    networks = random_networks(*PAPERS, n=3)
    rollout = make_rollout(networks, n_streams=2)
    rollout.forward()
    names = (*trajectories, "gradient")
    rollout.backward(TERM_WEIGHTS)
    before = [getattr(rollout, name).clone() for name in names]
    rollout.weights[1, offsets(rollout)["dominant.1.weight"]] = torch.nan
    rollout.forward()
    assert rollout.backward(TERM_WEIGHTS)[:, 1].isnan().any()
    for name, old in zip(names, before, strict=True):
        for s in (0, 2):
            axis = 1 if name == "gradient" else 0
            assert torch.equal(getattr(rollout, name).select(axis, s), old.select(axis, s)), name


def test_saturated_units_have_finite_gradients(random_networks, make_rollout):
    rollout = make_rollout(random_networks(*PAPERS, dtype=torch.float32), n_streams=2)
    rollout.weights *= 1e3
    rollout.forward()
    assert (rollout.hidden.abs() == 1).any()
    assert ((rollout.excitation == 0) | (rollout.excitation == 1)).any()
    assert rollout.backward(TERM_WEIGHTS).isfinite().all()


def test_single_precision_agrees_with_double(random_networks, make_rollout, assert_rows_close, trajectories):
    for shape in THREE:
        double, single = (
            make_rollout(random_networks(*shape, dtype=dtype), n_streams=2, n_steps=20)
            for dtype in (torch.float64, torch.float32)
        )
        for rollout in (double, single):
            rollout.forward()
            rollout.backward(TERM_WEIGHTS)
        for name in trajectories:
            exact = getattr(double, name)
            assert getattr(single, name).dtype == torch.float32
            assert (getattr(single, name) - exact).abs().max() < 1e-5 * exact.abs().max(), name
        assert_rows_close(double.layout, single.gradient.double(), double.gradient, rtol=1e-4)


def test_without_streams_there_are_trajectories_only(random_networks, make_rollout, trajectories):
    networks = random_networks(*PAPERS)
    rollouts = [make_rollout(networks, n_streams=n) for n in (0, 2)]
    for rollout in rollouts:
        rollout.forward()
    for name in trajectories:
        assert torch.equal(getattr(rollouts[0], name), getattr(rollouts[1], name)), name
