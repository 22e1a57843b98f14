"""Fields and walls that are taken hold all over the workspace; those that would swing are refused."""

import numpy as np
import pytest
from rich_tasks import Fixed, no_forces

from bilateral_rl.envs import ArmEnv, ArmParameters, TrialSettings
from bilateral_rl.envs.arm.physics import ACTIVE_LENGTH, PASSIVE
from bilateral_rl.envs.experiments.forces import ForceChannel
from bilateral_rl.envs.kinematics import hand_position
from bilateral_rl.envs.stability import check_stability, mobility
from bilateral_rl.envs.trials import TrialBatch

ARM = ArmParameters()
CHANNEL_WALLS = ForceChannel().stiffness, ForceChannel().damping
CURL = np.array([[0.0, 1.0], [-1.0, 0.0]])
N, STEPS = 300, 100


@pytest.fixture(scope="module")
def channels():
    """Starts and goals (N, 2) (rad) all over the workspace, and the normals (N, 2) of the lines between them."""
    rng = np.random.default_rng(0)
    starts = rng.uniform([0.3, 0.4], [2.0, 2.3], (N, 2))
    goals = np.maximum(starts + rng.normal(0, 0.15, (N, 2)), 0.05)
    along = hand_position(goals, ARM) - hand_position(starts, ARM)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return starts, goals, np.stack([-along[:, 1], along[:, 0]], axis=1)


def batch_of(starts, goals, loads, forces, arm=ARM, steps=STEPS):
    """Arms at the beginning of these trials."""
    task = Fixed(starts, goals, loads, forces=forces)
    batch = TrialBatch(task, TrialSettings(trial_length=steps, arm=arm), len(starts))
    batch.start(np.arange(len(starts)), task.trials(np.zeros((len(starts), 0)), batch.settings))
    return batch


def deviations(channels, size, walls, excitations, arm=ARM, steps=STEPS):
    """Distance (steps, n) of hands from their lines under a load of ``size`` across (m)."""
    starts, goals, normals = channels
    batch = batch_of(starts, goals, size * normals, no_forces(walls=walls), arm, steps)
    action, start, across = (2 * excitations - 1).astype(np.float32), batch.hand.copy(), []
    for _ in range(steps):
        batch.step(action)
        across.append(((batch.hand - start) * normals).sum(axis=1))
    return np.array(across)


def cocontraction(starts, level):
    """Excitations (n, 6) near ``level`` whose torques cancel at these postures."""
    angles = starts - np.array(ARM.path_reference_angle)
    linear = np.array([ARM.path_linear_shoulder, ARM.path_linear_elbow])
    quadratic = np.array([ARM.path_quadratic_shoulder, ARM.path_quadratic_elbow])
    moment_arms = linear + 2 * quadratic * angles[:, :, None]  # (n, 2, 6)
    muscle = batch_of(starts, starts, (0.0, 0.0), no_forces()).muscle.astype(np.float64)
    forces = np.array(ARM.max_isometric_force)
    active = moment_arms * (muscle[:, ACTIVE_LENGTH] * forces)[:, None]
    passive = np.einsum("nij,nj->ni", moment_arms, muscle[:, PASSIVE] * forces)
    torque = active.sum(axis=2) * level + passive
    return level - np.einsum("nmi,ni->nm", np.linalg.pinv(active), torque)


@pytest.mark.parametrize(("level", "most"), [(0.05, 0.004), (0.2, 0.009)], ids=["relaxed", "tense"])
def test_the_usual_walls_hold_the_hand_all_over_the_workspace_and_it_settles(channels, level, most):
    excitations = cocontraction(channels[0], level)
    possible = ((excitations > ARM.min_activation) & (excitations < 1)).all(axis=1)
    assert possible.mean() > 0.5
    channels, excitations = [part[possible] for part in channels], excitations[possible]
    assert np.abs(deviations(channels, 10.0, (0.0, 0.0), excitations)).max() > 0.5, "or there is nothing to hold"
    for size in (5.0, 10.0):
        across = deviations(channels, size, CHANNEL_WALLS, excitations)
        assert np.abs(across).max() < most
        assert np.median(across[-1]) == pytest.approx(size / CHANNEL_WALLS[0], rel=0.1)
        assert np.quantile(np.abs(np.diff(across[-30:], axis=0)), 0.99) < 1e-4, "they swing"


def test_strong_muscles_push_into_the_walls_as_they_do_with_a_tenth_of_the_time_step(channels):
    """Where muscles buckle, tens of newtons press on the walls: that is statics, and no fault of the integrator."""
    excitations = np.clip(cocontraction(channels[0], 0.5), 0, 1)
    coarse = deviations(channels, 5.0, CHANNEL_WALLS, excitations, steps=40)
    fine = deviations(channels, 5.0, CHANNEL_WALLS, excitations, ArmParameters(timestep=0.001), steps=400)[9::10]
    assert np.quantile(np.abs(coarse - fine), 0.99) < 0.003
    assert np.abs(coarse).max() < 1.2 * np.abs(fine).max() + 0.002


def test_walls_that_swing_are_refused_with_the_bound():
    bound = r"their damping must lie between 40 and 190\.2 N·s/m\.$"
    for damping in (0.0, 39.0, 191.0):
        with pytest.raises(ValueError, match=rf"^walls of 4000 N/m and {damping:g} N·s/m make the hand swing.*{bound}"):
            check_stability(no_forces(walls=(4000.0, damping)), ARM)
    check_stability(no_forces(walls=(4000.0, 41.0)), ARM)
    with pytest.raises(ValueError, match="which a lower stiffness can meet"):
        check_stability(no_forces(walls=(1e6, 1e4)), ARM)
    check_stability(no_forces(walls=(1e5, 1500.0)), ArmParameters(timestep=0.001))


def test_walls_outside_the_bound_do_swing(channels):
    """Where they were let by: by undamped walls the hand is thrown about."""
    excitations = np.full((N, 6), 0.001)
    starts, goals, normals = channels
    batch = batch_of(starts, goals, 5 * normals, no_forces(walls=CHANNEL_WALLS))
    normals = normals.astype(np.float32)
    batch.state_arrays()["velocity_gain"][:] = 0  # the damping
    start, across = batch.hand.copy(), []
    for _ in range(30):
        batch.step((2 * excitations - 1).astype(np.float32))
        across.append(((batch.hand - start) * normals).sum(axis=1))
    assert np.median(np.abs(across).max(axis=0)) > 0.02
    held = deviations(channels, 5.0, CHANNEL_WALLS, excitations, steps=30)
    assert np.median(np.abs(held).max(axis=0)) < 0.003


@pytest.mark.parametrize("gain", [13, 15, 25])
def test_curl_fields_of_the_literature_are_taken(gain):
    check_stability(no_forces(velocity_gain=gain * CURL), ARM)


@pytest.mark.parametrize(
    ("forces", "works"),
    [
        ({"velocity_gain": np.array([[-10.1, -11.2], [-11.2, 11.1]])}, True),  # Shadmehr & Mussa-Ivaldi 1994
        ({"velocity_gain": 60 * CURL}, False),
        ({"velocity_gain": -100 * np.eye(2)}, True),
        ({"velocity_gain": -200 * np.eye(2)}, False),
        ({"position_gain": 300 * np.eye(2)}, True),
        ({"position_gain": 500 * np.eye(2)}, False),
        ({"position_gain": 500 * np.eye(2), "velocity_gain": -5 * np.eye(2)}, True),
        ({"position_gain": -450 * np.eye(2)}, True),  # which drives away in truth
        ({"position_gain": np.full((2, 2), 1e38)}, False),
    ],
)
def test_fields_are_taken_if_the_time_step_does_not_make_them_swing(forces, works):
    if works:
        check_stability(no_forces(**forces), ARM)
        return
    with pytest.raises(ValueError, match=r"^an? (velocity|elastic) field of .* where 1\.02 is the most: "):
        check_stability(no_forces(**forces), ARM)
    with pytest.raises(ValueError, match="makes the hand swing"):
        ArmEnv(Fixed(forces=no_forces(**forces))).reset()
    if max(np.abs(gain).max() for gain in forces.values()) < 1e4:
        check_stability(no_forces(**forces), ArmParameters(timestep=0.001))


def test_the_quick_answer_agrees_with_the_exact_one():
    from bilateral_rl.envs import stability

    rng = np.random.default_rng(0)
    for _ in range(300):
        row = rng.normal(size=8) * np.repeat([5.0, 60.0], 4)
        forces = no_forces(velocity_gain=row[:4].reshape(2, 2), position_gain=row[4:].reshape(2, 2))
        exact = stability._growth(tuple(row), ARM) <= stability.MOST_GROWTH
        try:
            check_stability(forces, ARM)
        except ValueError:
            assert not exact
        else:
            assert exact


def test_mobility_is_the_acceleration_of_the_hand_by_a_force():
    angles = np.array([[0.5, 1.0], [1.5, 0.4], [0.2, 2.2]])
    expected = mobility(angles, ARM)
    for axis in range(2):
        force = np.eye(2)[axis]
        speeds = []
        for load in (0 * force, force):
            batch = batch_of(angles, angles, load, no_forces())
            batch.step(np.full((3, 6), -1.0))
            upper, fore = ARM.link_length
            (shoulder, elbow), (rate, bend) = batch.joint[:, :2].T.astype(float), batch.joint[:, 2:].T.astype(float)
            forearm = rate + bend
            speeds.append(
                [
                    -upper * np.sin(shoulder) * rate - fore * np.sin(shoulder + elbow) * forearm,
                    upper * np.cos(shoulder) * rate + fore * np.cos(shoulder + elbow) * forearm,
                ]
            )
        gained = (np.array(speeds[1]) - speeds[0]).T / ARM.timestep
        np.testing.assert_allclose(gained, expected[:, :, axis], rtol=1e-3, atol=1e-3)
