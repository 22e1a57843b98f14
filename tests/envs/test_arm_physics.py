"""The arm moves as an arm does: properties that hold whatever the numbers are."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from skeletons import jacobian, kinetic_energy, mass_matrix

from bilateral_rl.envs import MUSCLE_NAMES, Arm, ArmParameters, ArmState

UPPER = np.radians([135.0, 155.0])
ACTIVATION, LENGTH, VELOCITY, FORCE = 0, 1, 2, 6

quick = settings(max_examples=30, deadline=None, derandomize=True, database=None)
commands = arrays(np.float64, (20, 3, 6), elements=st.floats(-1, 2))
postures = arrays(np.float64, (3, 2), elements=st.floats(0, 1)).map(lambda share: share * UPPER)
loads = arrays(np.float64, (3, 2), elements=st.floats(-50, 50))
velocities = arrays(np.float64, (3, 2), elements=st.floats(-20, 20))


def double(values):
    return torch.tensor(np.asarray(values), dtype=torch.float64)


def path(arm, state, excitations, load=None):
    states = [state]
    for excitation in excitations:
        states.append(arm.step(states[-1], excitation, load))
    return states


def without_muscle_force(arm, joint):
    state = arm.state(double(joint))
    muscle = state.muscle.clone()
    muscle[:, FORCE] = 0.0
    return ArmState(state.joint, muscle, state.cartesian)


def powerless_arm(timestep):
    """An arm whose muscles cannot pull: its motion is the skeleton's alone."""
    return Arm(ArmParameters(timestep=timestep, max_isometric_force=(1e-12,) * 6), dtype=torch.float64)


def random_postures(n, seed=0):
    return np.random.default_rng(seed).uniform(0.1, 0.9, (n, 2)) * UPPER


@quick
@given(commands, postures, velocities, loads)
def test_joints_stay_within_their_limits_under_any_command(command, posture, velocity, load):
    arm = Arm(dtype=torch.float64)
    start = arm.state(double(np.hstack([posture, velocity])))
    for state in path(arm, start, double(command), double(load)):
        angles = state.joint[:, :2].numpy()
        assert (angles >= 0).all()
        assert (angles <= UPPER).all()


@quick
@given(commands, postures)
def test_activation_stays_in_its_range_and_muscles_only_pull(command, posture):
    arm = Arm(dtype=torch.float64)
    for state in path(arm, arm.rest(double(posture)), double(command)):
        assert (state.muscle[:, ACTIVATION] >= 0.001).all()
        assert (state.muscle[:, ACTIVATION] <= 1).all()
        assert (state.muscle[:, FORCE] >= 0).all()
        assert torch.isfinite(state.muscle).all()


@quick
@given(commands, postures)
def test_a_command_outside_its_range_acts_as_the_nearest_bound(command, posture):
    arm = Arm(dtype=torch.float64)
    start = arm.rest(double(posture))
    outside, inside = path(arm, start, double(command)), path(arm, start, double(command.clip(0.001, 1.0)))
    for a, b in zip(outside, inside, strict=True):
        assert torch.equal(a.joint, b.joint)
        assert torch.equal(a.muscle, b.muscle)


@quick
@given(postures)
def test_an_arm_at_rest_without_force_stays_put(posture):
    arm = Arm(dtype=torch.float64)
    start = without_muscle_force(arm, np.hstack([posture, np.zeros((3, 2))]))
    assert torch.equal(arm.step(start, torch.ones(3, 6)).joint, start.joint)


def test_a_joint_moving_out_stops_at_its_limit_and_one_moving_in_does_not():
    arm = Arm(dtype=torch.float64)
    out, inward = np.array([-1.0, -1.0]), np.array([1.0, 1.0])
    joint = [[0, 0, *out], [*UPPER, *inward], [0, 0, *inward], [*UPPER, *out]]
    after = arm.step(without_muscle_force(arm, joint), torch.zeros(4, 6)).joint
    assert torch.equal(after[0], double([0, 0, 0, 0]))
    assert torch.equal(after[1], double([*UPPER, 0, 0]))
    torch.testing.assert_close(after[2, :2], double([0.01, 0.01]))
    torch.testing.assert_close(after[3, :2], double(UPPER - 0.01))
    assert (after[2, 2:] > 0).all()
    assert (after[3, 2:] < 0).all()


def test_position_is_integrated_with_the_old_velocity():
    arm = Arm(dtype=torch.float64)
    start = arm.state(double([[1.0, 1.0, 2.0, -3.0]]))
    torch.testing.assert_close(arm.step(start, torch.ones(1, 6)).joint[0, :2], double([1.02, 0.97]))


def test_muscle_lengths_are_those_of_the_geometry_one_step_ago():
    arm = Arm(dtype=torch.float64)
    start = arm.state(double([[1.0, 1.0, 2.0, -3.0]]))
    after = arm.step(start, torch.ones(1, 6))
    assert torch.equal(after.muscle[:, LENGTH : VELOCITY + 1], start.muscle[:, LENGTH : VELOCITY + 1])
    later = arm.step(after, torch.ones(1, 6))
    assert torch.equal(later.muscle[:, LENGTH], arm.state(after.joint).muscle[:, LENGTH])


def test_a_load_pushes_the_hand_by_its_jacobian_and_the_mass_matrix():
    angles, load = random_postures(20), np.random.default_rng(1).uniform(-10, 10, (20, 2))
    arm = Arm(dtype=torch.float64)
    start = without_muscle_force(arm, np.hstack([angles, np.zeros((20, 2))]))
    velocity = arm.step(start, torch.zeros(20, 6), double(load)).joint[:, 2:].numpy()
    torque = np.einsum("nij,ni->nj", jacobian(angles), load)
    expected = np.linalg.solve(mass_matrix(angles[:, 1]), torque[..., None])[..., 0]
    np.testing.assert_allclose(velocity, 0.01 * expected, rtol=1e-9, atol=1e-12)


def test_hand_velocity_is_the_jacobian_times_joint_velocity():
    joint = np.hstack([random_postures(20), np.random.default_rng(1).uniform(-5, 5, (20, 2))])
    cartesian = Arm(dtype=torch.float64).state(double(joint)).cartesian.numpy()
    expected = np.einsum("nij,nj->ni", jacobian(joint[:, :2]), joint[:, 2:])
    np.testing.assert_allclose(cartesian[:, 2:], expected, atol=1e-12)


def test_muscle_velocity_is_the_rate_of_muscle_length():
    arm, h = Arm(dtype=torch.float64), 1e-6
    joint = np.hstack([random_postures(20), np.random.default_rng(1).uniform(-5, 5, (20, 2))])
    moved = {sign: joint + sign * h * np.hstack([joint[:, 2:], np.zeros((20, 2))]) for sign in (-1, 1)}
    length = {sign: arm.state(double(values)).muscle[:, LENGTH] for sign, values in moved.items()}
    rate = (length[1] - length[-1]) / (2 * h)
    torch.testing.assert_close(arm.state(double(joint)).muscle[:, VELOCITY], rate, rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("muscle", "shoulder", "elbow"),
    [
        ("pectoralis", 1, 0),
        ("deltoid", -1, 0),
        ("brachioradialis", 0, 1),
        ("triceps lateral", 0, -1),
        ("biceps", 1, 1),
        ("triceps long", -1, -1),
    ],
)
def test_each_muscle_turns_the_joints_it_crosses(muscle, shoulder, elbow):
    arm, angles = Arm(dtype=torch.float64), random_postures(20)
    start = without_muscle_force(arm, np.hstack([angles, np.zeros((20, 2))]))
    start.muscle[:, FORCE, MUSCLE_NAMES.index(muscle)] = 100.0
    acceleration = arm.step(start, torch.zeros(20, 6)).joint[:, 2:].numpy() / 0.01
    torque = np.einsum("nij,nj->ni", mass_matrix(angles[:, 1]), acceleration)
    assert (np.sign(np.where(np.abs(torque) < 1e-9, 0, torque)) == (shoulder, elbow)).all()


def test_without_muscle_force_energy_is_conserved_to_first_order():
    """Explicit Euler's drift of the kinetic energy halves with the time step."""
    start = np.hstack([np.tile(UPPER / 2, (4, 1)), [[1.0, 1.0], [-1.0, 2.0], [2.0, -1.0], [-1.0, -1.0]]])

    def drift(timestep):
        arm = powerless_arm(timestep)
        state = arm.state(double(start))
        energy = kinetic_energy(state.joint.numpy())
        for _ in range(round(0.2 / timestep)):
            state = arm.step(state, torch.zeros(4, 6))
        return np.abs(kinetic_energy(state.joint.numpy()) / energy - 1)

    coarse, fine = drift(2e-3), drift(1e-3)
    assert (fine < 2e-2).all()
    np.testing.assert_allclose(coarse / fine, 2.0, rtol=0.1)


def test_a_smaller_time_step_converges_to_first_order():
    angles = random_postures(8)
    excitation = double(np.random.default_rng(1).uniform(0.05, 0.3, (8, 6)))

    def hand_after_a_tenth_of_a_second(timestep):
        arm = Arm(ArmParameters(timestep=timestep), dtype=torch.float64)
        states = path(arm, arm.rest(double(angles)), [excitation] * round(0.1 / timestep))
        return states[-1].cartesian[:, :2]

    exact = hand_after_a_tenth_of_a_second(2.5e-5)
    coarse = (hand_after_a_tenth_of_a_second(8e-4) - exact).norm()
    fine = (hand_after_a_tenth_of_a_second(4e-4) - exact).norm()
    assert coarse / fine == pytest.approx(2.0, rel=0.15)


def test_activation_follows_excitation_and_rises_faster_than_it_falls():
    arm, angles = Arm(dtype=torch.float64), double([[1.0, 1.0]])
    on = path(arm, arm.rest(angles), [torch.ones(1, 6)] * 100)
    off = path(arm, on[-1], [torch.zeros(1, 6)] * 400)
    rising = [float(s.muscle[0, ACTIVATION, 0]) for s in on]
    falling = [float(s.muscle[0, ACTIVATION, 0]) for s in off]
    assert rising == sorted(rising)
    assert falling == sorted(falling, reverse=True)
    assert rising[-1] == pytest.approx(1.0, abs=1e-3)
    assert falling[-1] == pytest.approx(0.001, abs=1e-3)
    assert sum(a < 0.5 for a in rising) < sum(a > 0.5 for a in falling)


def test_first_step_of_activation_is_the_hand_computed_one():
    """Thelen 2003: da/dt = (u − a) / (15 ms · (0.5 + 1.5 a)) when rising."""
    arm = Arm(dtype=torch.float64)
    after = arm.step(arm.rest(double([[1.0, 1.0]])), torch.full((1, 6), 0.5))
    expected = 0.001 + 0.01 * (0.5 - 0.001) / (0.015 * (0.5 + 1.5 * 0.001))
    assert after.muscle[0, ACTIVATION].numpy() == pytest.approx(expected)


@pytest.mark.parametrize(("slack", "least", "most"), [(1.0, 0.2, 0.4), (1.4, 0.003, 0.005)])
def test_an_undriven_arm_drifts_with_the_papers_passive_force_and_not_with_the_later_one(slack, least, most):
    arm = Arm(ArmParameters(normalized_slack_muscle_length=slack))
    start = arm.rest(torch.tensor(np.random.default_rng(0).uniform(0, 1, (1000, 2)) * UPPER))
    end = path(arm, start, [torch.zeros(1000, 6)] * 50)[-1]
    drift = (end.cartesian - start.cartesian)[:, :2].norm(dim=1).mean()
    assert least < drift < most
