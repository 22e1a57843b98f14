"""The Gymnasium vector face agrees with Gymnasium's own vectorisation of ArmEnv."""

import copy
import gc
import sys
import warnings

import gymnasium
import numpy as np
import pytest
from arm_faces import each_setting
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from rich_tasks import RICH_SETTINGS, Rich, RichPair

from bilateral_rl.envs import ENVIRONMENT_IDS, ArmEnv, ArmVectorEnv
from bilateral_rl.envs.task_specs import PARADIGMS

LENGTH, N = 4, 3
IDS = list(ENVIRONMENT_IDS.values())
each_id = pytest.mark.parametrize("name", IDS)
SAME, NEXT, DISABLED = AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED
each_mode = pytest.mark.parametrize("mode", [SAME, NEXT, DISABLED], ids=lambda mode: mode.value)


def batched(name, mode=SAME, **settings):
    return gymnasium.make_vec(
        name,
        num_envs=N,
        vectorization_mode="vector_entry_point",
        autoreset_mode=mode,
        **{"trial_length": LENGTH, **settings},
    )


def one_by_one(name, mode=SAME, **settings):
    return gymnasium.make_vec(
        name,
        num_envs=N,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": mode},
        trial_length=LENGTH,
        **settings,
    )


def actions(steps, arms=1):
    return np.random.default_rng(0).uniform(-1, 1, (steps, N, 6 * arms)).astype(np.float32)


def assert_same_infos(ours, reference):
    assert set(ours) == set(reference)
    for key in reference:
        if isinstance(reference[key], dict):
            assert_same_infos(ours[key], reference[key])
        elif reference[key].dtype == object:
            for mine, theirs in zip(ours[key], reference[key], strict=True):
                np.testing.assert_array_equal(mine, theirs)
        else:
            assert ours[key].dtype == reference[key].dtype
            np.testing.assert_allclose(ours[key], reference[key], rtol=1e-6)


def play(venv, steps=3 * LENGTH + 2, apart=False):
    """What an environment returns, step by step; ``apart`` starts arms anew at different times."""
    yield *venv.reset(seed=9), None, None, None
    for k, command in enumerate(actions(steps, venv.single_action_space.shape[0] // 6)):
        if apart and k in (1, 2, 7):
            mask = np.arange(N) == k % N
            yield *venv.reset(options={"reset_mask": mask}, seed=[k, None, None] if k == 7 else None), None, None, None
        observation, reward, terminated, truncated, infos = venv.step(command)
        yield observation, infos, reward, terminated, truncated
        if truncated.any() and venv.metadata["autoreset_mode"] is DISABLED:
            yield *venv.reset(options={"reset_mask": truncated}), None, None, None


def without_the_last_steps_own(infos):
    """Gymnasium's same-step environments say nothing of the step that ended a trial but in ``final_info``."""
    own = {"vector_reward", "_vector_reward", "distance", "_distance"}
    return {key: value for key, value in infos.items() if key not in own}


def assert_same_play(ours, reference, mode, apart=False):
    ended = 0
    for mine, theirs in zip(play(ours, apart=apart), play(reference, apart=apart), strict=True):
        for one, other in zip(mine, theirs, strict=True):
            if isinstance(other, dict):
                over = mode is SAME and "final_obs" in other
                ended += "final_obs" in other or "is_success" in other
                assert_same_infos(*map(without_the_last_steps_own, (one, other)) if over else (one, other))
            elif other is not None:
                assert one.dtype.kind == other.dtype.kind
                np.testing.assert_allclose(one, other, rtol=1e-6, atol=0)
    assert ended >= 2


@each_id
def test_make_vec_makes_one_batch_and_warns_of_nothing(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        length = {"trial_length": 130} if name in PARADIGMS.values() else {}  # what their cues and pulses need
        venv = batched(name, **length)
        venv.reset(seed=0)
        venv.step(venv.action_space.sample())
        venv.close()
    assert type(venv) is ArmVectorEnv
    assert venv.num_envs == N
    assert venv.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    with gymnasium.make(name, **length) as env:
        assert venv.single_observation_space == env.observation_space
        assert venv.single_action_space == env.action_space
        arms = env.unwrapped.batch.n_arms
    assert venv.observation_space.shape == (N, {1: 16, 2: 40}[arms])
    assert venv.action_space.shape == (N, 6 * arms)


@each_setting
@each_mode
@pytest.mark.parametrize("apart", [False, True], ids=["together", "apart"])
def test_it_does_what_gymnasiums_vector_environment_of_single_arms_does_in_that_mode(settings, mode, apart):
    name = IDS[bool(settings)]
    assert_same_play(batched(name, mode, **settings), one_by_one(name, mode, **settings), mode, apart)


@each_mode
@pytest.mark.parametrize("task", [Rich(), RichPair()], ids=["one arm", "two arms"])
def test_it_does_so_with_timelines_and_forces_too(mode, task):
    ours = ArmVectorEnv(N, task, autoreset_mode=mode, trial_length=LENGTH, **RICH_SETTINGS)
    envs = [lambda: ArmEnv(task, trial_length=LENGTH, **RICH_SETTINGS)] * N
    assert_same_play(ours, SyncVectorEnv(envs, autoreset_mode=mode), mode)


def test_a_vector_reward_is_told_at_every_step_the_last_of_a_trial_too():
    venv = batched(IDS[0])
    venv.reset(seed=9)
    for command in actions(LENGTH + 1):
        _, reward, _, _, infos = venv.step(command)
        np.testing.assert_array_equal(infos["vector_reward"].mean(axis=1), reward)
        assert infos["_vector_reward"].all()


def test_modes_go_by_their_names_too_and_others_are_refused():
    for mode in AutoresetMode:
        assert batched(IDS[0], mode.value).metadata["autoreset_mode"] is mode
    with pytest.raises(
        ValueError, match="unknown autoreset_mode 'next'; choose from 'NextStep', 'SameStep', 'Disabled'"
    ):
        batched(IDS[0], "next")


def test_the_next_step_begins_the_next_trial_whatever_its_action():
    one, other = (batched(IDS[0], NEXT) for _ in range(2))
    for venv in (one, other):
        venv.reset(seed=9)
        for command in actions(LENGTH):
            last = venv.step(command)
    assert last[3].all()
    first, second = one.step(np.ones((N, 6), np.float32)), other.step(-np.ones((N, 6), np.float32))
    for mine, theirs in zip(first[:4], second[:4], strict=True):
        np.testing.assert_array_equal(mine, theirs)
    assert not first[1].any()
    assert not first[3].any()
    assert first[4] == {}


def test_a_trial_that_is_over_goes_on_only_after_a_reset():
    venv = batched(IDS[0], DISABLED)
    with pytest.raises(RuntimeError, match="call reset"):
        venv.step(actions(1)[0])
    with pytest.raises(RuntimeError, match="starts every arm"):
        venv.reset(options={"reset_mask": np.arange(N) == 0})
    venv.reset(seed=9)
    for command in actions(LENGTH):
        venv.step(command)
    venv.reset(options={"reset_mask": np.arange(N) == 1})
    with pytest.raises(RuntimeError, match=r"trials of the arms \[0, 2\] are over"):
        venv.step(actions(1)[0])


@each_mode
def test_a_step_that_is_refused_changes_nothing_that_the_next_one_shows(mode):
    venv, spared = (batched(IDS[0], mode) for _ in range(2))
    for one in (venv, spared):
        one.reset(seed=9)
        one.step(actions(1)[0])
    for bad in (actions(1)[0][:2], np.full((N, 6), np.nan)):
        with pytest.raises(ValueError, match="actions must"):
            venv.step(bad)
    np.testing.assert_array_equal(venv.step(actions(2)[1])[0], spared.step(actions(2)[1])[0])


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
    for mask in ([True] * N, np.ones(N), None):
        with pytest.raises(TypeError, match="reset_mask must be a NumPy array of bool"):
            venv.reset(options={"reset_mask": mask})
    for mask in (np.ones(N + 1, bool), np.zeros(N, bool), np.ones((N, 1), bool)):
        with pytest.raises(ValueError, match="reset_mask must choose one or more of 3 arms"):
            venv.reset(options={"reset_mask": mask})


def test_make_vecs_limit_is_the_trials_length():
    venv = gymnasium.make_vec(IDS[0], num_envs=2, max_episode_steps=3)
    assert venv.settings.trial_length == venv.trial_length == 3
    with pytest.raises(ValueError, match="contradict each other"):
        batched(IDS[0], max_episode_steps=3)


def test_arms_that_could_not_be_made_are_closed_without_a_word(monkeypatch):
    unraisable = []
    monkeypatch.setattr(sys, "unraisablehook", unraisable.append)
    with pytest.raises(ValueError, match="threshold must be above 0"):
        ArmVectorEnv(2, threshold=-1)
    gc.collect()
    assert not unraisable


def test_settings_of_running_arms_stay():
    venv = batched(IDS[0])
    for name, value in (("settings", None), ("threshold", 0.01), ("num_envs", 7), ("batch", None)):
        with pytest.raises(AttributeError, match="cannot be changed"):
            setattr(venv, name, value)


@pytest.mark.parametrize("mode", [SAME, NEXT], ids=lambda mode: mode.value)
def test_actions_of_a_step_in_which_every_arm_begins_are_checked_too(mode):
    venv = batched(IDS[0], mode)
    venv.reset(seed=9)
    for command in actions(LENGTH):
        venv.step(command)
    for bad in (actions(1)[0][:2], np.full((N, 6), np.nan)):
        with pytest.raises(ValueError, match="actions must"):
            venv.step(bad)


def test_seeds_may_be_numpys():
    ours, reference = batched(IDS[0]), one_by_one(IDS[0])
    np.testing.assert_array_equal(ours.reset(seed=np.int64(9))[0], reference.reset(seed=9)[0])
    np.testing.assert_array_equal(ours.reset(seed=list(np.arange(N)))[0], reference.reset(seed=[0, 1, 2])[0])


def test_a_copy_goes_on_alike():
    venv = batched(IDS[0], NEXT)
    venv.reset(seed=9)
    for command in actions(LENGTH):
        venv.step(command)
    again = copy.deepcopy(venv)
    for command in actions(LENGTH + 2):
        for mine, theirs in zip(venv.step(command)[:4], again.step(command)[:4], strict=True):
            np.testing.assert_array_equal(mine, theirs)
