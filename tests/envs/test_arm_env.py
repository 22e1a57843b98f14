"""The Gymnasium face: the checkers, determinism, ownership of what it returns, and the reward of the paper."""

import copy
import itertools
import pickle
import re
import warnings

import gymnasium
import numpy as np
import pytest
from arm_faces import SETTINGS, assert_same, each_setting
from gymnasium.utils.env_checker import check_env as gymnasium_check
from one_arm_tasks import ONE_ARM_TASKS
from rich_tasks import RICH_SETTINGS, Rich, RichPair
from stable_baselines3.common.env_checker import check_env as sb3_check

from bilateral_rl.envs import ENVIRONMENT_IDS, ArmEnv, ArmVecEnv, ArmVectorEnv, TrialSettings
from bilateral_rl.envs.task_specs import PARADIGMS, TASK_SPECS
from bilateral_rl.envs.tasks import make_task

IDS = list(ENVIRONMENT_IDS.values())
OF_TWO_ARMS = [name for task, name in ENVIRONMENT_IDS.items() if make_task(task).n_arms == 2]
OF_ONE_ARM = [name for name in IDS if name not in OF_TWO_ARMS]
TRIAL_LENGTHS = {name: ArmEnv(task).settings.trial_length for task, name in PARADIGMS.items()}
"""Of experiments, whose cues and pulses need their time."""


def actions(n, seed=0, arms=1):
    return np.random.default_rng(seed).uniform(-1.2, 1.2, (n, 6 * arms)).astype(np.float32)


def trial(env, commands, **reset):
    """(observation, reward, terminated, truncated, info) of the reset and of every step."""
    observation, info = env.reset(**reset)
    return [(observation, 0.0, False, False, info)] + [env.step(action) for action in commands]


def arrays_in(value):
    if isinstance(value, np.ndarray):
        return [value]
    if isinstance(value, dict):
        value = list(value.values())
    return [a for v in value for a in arrays_in(v)] if isinstance(value, (tuple, list)) else []


each_check = pytest.mark.parametrize("check", [gymnasium_check, sb3_check], ids=["gymnasium", "sb3"])


@pytest.mark.parametrize("name", OF_ONE_ARM)
@each_check
@each_setting
def test_a_registered_environment_passes_the_checkers_without_a_warning(name, check, settings):
    env = gymnasium.make(name, trial_length=TRIAL_LENGTHS.get(name, 20), **settings)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check(env.unwrapped)


@each_check
@pytest.mark.parametrize("name", OF_TWO_ARMS)
def test_an_environment_of_two_arms_passes_the_checkers_without_a_warning(name, check):
    env = gymnasium.make(name, trial_length=TRIAL_LENGTHS.get(name, 20), **SETTINGS["noisy and delayed"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check(env.unwrapped)


@each_check
@pytest.mark.parametrize("task", [Rich(), RichPair()], ids=["one arm", "two arms"])
def test_an_environment_with_every_feature_passes_the_checkers_without_a_warning(task, check):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check(gymnasium.make(IDS[0], task=task, trial_length=20, **RICH_SETTINGS).unwrapped)


@pytest.mark.parametrize("name", IDS)
def test_gymnasiums_wrappers_find_nothing_to_warn_about_in_a_whole_trial(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(name)
        length = env.unwrapped.settings.trial_length
        steps = trial(env, actions(length, arms=env.unwrapped.batch.n_arms), seed=0)
        env.close()
    assert [truncated for *_, truncated, _ in steps] == [False] * length + [True]
    assert not any(terminated for _, _, terminated, _, _ in steps)


def test_each_registered_name_makes_its_task():
    for task, name in ENVIRONMENT_IDS.items():
        env = gymnasium.make(name).unwrapped
        assert isinstance(env, ArmEnv)
        assert env.batch.task.id == task


def test_observations_stay_in_their_space_under_violent_commands():
    env, rng = ArmEnv(sensory_noise=1.0, motor_noise=0.5), np.random.default_rng(0)
    for seed in range(5):
        commands = rng.choice([-1.0, 1.0], (50, 6)).astype(np.float32)
        for observation, *_ in trial(env, commands, seed=seed):
            assert env.observation_space.contains(observation)


def test_the_stretched_and_the_folded_arm_lie_in_the_observation_space():
    env, pair = ArmEnv(), ArmEnv("two_reaches", two_arms={"shoulder_distance": 0.123})
    postures = ((0.0, 0.0), (np.pi / 2, 0.0), (2.356, 2.705))
    for posture, other in itertools.product(postures, postures):
        observation, _ = env.reset(options={"start": posture})
        assert env.observation_space.contains(observation), posture
        observation, _ = pair.reset(options={"start": (posture, other)})
        assert pair.observation_space.contains(observation), posture


@pytest.mark.parametrize(
    ("task", "settings"),
    [
        *zip([*ONE_ARM_TASKS, Rich()], SETTINGS.values(), strict=True),
        ("reach_and_hold", SETTINGS["noisy and delayed"]),
        (RichPair(), RICH_SETTINGS),
    ],
    ids=[*SETTINGS, "two arms", "two rich arms"],
)
def test_the_same_seed_gives_the_same_trials(task, settings):
    one, two = ArmEnv(task, **settings), ArmEnv(task, **settings)
    commands = actions(50, arms=one.batch.n_arms)
    assert_same(trial(one, commands, seed=5), trial(two, commands, seed=5))
    assert_same(trial(one, commands), trial(two, commands))
    assert_same(trial(one, commands, seed=5), trial(one, commands, seed=5))


def test_a_trial_cut_short_does_not_change_the_next():
    one, two = ArmEnv(), ArmEnv()
    trial(one, actions(7), seed=5)
    trial(two, actions(50), seed=5)
    assert_same(trial(one, actions(50)), trial(two, actions(50)))


def test_different_seeds_and_successive_trials_differ():
    env = ArmEnv()
    starts = [env.reset(seed=seed)[0] for seed in range(20)] + [env.reset()[0] for _ in range(20)]
    assert len({start.tobytes() for start in starts}) == 40
    assert not np.array_equal(ArmEnv().reset()[0], ArmEnv().reset()[0]), "nor do two without a seed agree"


@each_setting
@pytest.mark.parametrize("duplicate", [lambda env: pickle.loads(pickle.dumps(env)), copy.deepcopy])
def test_a_copy_made_in_the_middle_of_a_trial_goes_on_identically(settings, duplicate):
    env = ArmEnv(trial_length=20, **settings)
    trial(env, actions(8), seed=3)
    twin = duplicate(env)
    rest = [env.step(action) for action in actions(12, seed=1)]
    assert rest[-1][3] is True
    assert_same(rest, [twin.step(action) for action in actions(12, seed=1)])
    assert_same(trial(env, actions(20)), trial(twin, actions(20)))


@each_setting
def test_what_a_call_returned_is_never_changed_by_later_ones(settings):
    def calls(env):
        yield env.reset()
        yield from (env.step(action) for action in actions(5))

    env, kept, snapshots = ArmEnv(trial_length=5, **settings), [], []
    for _ in range(3):
        for returned in calls(env):
            kept.append(returned)
            snapshots.append(copy.deepcopy(returned))
    assert_same(kept, snapshots)


def test_calls_share_no_memory_with_each_other_or_with_the_arm():
    env = ArmEnv(trial_length=5)
    returned = arrays_in(trial(env, actions(5), seed=0))
    own = [value for value in vars(env.batch).values() if isinstance(value, np.ndarray)]
    for i, array in enumerate(returned):
        assert not any(np.shares_memory(array, other) for other in returned[:i] + own)


def test_writing_to_what_a_call_returned_does_not_disturb_the_trial():
    vandal, witness = ArmEnv(), ArmEnv()
    observation, _ = vandal.reset(seed=0)
    witness.reset(seed=0)
    for action in actions(50):
        observation[:] = 99
        given = action.copy()
        observation, *rest = vandal.step(given)
        given[:] = 99
        assert_same((observation, *rest), witness.step(action))
        rest[-1]["vector_reward"][:] = 99


def test_reset_options_set_the_trial():
    env = ArmEnv()
    env.reset(options={"start": (0.5, 1.5), "goal": (1.0, 0.5), "load": (3.0, -2.0)})
    np.testing.assert_array_equal(env.batch.joint, np.float32([[0.5, 1.5, 0, 0]]))
    np.testing.assert_array_equal(env.batch.load, np.float32([[3, -2]]))
    assert env.batch.start_distance[0] > 0.1
    observation, _ = env.reset(options={"start": [0.5, 1.5]})
    np.testing.assert_array_equal(observation[12:14], observation[14:])
    np.testing.assert_array_equal(env.batch.load, [[0, 0]])


def test_reset_options_set_the_places_and_leave_timeline_and_forces_drawn():
    set_places, drawn = ArmEnv(Rich()), ArmEnv(Rich())
    drawn.reset(seed=5)
    set_places.reset(seed=5, options={"start": (0.5, 1.5), "goal": (1.0, 0.5)})
    np.testing.assert_array_equal(set_places.batch.joint, np.float32([[0.5, 1.5, 0, 0]]))
    np.testing.assert_array_equal(set_places.batch.load, [[0, 0]])
    ours, theirs = (env.batch.state_arrays() for env in (set_places, drawn))
    for name in ("go", "jump", "jump_target", "velocity_gain", "pulse", "pulse_window"):
        np.testing.assert_array_equal(ours[name], theirs[name])


def test_a_set_trial_can_be_repeated_and_leaves_the_random_stream_in_step():
    given = {"start": (0.5, 1.5), "goal": (1.0, 0.5)}
    env, drawing = ArmEnv(), ArmEnv()
    assert_same(trial(env, actions(50), options=given), trial(env, actions(50), options=given))
    env.reset(seed=0, options=given)
    drawing.reset(seed=0)
    assert_same(env.reset(), drawing.reset())


def test_reset_options_that_set_no_possible_trial_are_rejected():
    for options, message in (
        ({"goal": (1, 1)}, "start"),
        ({"start": (1, 1), "begin": (1, 1)}, "begin"),
        ({"start": (1, 1, 1)}, "start must be two finite numbers"),
        ({"start": (1, 1), "goal": (np.nan, 1)}, "goal must be two finite numbers"),
        ({"start": (1, 1), "load": 3.0}, "load must be two finite numbers"),
        ({"start": (-1, 1)}, "start .*joint"),  # the arm would jump to its limit at the first step
        ({"start": (1, 1), "goal": (1, 3)}, "goal .*joint"),  # no posture has its hand there by these angles
    ):
        with pytest.raises(ValueError, match=message):
            ArmEnv().reset(options=options)


def test_a_step_before_the_first_reset_or_after_the_end_is_an_error():
    env = ArmEnv(trial_length=2)
    with pytest.raises(RuntimeError, match="reset"):
        env.step(np.zeros(6, dtype=np.float32))
    trial(env, actions(2))
    with pytest.raises(RuntimeError, match="reset"):
        env.step(np.zeros(6, dtype=np.float32))
    env.reset()
    env.step(np.zeros(6, dtype=np.float32))


@pytest.mark.parametrize("length", [1, 2, 7])
def test_a_trial_ends_by_truncation_after_its_length(length):
    steps = trial(ArmEnv(trial_length=length), actions(length), seed=0)
    assert [truncated for *_, truncated, _ in steps[1:]] == [False] * (length - 1) + [True]
    assert [set(info) for *_, info in steps[1:-1]] == [{"vector_reward", "distance"}] * (length - 1)
    last = steps[-1][-1]
    assert {"vector_return", "is_success", "speed_to_goal", "time_in_goal", "final_error"} < set(last)
    if length < 3:
        assert last["is_success"] is False
        assert np.isnan(last["speed_to_goal"])


@pytest.mark.parametrize("task", TASK_SPECS)
def test_the_reward_is_minus_the_papers_losses(task):
    """Recomputed in NumPy from what the agent sees and does (paper section 4)."""
    env = ArmEnv(task)
    arms = env.batch.n_arms
    own_target = slice(14, 16) if arms == 1 else slice(16, 18)
    commands = actions(50, arms=arms)
    for (observation, reward, _, _, info), action in zip(trial(env, commands, seed=1)[1:], commands, strict=True):
        views = observation.reshape(arms, -1).astype(np.float64)
        error = views[:, 12:14] - views[:, own_target]
        excitation = (np.clip(action.astype(np.float64), -1, 1) + 1) / 2
        cartesian_1, cartesian_2 = np.abs(error).mean(), np.square(10 * error).mean() / 10
        activation = np.square(excitation).mean()
        dominant, non_dominant = 5 * cartesian_2 + 2 * activation, 5 * cartesian_1
        np.testing.assert_allclose(info["vector_reward"], [-dominant, -non_dominant], rtol=1e-5, atol=1e-6)
        combined = 2.5 * cartesian_1 + 2.5 * cartesian_2 + activation
        assert reward == pytest.approx(-combined, rel=1e-5, abs=1e-6)
        assert reward == info["vector_reward"].mean(dtype=np.float32)
        assert type(reward) is float
        assert info["vector_reward"].dtype == np.float32


def test_the_first_observation_is_the_posture_at_rest():
    observation, info = ArmEnv().reset(options={"start": (np.pi / 2, 0.0)})
    tendon = np.array([0.039, 0.066, 0.172, 0.187, 0.204, 0.217])
    optimal = np.array([0.134, 0.140, 0.092, 0.093, 0.137, 0.127])
    offset = np.array([0.151, 0.2322, 0.2859, 0.2355, 0.3329, 0.2989])
    np.testing.assert_allclose(observation[:6], (offset - tendon) / optimal, rtol=1e-5)
    np.testing.assert_array_equal(observation[6:12], 0)
    np.testing.assert_allclose(observation[12:14], [0, 0.642], atol=1e-6)
    assert info == {}


def test_an_action_beyond_its_bounds_acts_as_the_bound():
    wild, bounded = ArmEnv(), ArmEnv()
    commands = np.random.default_rng(0).uniform(-4, 4, (50, 6)).astype(np.float32)
    assert_same(trial(wild, commands, seed=0), trial(bounded, commands.clip(-1, 1), seed=0))


def test_an_action_of_another_shape_is_an_error():
    env = ArmEnv()
    env.reset(seed=0)
    for action in (0.0, np.zeros(5), np.zeros(1)):
        with pytest.raises(ValueError, match="shape"):
            env.step(action)


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"trial_length": -1}, "trial_length must be at least 1, got -1."),
        ({"threshold": "far"}, "threshold must be a finite number, got 'far'."),
        ({"gravity": 9.81}, "Unknown setting 'gravity' among the settings; choose from trial_length"),
    ],
)
def test_settings_are_refused_in_one_sentence(settings, sentence):
    for face in (lambda: ArmEnv("random_reach", **settings), lambda: TrialSettings(**settings)):
        with pytest.raises(ValueError, match="^" + re.escape(sentence)) as refused:
            face()
        assert "\n" not in str(refused.value)
        assert type(refused.value) is ValueError


@pytest.mark.parametrize(("timestep", "fps"), [(0.01, 25), (0.005, 50), (0.02, 12.5)])
def test_pictures_show_the_arm_four_times_slower_whatever_a_step_is(timestep, fps):
    for env in (
        ArmEnv(arm={"timestep": timestep}),
        ArmVecEnv(2, arm={"timestep": timestep}),
        ArmVectorEnv(2, arm={"timestep": timestep}),
    ):
        assert env.metadata["render_fps"] == fps
        assert type(env).metadata["render_fps"] == 25, "the class's stays that of the usual step"
