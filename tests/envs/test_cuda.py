"""The same arm on a GPU. Skipped where there is none."""

import pickle

import numpy as np
import pytest
import torch
from arm_faces import each_setting
from rich_tasks import Rich, RichPair

from bilateral_rl.envs import Arm, ArmState, ArmVecEnv, ArmVectorEnv

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA GPU")

UPPER = np.radians([135.0, 155.0])
LENGTH = 6


def movement(device, dtype, steps=20, n=64):
    """The final state of a movement on ``device`` and the gradient of its path, on the CPU in double precision."""
    rng = np.random.default_rng(0)
    arm = Arm(device=device, dtype=dtype)
    angles, load = torch.tensor(rng.uniform(0, 1, (n, 2)) * UPPER), torch.tensor(rng.uniform(-10, 10, (n, 2)))
    u = torch.tensor(rng.uniform(0, 1, (steps, n, 6)), dtype=dtype, device=device, requires_grad=True)
    state, path = arm.rest(angles), 0.0
    for excitation in u:
        state = arm.step(state, excitation, load.to(device, dtype))
        path = path + state.cartesian[:, :2].square().sum()
    path.backward()
    assert state.joint.device.type == torch.device(device).type
    return ArmState(*(t.detach().cpu().double() for t in state)), u.grad.cpu().double()


def actions(steps, n, muscles=6):
    return np.random.default_rng(1).uniform(-1, 1, (steps, n, muscles)).astype(np.float32)


def make(device, settings, n=5, task="hold_position"):
    venv = ArmVecEnv(n, task, device=device, seed=3, trial_length=LENGTH, **settings)
    return venv, venv.reset()


@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float32, 1e-5), (torch.float64, 1e-11)], ids=str)
def test_an_arm_on_cuda_moves_as_on_the_cpu(dtype, tolerance):
    (on_cpu, gradient), (on_cuda, cuda_gradient) = movement("cpu", dtype), movement("cuda", dtype)
    assert (on_cuda.cartesian[:, :2] - on_cpu.cartesian[:, :2]).abs().max() < tolerance
    assert (on_cuda.joint[:, :2] - on_cpu.joint[:, :2]).abs().max() < tolerance
    torch.testing.assert_close(on_cuda.muscle, on_cpu.muscle, rtol=10 * tolerance, atol=10 * tolerance)
    assert (cuda_gradient - gradient).abs().max() < 10 * tolerance * gradient.abs().max()


each_task = pytest.mark.parametrize("task", ["hold_position", Rich(), RichPair()], ids=["hold", "rich", "two arms"])


@each_task
@each_setting
def test_a_vecenv_on_cuda_runs_the_same_trials_as_on_the_cpu(settings, task):
    (cpu, cpu_start), (cuda, cuda_start) = make("cpu", settings, task=task), make("cuda", settings, task=task)
    np.testing.assert_allclose(cuda_start, cpu_start, atol=1e-5)
    for command in actions(3 * LENGTH, 5, *cpu.action_space.shape):
        ours, reference = cuda.step(command), cpu.step(command)
        np.testing.assert_allclose(ours[0], reference[0], atol=1e-4)
        np.testing.assert_allclose(ours[1], reference[1], atol=1e-4)
        np.testing.assert_allclose(cuda.last_vector_reward, cpu.last_vector_reward, atol=1e-4)
        np.testing.assert_array_equal(ours[2], reference[2])
        np.testing.assert_allclose(cuda.batch.force, cpu.batch.force, rtol=1e-3, atol=1e-2)
        np.testing.assert_array_equal(cuda.batch.onset, cpu.batch.onset)
        for info, other in zip(ours[3], reference[3], strict=True):
            assert set(info) == set(other)
            if info:
                np.testing.assert_allclose(info["terminal_observation"], other["terminal_observation"], atol=1e-4)
                np.testing.assert_allclose(info["final_error"], other["final_error"], atol=1e-5)


@each_setting
def test_arms_on_cuda_that_begin_apart_stand_still_while_the_others_move(settings):
    cpu, cuda = (
        ArmVectorEnv(5, device=device, trial_length=LENGTH, autoreset_mode="NextStep", **settings)
        for device in ("cpu", "cuda")
    )
    np.testing.assert_allclose(cuda.reset(seed=3)[0], cpu.reset(seed=3)[0], atol=1e-5)
    for k, command in enumerate(actions(3 * LENGTH, 5)):
        if k == 2:
            mask = np.arange(5) % 2 == 0
            np.testing.assert_allclose(*(v.reset(options={"reset_mask": mask})[0] for v in (cuda, cpu)), atol=1e-4)
        for ours, reference in zip(cuda.step(command)[:4], cpu.step(command)[:4], strict=True):
            np.testing.assert_allclose(ours, reference, atol=1e-4)


@each_task
@each_setting
def test_a_copy_of_a_vecenv_on_cuda_goes_on_identically(settings, task):
    venv, _ = make("cuda", settings, task=task)
    muscles = venv.action_space.shape[0]
    for command in actions(LENGTH + 2, 5, muscles):
        venv.step(command)
    twin = pickle.loads(pickle.dumps(venv))
    for command in actions(3 * LENGTH, 5, muscles):
        for ours, theirs in zip(venv.step(command)[:3], twin.step(command)[:3], strict=True):
            np.testing.assert_array_equal(ours, theirs)


def test_what_a_call_on_cuda_returned_is_never_changed_by_later_ones():
    venv, start = make("cuda", {})
    kept, snapshot = [start], [start.copy()]
    for command in actions(2 * LENGTH, 5):
        returned = [*venv.step(command)[:3], venv.last_vector_reward]
        kept += returned
        snapshot += [array.copy() for array in returned]
    for array, as_returned in zip(kept, snapshot, strict=True):
        np.testing.assert_array_equal(array, as_returned)


def test_an_arm_on_cuda_works_on_torchs_own_streams():
    expected = movement("cuda", torch.float32)
    stream = torch.cuda.Stream()
    with torch.cuda.stream(stream):
        given = movement("cuda", torch.float32)
    stream.synchronize()
    for values, reference in zip((*given[0], given[1]), (*expected[0], expected[1]), strict=True):
        assert torch.equal(values, reference)
