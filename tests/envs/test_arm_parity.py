"""The arm is the reference's arm: motornet 0.1.5 in TensorFlow, float32 (tests/data/plant.npz, paper section 2)."""

from pathlib import Path

import numpy as np
import pytest
import torch

from bilateral_rl.envs import Arm, ArmState, Trials, TrialSettings
from bilateral_rl.envs.tasks import RandomReach
from bilateral_rl.envs.trials import TrialBatch

PLANT = Path(__file__).parents[1] / "data" / "plant.npz"
FORCE = 6


@pytest.fixture(scope="module")
def plant():
    with np.load(PLANT) as data:
        return dict(data)


@pytest.fixture(scope="module", params=[torch.float32, torch.float64], ids=["float32", "float64"])
def arm(request):
    return Arm(dtype=request.param)


def tensor(arm, values):
    return torch.tensor(values, dtype=arm.dtype)


def one_step(arm, plant):
    joint, muscle = tensor(arm, plant["step_joint"]), tensor(arm, plant["step_muscle"])
    state = ArmState(joint, muscle, torch.zeros(len(joint), 4, dtype=arm.dtype))
    return arm.step(state, tensor(arm, plant["step_excitation"]), tensor(arm, plant["step_load"]))


def rollout(arm, plant, excitation):
    """States after each of the 50 steps, stacked: joint (50, 64, 4), muscle (50, 64, 7, 6), cartesian (50, 64, 4)."""
    state, load, states = arm.state(tensor(arm, plant["roll_joint0"])), tensor(arm, plant["roll_load"]), []
    for u in excitation:
        state = arm.step(state, u, load)
        states.append(state)
    return ArmState(*(torch.stack(parts) for parts in zip(*states, strict=True)))


def largest_difference(values, reference):
    return np.abs(values.detach().numpy() - reference).max()


def test_reference_steps_exercise_limits_and_saturated_excitations(plant):
    upper = np.radians([135.0, 155.0])
    joint, excitation = plant["step_joint_next"], plant["step_excitation"]
    assert (joint[:, :2] <= 0).any()
    assert (joint[:, :2] >= upper - 1e-6).any()
    assert (excitation < 0).any()
    assert (excitation > 1).any()


def test_one_step_moves_the_hand_as_the_reference_does(arm, plant):
    after = one_step(arm, plant)
    assert largest_difference(after.cartesian[:, :2], plant["step_cartesian_next"][:, :2]) < 1e-5
    assert largest_difference(after.cartesian[:, 2:], plant["step_cartesian_next"][:, 2:]) < 1e-5


def test_one_step_moves_the_joints_as_the_reference_does(arm, plant):
    after = one_step(arm, plant)
    assert largest_difference(after.joint, plant["step_joint_next"]) < 1e-5


def test_one_step_gives_the_references_muscle_state(arm, plant):
    muscle, reference = one_step(arm, plant).muscle, plant["step_muscle_next"]
    for row in range(FORCE):
        assert largest_difference(muscle[:, row], reference[:, row]) < 2e-6, f"row {row}"
    np.testing.assert_allclose(muscle[:, FORCE].numpy(), reference[:, FORCE], rtol=1e-4, atol=1e-4)


def test_muscle_state_at_rest_is_the_references(arm, plant):
    muscle, reference = arm.state(tensor(arm, plant["roll_joint0"])).muscle, plant["roll_muscle0"]
    for row in range(FORCE):
        assert largest_difference(muscle[:, row], reference[:, row]) < 2e-6, f"row {row}"
    np.testing.assert_allclose(muscle[:, FORCE].numpy(), reference[:, FORCE], rtol=1e-5, atol=1e-3)


def test_hand_at_rest_is_the_references(arm, plant):
    rest = arm.rest(tensor(arm, plant["roll_joint0"][:, :2]))
    assert largest_difference(rest.cartesian, plant["roll_cartesian0"]) < 1e-6


def test_fifty_steps_keep_the_hand_and_the_joints_on_the_references_path(arm, plant):
    path = rollout(arm, plant, tensor(arm, plant["roll_excitation"]))
    # The reference computes in float32, whose rounding the arm at double precision does not share.
    angle_tolerance = 1e-5 if arm.dtype == torch.float32 else 2e-5
    assert largest_difference(path.cartesian[..., :2], plant["roll_cartesian"][..., :2]) < 1e-5
    assert largest_difference(path.joint[..., :2], plant["roll_joint"][..., :2]) < angle_tolerance
    assert largest_difference(path.joint[..., 2:], plant["roll_joint"][..., 2:]) < 1e-4
    np.testing.assert_allclose(
        path.muscle[..., FORCE, :].numpy(), plant["roll_muscle"][..., FORCE, :], rtol=1e-4, atol=1e-2
    )


def test_gradient_through_fifty_steps_is_tensorflows(arm, plant):
    reference = plant["roll_grad_excitation_of_sum_squared_position"]
    excitation = tensor(arm, plant["roll_excitation"]).requires_grad_()
    rollout(arm, plant, excitation).cartesian[..., :2].square().sum().backward()
    gradient = excitation.grad.numpy()
    np.testing.assert_allclose(gradient, reference, rtol=1e-3, atol=1e-5)
    per_trial = np.linalg.norm(gradient - reference, axis=(0, 2)) / np.linalg.norm(reference, axis=(0, 2))
    assert per_trial.max() < 1e-4


def test_the_environments_kernel_moves_the_same_arm(plant):
    start = plant["roll_joint0"][:, :2].copy()
    batch = TrialBatch(RandomReach(), TrialSettings(), len(start))
    batch.start(np.arange(len(start), dtype=np.int32), Trials(start, start, plant["roll_load"]))
    for u, cartesian, muscle in zip(
        plant["roll_excitation"], plant["roll_cartesian"], plant["roll_muscle"], strict=True
    ):
        batch.step(2 * u - 1)
        np.testing.assert_allclose(batch.hand, cartesian[:, :2], rtol=0, atol=1e-5)
        np.testing.assert_allclose(batch.muscle[:, FORCE], muscle[:, FORCE], rtol=1e-4, atol=1e-2)


def test_proprioception_is_the_papers_normalized_lengths_and_velocities(arm, plant):
    optimal = np.array([0.134, 0.140, 0.092, 0.093, 0.137, 0.127])
    sensed = arm.proprioception(one_step(arm, plant)).numpy()
    length, velocity = plant["step_muscle_next"][:, 1], plant["step_muscle_next"][:, 2]
    np.testing.assert_allclose(sensed, np.hstack([length / optimal, velocity / (10 * optimal)]), rtol=1e-5, atol=1e-6)
