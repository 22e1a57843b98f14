"""The step's adjoint: against finite differences, finite where the arm has kinks, and well-behaved in torch."""

import gc
import itertools
import weakref

import numpy as np
import pytest
import torch

from bilateral_rl.envs import Arm, ArmParameters, ArmState

UPPER = np.radians([135.0, 155.0])
ACTIVATION, FORCE = 0, 6
ARMS = {
    "the paper's": ArmParameters(),
    "late passive force": ArmParameters(normalized_slack_muscle_length=1.4),
    "high minimal activation": ArmParameters(min_activation=0.05),
    "fast activation": ArmParameters(tau_activation=0.005, tau_deactivation=0.02),
    "short optimal lengths": ArmParameters(optimal_muscle_length=(0.06, 0.06, 0.05, 0.05, 0.06, 0.06)),
    "long tendons": ArmParameters(tendon_length=(0.15, 0.20, 0.25, 0.23, 0.30, 0.28)),
}


@pytest.fixture(params=ARMS.values(), ids=ARMS.keys())
def parameters(request):
    return request.param


def moving_arms(n, dtype=torch.float64, parameters=None, seed=0):
    """An arm, and ``n`` states, excitations and loads away from every kink: joint limits, saturation, rest."""
    rng = np.random.default_rng(seed)
    arm = Arm(parameters, dtype=dtype)
    joint = np.hstack([rng.uniform(0.15, 0.85, (n, 2)) * UPPER, rng.uniform(-3, 3, (n, 2))])
    state = arm.state(torch.tensor(joint))
    muscle = state.muscle.clone()
    muscle[:, ACTIVATION] = torch.tensor(rng.uniform(0.1, 0.9, (n, 6)))
    muscle[:, FORCE] = torch.tensor(rng.uniform(0.0, 300.0, (n, 6)))
    excitation = torch.tensor(rng.uniform(0.1, 0.9, (n, 6)), dtype=dtype)
    load = torch.tensor(rng.uniform(-10, 10, (n, 2)), dtype=dtype)
    return arm, ArmState(state.joint, muscle, state.cartesian), excitation, load


def differentiable(*tensors):
    return tuple(t.detach().clone().requires_grad_() for t in tensors)


def roll(arm, state, excitations, load):
    for excitation in excitations:
        state = arm.step(state, excitation, load)
    return state


def gradients_after(arm, state, excitation, load, steps=10):
    """Gradients of a loss on everything in the final state with respect to joint, muscle, excitation and load."""
    inputs = differentiable(state.joint, state.muscle, excitation, load)
    joint, muscle, excitation, load = inputs
    end = roll(arm, ArmState(joint, muscle, state.cartesian), [excitation] * steps, load)
    loss = end.joint.square().sum() + end.cartesian.square().sum() + 1e-3 * end.muscle.sum()
    return end, torch.autograd.grad(loss, inputs)


def assert_finite(end, gradients):
    for name, values in zip(("joint", "muscle", "cartesian"), end, strict=True):
        assert torch.isfinite(values).all(), f"state: {name}"
    for name, values in zip(("joint", "muscle", "excitation", "load"), gradients, strict=True):
        assert torch.isfinite(values).all(), f"gradient: {name}"


def test_adjoint_of_a_step_is_its_finite_difference(parameters):
    arm, state, excitation, load = moving_arms(8, parameters=parameters)

    def step(joint, muscle, excitation, load):
        return tuple(arm.step(ArmState(joint, muscle, state.cartesian), excitation, load))

    inputs = differentiable(state.joint, state.muscle, excitation, load)
    assert torch.autograd.gradcheck(step, inputs, eps=1e-6, atol=1e-4, rtol=1e-5)


def test_adjoint_of_five_steps_is_their_finite_difference():
    arm, state, excitation, load = moving_arms(3)
    excitations = torch.stack([excitation, 1 - excitation, 0.5 * excitation + 0.1, excitation, 0.9 * excitation])

    def hand_after(joint, muscle, excitations, load):
        end = roll(arm, ArmState(joint, muscle, state.cartesian), excitations, load)
        return end.cartesian, end.joint

    inputs = differentiable(state.joint, state.muscle, excitations, load)
    assert torch.autograd.gradcheck(hand_after, inputs, eps=1e-6, atol=1e-7, rtol=1e-4)


def test_finite_difference_states_cover_both_branches_of_every_curve():
    arm, state, excitation, load = moving_arms(8)
    after = arm.step(state, excitation, load).muscle
    length = after[:, 1] / torch.tensor(arm.parameters.optimal_muscle_length)
    for quantity, kink in ((after[:, 2], 0.0), (length, 1.0), (after[:, ACTIVATION], 0.3)):
        assert (quantity < kink).any()
        assert (quantity > kink).any()
    assert (excitation > state.muscle[:, ACTIVATION]).any()
    assert (excitation < state.muscle[:, ACTIVATION]).any()


def test_a_step_depends_on_muscle_state_through_activation_and_force_only():
    arm, state, excitation, load = moving_arms(4)
    _, (_, muscle, _, _) = gradients_after(arm, state, excitation, load, steps=1)
    assert (muscle[:, [ACTIVATION, FORCE]].abs().sum(dim=(0, 2)) > 0).all()
    assert (muscle[:, ACTIVATION + 1 : FORCE] == 0).all()


def test_an_excitation_outside_its_range_has_no_gradient():
    arm, state, u, load = moving_arms(2)
    for excitation in (-0.5, 0.0, 0.0005, 1.5):
        _, (_, _, gradient, _) = gradients_after(arm, state, torch.full_like(u, excitation), load)
        assert (gradient == 0).all()


def test_gradients_are_finite_at_the_limits_and_at_saturation(parameters):
    cases = itertools.product(
        (0.0, UPPER[0]),
        (0.0, UPPER[1]),
        (-5.0, 0.0, 5.0),
        (-1.0, 0.0, 0.001, 0.5, 1.0, 2.0),
        (parameters.min_activation, 1.0),
    )
    shoulder, elbow, velocity, excitation, activation = torch.tensor(list(cases), dtype=torch.float64).t()
    for dtype in (torch.float32, torch.float64):
        arm, n = Arm(parameters, dtype=dtype), len(shoulder)
        state = arm.state(torch.stack([shoulder, elbow, velocity, velocity], dim=1))
        muscle = state.muscle.clone()
        muscle[:, ACTIVATION] = activation[:, None]
        u, load = excitation[:, None].repeat(1, 6).to(dtype), torch.full((n, 2), 10.0, dtype=dtype)
        assert_finite(*gradients_after(arm, ArmState(state.joint, muscle, state.cartesian), u, load))


def test_gradients_are_finite_over_the_whole_range_of_states(parameters):
    for dtype in (torch.float32, torch.float64):
        rng = np.random.default_rng(0)
        n = 4096
        arm = Arm(parameters, dtype=dtype)
        joint = np.hstack([rng.uniform(-0.05, 1.05, (n, 2)) * UPPER, rng.uniform(-30, 30, (n, 2))])
        state = arm.state(torch.tensor(joint))
        muscle = state.muscle.clone()
        muscle[:, ACTIVATION] = torch.tensor(rng.uniform(-0.2, 1, (n, 6))).clamp(min=parameters.min_activation)
        u = torch.tensor(rng.uniform(-0.5, 1.5, (n, 6)), dtype=dtype)
        load = torch.tensor(rng.uniform(-10, 10, (n, 2)), dtype=dtype)
        assert_finite(*gradients_after(arm, ArmState(state.joint, muscle, state.cartesian), u, load, steps=3))


def test_a_joint_stopped_at_its_limit_passes_no_gradient_on():
    arm = Arm(dtype=torch.float64)
    rest = arm.rest(torch.tensor([[0.0, 1.0]]))
    (joint,) = differentiable(torch.tensor([[0.0, 1.0, -5.0, 0.0]], dtype=torch.float64))
    after = arm.step(ArmState(joint, rest.muscle, rest.cartesian), torch.zeros(1, 6, dtype=torch.float64))
    assert after.joint[0, 0] == 0
    assert after.joint[0, 2] == 0
    (gradient,) = torch.autograd.grad(after.joint[0, 0] + after.joint[0, 2], joint)
    assert (gradient == 0).all()


def test_single_precision_agrees_with_double():
    double = gradients_after(*moving_arms(64))
    single = gradients_after(*moving_arms(64, dtype=torch.float32))
    for exact, rounded in zip((*double[0], *double[1]), (*single[0], *single[1]), strict=True):
        assert rounded.dtype == torch.float32
        scale = exact.abs().max()
        assert (rounded - exact).abs().max() < 1e-4 * scale


def test_a_batch_is_its_arms_one_by_one():
    arm, state, excitation, load = moving_arms(7, dtype=torch.float32)
    end, gradients = gradients_after(arm, state, excitation, load)
    for i in range(7):
        one = slice(i, i + 1)
        alone, alone_gradients = gradients_after(arm, ArmState(*(t[one] for t in state)), excitation[one], load[one])
        for together, single in zip((*end, *gradients), (*alone, *alone_gradients), strict=True):
            assert torch.equal(together[one], single)


def test_backward_leaves_the_callers_gradients_alone():
    arm, state, excitation, load = moving_arms(2)
    (u,) = differentiable(excitation)
    after = arm.step(state, u, load)
    upstream = tuple(torch.ones_like(t) for t in after)
    first = torch.autograd.grad(tuple(after), u, upstream, retain_graph=True)[0]
    assert all((t == 1).all() for t in upstream)
    assert torch.equal(torch.autograd.grad(tuple(after), u, upstream)[0], first)


def test_inputs_of_another_dtype_or_layout_are_converted_and_keep_their_gradient():
    arm, state, excitation, load = moving_arms(3)
    (single,) = differentiable(excitation.float())
    (strided,) = differentiable(excitation.T.contiguous())
    for u, given in ((single, single), (strided, strided.T)):
        (gradient,) = torch.autograd.grad(arm.step(state, given, load).muscle[:, FORCE].sum(), u)
        assert gradient.dtype == u.dtype
        assert gradient.shape == u.shape
        assert (gradient != 0).all()


def test_a_forgotten_trajectory_is_freed():
    arm, state, excitation, load = moving_arms(2)
    (u,) = differentiable(excitation)
    middle = arm.step(state, u, load)
    end = arm.step(middle, u, load)
    end.joint.sum().backward()
    alive = [weakref.ref(t) for t in (*middle, *end)]
    del middle, end
    gc.collect()
    assert [ref() for ref in alive] == [None] * 6


@pytest.mark.parametrize("changed", ["excitation", "state"])
def test_changing_what_the_gradient_needs_in_place_is_an_error(changed):
    arm, state, excitation, load = moving_arms(2)
    (u,) = differentiable(excitation)
    command = u * 1.0
    middle = arm.step(state, command, load)
    end = arm.step(middle, command, load)
    with torch.no_grad():
        (command if changed == "excitation" else middle.muscle).mul_(2)
    with pytest.raises(RuntimeError, match="inplace"):
        end.joint.sum().backward()


def test_second_derivatives_are_refused_rather_than_dropped():
    arm, state, excitation, load = moving_arms(2)
    (u,) = differentiable(excitation)
    force = arm.step(state, u, load).muscle[:, FORCE]
    (gradient,) = torch.autograd.grad(force.square().sum(), u, create_graph=True)
    with pytest.raises(RuntimeError, match="once_differentiable"):
        (u.sum() + gradient.square().sum()).backward()


def test_states_and_inputs_that_disagree_in_size_are_rejected():
    arm, state, excitation, load = moving_arms(3)
    cases = {
        "excitation": (state, excitation[:2], load),
        "load": (state, excitation, load[:2]),
        "muscle": (ArmState(state.joint, state.muscle[:1], state.cartesian), excitation, load),
        "joint": (ArmState(state.joint[:, :3], state.muscle, state.cartesian), excitation, load),
    }
    for name, (given_state, given_excitation, given_load) in cases.items():
        with pytest.raises(ValueError, match=name):
            arm.step(given_state, given_excitation, given_load)


def test_rest_rejects_angles_of_another_shape():
    for shape in ((2,), (3, 3), (1, 2, 2)):
        with pytest.raises(ValueError, match=r"\(n, 2\)"):
            Arm().rest(torch.zeros(shape))


def test_a_dtype_without_kernels_is_rejected():
    with pytest.raises(ValueError, match="float16"):
        Arm(dtype=torch.float16)
