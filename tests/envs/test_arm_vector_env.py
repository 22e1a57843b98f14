"""The Gymnasium vector face agrees with Gymnasium's own vectorisation of ArmEnv."""

import warnings

import gymnasium
import numpy as np
import pytest
from arm_faces import each_setting
from gymnasium.vector import AutoresetMode

from bilateral_rl.envs import ENVIRONMENT_IDS, ArmEnv, ArmVectorEnv

LENGTH, N = 4, 3
IDS = list(ENVIRONMENT_IDS.values())
each_id = pytest.mark.parametrize("name", IDS)


def batched(name, **settings):
    return gymnasium.make_vec(
        name, num_envs=N, vectorization_mode="vector_entry_point", trial_length=LENGTH, **settings
    )


def one_by_one(name, **settings):
    same_step = {"autoreset_mode": AutoresetMode.SAME_STEP}
    return gymnasium.make_vec(
        name, num_envs=N, vectorization_mode="sync", vector_kwargs=same_step, trial_length=LENGTH, **settings
    )


def actions(steps):
    return np.random.default_rng(0).uniform(-1, 1, (steps, N, 6)).astype(np.float32)


def assert_same_infos(ours, reference):
    assert set(ours) == set(reference)
    for key in reference:
        if isinstance(reference[key], dict):
            assert_same_infos(ours[key], reference[key])
        elif reference[key].dtype == object:
            np.testing.assert_array_equal(np.stack(ours[key]), np.stack(reference[key]))
        else:
            np.testing.assert_allclose(ours[key], reference[key], rtol=1e-6)


@each_id
def test_make_vec_makes_one_batch_and_warns_of_nothing(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        venv = batched(name)
        venv.reset(seed=0)
        venv.step(venv.action_space.sample())
        venv.close()
    assert type(venv) is ArmVectorEnv
    assert venv.num_envs == N
    assert venv.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert venv.single_observation_space == ArmEnv().observation_space
    assert venv.observation_space.shape == (N, 16)
    assert venv.action_space.shape == (N, 6)


@each_setting
@pytest.mark.parametrize(("name", "seed"), [(IDS[0], 9), (IDS[1], [4, 2, 9])], ids=["one seed", "a seed each"])
def test_it_steps_and_resets_as_gymnasiums_same_step_vector_environment(settings, name, seed):
    ours, reference = batched(name, **settings), one_by_one(name, **settings)
    np.testing.assert_array_equal(ours.reset(seed=seed)[0], reference.reset(seed=seed)[0])
    for command in actions(3 * LENGTH + 1):
        for mine, theirs in zip(ours.step(command)[:4], reference.step(command)[:4], strict=True):
            assert mine.dtype.kind == theirs.dtype.kind
            np.testing.assert_allclose(mine, theirs, rtol=1e-6, atol=0)


def test_its_infos_hold_what_gymnasiums_do():
    ours, reference = batched(IDS[0]), one_by_one(IDS[0])
    ours.reset(seed=9)
    reference.reset(seed=9)
    for command in actions(LENGTH - 1):
        assert_same_infos(ours.step(command)[-1], reference.step(command)[-1])
    mine, theirs = (venv.step(actions(LENGTH)[-1])[-1] for venv in (ours, reference))
    assert mine["_final_obs"].all()
    np.testing.assert_array_equal(np.stack(mine["final_obs"]), np.stack(theirs["final_obs"]))
    assert_same_infos(mine["final_info"], theirs["final_info"])


def test_a_vector_reward_is_told_at_every_step_the_last_of_a_trial_too():
    venv = batched(IDS[0])
    venv.reset(seed=9)
    for command in actions(LENGTH + 1):
        _, reward, _, _, infos = venv.step(command)
        np.testing.assert_array_equal(infos["vector_reward"].mean(axis=1), reward)
        assert infos["_vector_reward"].all()


def test_reset_without_a_seed_goes_on_with_the_streams():
    ours, reference = batched(IDS[0]), one_by_one(IDS[0])
    for seed in (9, None, None, 9):
        np.testing.assert_array_equal(ours.reset(seed=seed)[0], reference.reset(seed=seed)[0])


def test_a_seed_for_some_arms_leaves_the_others_streams_alone():
    ours, reference = batched(IDS[0]), one_by_one(IDS[0])
    for seed in (9, [None, 3, None], None):
        np.testing.assert_array_equal(ours.reset(seed=seed)[0], reference.reset(seed=seed)[0])


def test_reset_rejects_what_it_cannot_do():
    venv = batched(IDS[0])
    with pytest.raises(ValueError, match="3 seeds"):
        venv.reset(seed=[1, 2])
    with pytest.raises(ValueError, match="options"):
        venv.reset(options={"start": (1, 1)})


def test_an_episode_statistics_wrapper_counts_every_trial():
    venv = gymnasium.wrappers.vector.RecordEpisodeStatistics(batched(IDS[0]))
    venv.reset(seed=9)
    total = 0
    for command in actions(LENGTH):
        _, reward, _, truncated, infos = venv.step(command)
        total += reward
    assert truncated.all()
    np.testing.assert_array_equal(infos["episode"]["l"], [LENGTH] * N)
    np.testing.assert_allclose(infos["episode"]["r"], total, rtol=1e-5)
