"""Fields, pulses and channels on the hand: what they do to it, and what the batch says they did."""

import numpy as np
import pytest
from rich_tasks import Fixed, no_forces
from skeletons import jacobian, kinetic_energy

from bilateral_rl.envs import ArmParameters, TrialSettings
from bilateral_rl.envs.kinematics import hand_position
from bilateral_rl.envs.trials import TrialBatch

CURL = np.array([[0.0, 15.0], [-15.0, 0.0]])
SECONDS = 0.4


def begun(forces, steps=40, load=(0.0, 0.0), arm=None, n=1, velocity=(0.0, 0.0), goal=(1.0, 1.2)):
    """Arms at the beginning of a trial, whose joints already move."""
    task = Fixed(goal=goal, load=load, forces=forces)
    batch = TrialBatch(task, TrialSettings(trial_length=steps, arm=arm or ArmParameters()), n)
    batch.start(np.arange(n), task.trials(np.zeros((n, 0)), batch.settings))
    batch.joint[:, 2:] = velocity
    return batch


def hand_state(batch):
    """Position and velocity (n, 2) of the hands, in double precision."""
    joint = batch.joint.astype(np.float64)
    velocity = np.einsum("nij,nj->ni", jacobian(joint[:, :2]), joint[:, 2:])
    return hand_position(joint[:, :2], batch.settings.arm), velocity


def work_and_energy(timestep, forces, velocity):
    """Work of the force on the hand, and gain of kinetic energy (J), of an arm whose muscles cannot pull."""
    arm = ArmParameters(timestep=timestep, max_isometric_force=(1e-12,) * 6)
    batch = begun(forces, round(SECONDS / timestep), arm=arm, velocity=velocity)
    before, work = kinetic_energy(batch.joint.astype(np.float64)), 0.0
    for _ in range(batch.settings.trial_length):
        speed = hand_state(batch)[1]
        batch.step(np.full((1, 6), -1.0))
        work += (batch.force * speed).sum() * timestep
    return work, (kinetic_energy(batch.joint.astype(np.float64)) - before)[0], hand_state(batch)[0][0]


@pytest.mark.parametrize(
    "forces",
    [
        no_forces(position_gain=40 * np.eye(2), center=(0.1, 0.5)),
        no_forces(velocity_gain=CURL),
        no_forces(velocity_gain=-5 * np.eye(2)),
        no_forces(velocity_gain=0.3 * np.array([[-10.1, -11.2], [-11.2, 11.1]])),
    ],
    ids=["elastic", "curl", "viscous", "saddle"],
)
def test_the_work_of_a_field_is_the_gain_in_energy_to_first_order(forces):
    errors = []
    for timestep in (0.004, 0.002, 0.001):
        work, gain, _ = work_and_energy(timestep, forces, (1.0, -1.5))
        errors.append(abs(work - gain))
    assert errors[0] < 0.05
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.25)
    assert errors[1] / errors[2] == pytest.approx(2, rel=0.25)


def test_an_elastic_field_conserves_energy_to_first_order():
    stiffness, center = 40.0, np.array([0.25, 0.35])
    forces = no_forces(position_gain=stiffness * np.eye(2), center=center)
    start = hand_position((0.6, 1.5), ArmParameters())
    stored, drifts = 0.5 * stiffness * ((start - center) ** 2).sum(), []
    for timestep in (0.004, 0.002, 0.001):
        _, gain, end = work_and_energy(timestep, forces, (0.0, 0.0))
        drifts.append(gain + 0.5 * stiffness * ((end - center) ** 2).sum() - stored)
    assert stored > 0.3
    assert abs(drifts[2]) < 0.01 * stored
    assert drifts[0] / drifts[1] == pytest.approx(2, rel=0.2)
    assert drifts[1] / drifts[2] == pytest.approx(2, rel=0.2)


def test_a_curl_field_does_no_work_and_a_viscous_one_takes_energy():
    work, gain, _ = work_and_energy(0.001, no_forces(velocity_gain=CURL), (1.0, -1.5))
    assert abs(work) < 1e-6
    assert abs(gain) < 0.01
    assert work_and_energy(0.001, no_forces(velocity_gain=-5 * np.eye(2)), (1.0, -1.5))[1] < -0.05


def test_the_force_is_that_of_the_hand_before_the_step():
    elastic, center, load, pulse = np.array([[30.0, 4.0], [-2.0, 50.0]]), np.array([0.1, 0.4]), (1.0, -2.0), (4.0, 3.0)
    forces = no_forces(
        velocity_gain=CURL, position_gain=elastic, center=center, pulse=pulse, pulse_window=(3, 6)
    )  # fmt: skip
    batch = begun(forces, 10, load)
    np.testing.assert_array_equal(batch.force, [load])
    for step in range(10):
        position, velocity = hand_state(batch)
        batch.step(np.array([[1.0, -1, 0.5, -1, 0, -1]]))
        expected = load + velocity[0] @ CURL.T + elastic @ (center - position[0]) + (3 <= step < 6) * np.array(pulse)
        np.testing.assert_allclose(batch.force[0], expected, rtol=2e-4, atol=2e-4)


def test_a_constant_force_is_a_load_whatever_it_is_called():
    """A pulse over the whole trial moves the arm as a load does."""
    load, pulse = begun(no_forces(), 20, (3.0, -4.0)), begun(no_forces(pulse=(3.0, -4.0), pulse_window=(0, 20)), 20)
    plain = Fixed(load=(3.0, -4.0))
    without = TrialBatch(plain, load.settings, 1)
    without.start(np.arange(1), plain.trials(np.zeros((1, 0)), load.settings))
    for step in range(20):
        for batch in (load, pulse, without):
            batch.step(np.linspace(-1, 1, 6)[None] * np.cos(step))
            np.testing.assert_array_equal(batch.force, [[3.0, -4.0]])
    np.testing.assert_array_equal(pulse.joint, load.joint)
    np.testing.assert_array_equal(without.joint, load.joint)


def test_a_channel_keeps_the_hand_on_the_line_and_its_force_is_the_walls():
    stiffness, damping = 4000.0, 150.0
    batch, free = begun(no_forces(walls=(stiffness, damping)), 30), begun(no_forces(), 30)
    start = hand_state(batch)[0][0]
    along = hand_position((1.0, 1.2), ArmParameters()) - start
    along /= np.linalg.norm(along)
    normal = np.array([-along[1], along[0]])
    action, deviations, forces = np.array([[-0.9, -1, -1, -0.85, -1, -1]]), [], []
    for _ in range(30):
        position, velocity = hand_state(batch)
        batch.step(action), free.step(action)
        expected = -stiffness * normal @ (position[0] - start) - damping * normal @ velocity[0]
        np.testing.assert_allclose(batch.force[0], expected * normal, atol=2e-2)
        deviations.append(abs(normal @ (batch.hand[0] - start)))
        forces.append(abs(expected))
    assert max(forces) > 3
    assert max(deviations) < 1.3 * max(forces) / stiffness
    assert abs(along @ (batch.hand[0] - start)) > 0.05
    assert abs(normal @ (free.hand[0] - start)) > 10 * max(deviations)


def test_force_and_onset_are_read_and_not_written():
    for batch in (begun(no_forces()), TrialBatch(Fixed(), TrialSettings(), 1)):
        for name in ("force", "onset"):
            with pytest.raises(ValueError, match="read-only"):
                getattr(batch, name)[:] = 0
            with pytest.raises(AttributeError, match="cannot be replaced"):
                setattr(batch, name, 0)


def test_walls_without_a_line_are_refused():
    with pytest.raises(ValueError, match=r"^walls lie along the line from start to goal, which must not be the same"):
        begun(no_forces(walls=(4000.0, 150.0)), goal=(0.6, 1.5))
