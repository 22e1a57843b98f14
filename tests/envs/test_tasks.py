"""What trials are drawn from, and what settings they take (paper section 3)."""

import numpy as np
import pytest
from one_arm_tasks import ONE_ARM_TASKS

from bilateral_rl.envs import ArmEnv, ArmParameters, ArmVecEnv, HoldPosition, RandomReach, Task, TrialSettings
from bilateral_rl.envs.tasks import Trials, make_task

UPPER = np.radians([135.0, 155.0])
LINKS = (0.309, 0.333)


def hand(angles):
    angles = np.asarray(angles, dtype=np.float64)
    shoulder, both = angles[..., 0], angles.sum(axis=-1)
    return np.stack(
        [
            LINKS[0] * np.cos(shoulder) + LINKS[1] * np.cos(both),
            LINKS[0] * np.sin(shoulder) + LINKS[1] * np.sin(both),
        ],
        axis=-1,
    )


def draw(task, n=20000, **settings):
    uniform = np.random.default_rng(0).random((n, task.n_uniform))
    return task.trials(uniform, TrialSettings(**settings))


def assert_uniform(values, low, high):
    """Each column lies in its range, with a uniform distribution's mean and standard deviation (2 %)."""
    low, high = np.broadcast_to(low, values.shape[1]), np.broadcast_to(high, values.shape[1])
    assert (values >= low - 1e-6).all()
    assert (values <= high + 1e-6).all()
    np.testing.assert_allclose(values.mean(axis=0), (low + high) / 2, atol=0.02 * (high - low).max())
    np.testing.assert_allclose(values.std(axis=0), (high - low) / np.sqrt(12), rtol=0.02)


def test_reaches_start_and_end_anywhere_in_the_joint_range_without_load():
    trials = draw(RandomReach())
    assert_uniform(trials.start, 0, UPPER)
    assert_uniform(trials.goal, 0, UPPER)
    assert (trials.load == 0).all()
    assert abs(np.corrcoef(np.hstack([trials.start, trials.goal]).T) - np.eye(4)).max() < 0.03


def test_holds_start_on_their_goal_anywhere_with_a_load_on_each_axis():
    trials = draw(HoldPosition(), max_load=7.0)
    assert_uniform(trials.start, 0, UPPER)
    np.testing.assert_array_equal(trials.start, trials.goal)
    assert_uniform(trials.load, -7, 7)
    assert abs(np.corrcoef(np.hstack([trials.start, trials.load]).T) - np.eye(4)).max() < 0.03


def test_a_load_can_have_a_random_direction_and_a_random_size():
    load = draw(HoldPosition(), max_load=7.0, load="direction").load
    size, angle = np.hypot(*load.T), np.arctan2(*load.T)
    assert_uniform(size[:, None], 0, 7)
    assert_uniform(angle[:, None], -np.pi, np.pi)
    assert abs(np.corrcoef(size, angle)[0, 1]) < 0.03


def test_the_load_of_two_uniform_numbers_under_each_law():
    numbers = np.array([[0.5, 0.5, 0.25, 0.4]])  # a quarter of a turn, two fifths of the bound
    for load, expected in (("axes", [-5, -2]), ("direction", [0, 4])):
        trials = HoldPosition().trials(numbers, TrialSettings(load=load))
        np.testing.assert_allclose(trials.load, [expected], atol=1e-6)
        np.testing.assert_array_equal(trials.start, trials.goal)
        assert trials.load.dtype == np.float32
    assert TrialSettings().load == "axes"


def test_every_environment_draws_the_load_that_is_asked_for():
    for load, corner in (("axes", True), ("direction", False)):
        venv = ArmVecEnv(500, "hold_position", load=load, seed=3)
        venv.reset()
        assert (np.hypot(*venv.batch.load.T).max() > 10) is np.bool_(corner)
        env = ArmEnv("hold_position", load=load)
        env.reset(seed=3)
        np.testing.assert_array_equal(env.batch.load, venv.batch.load[:1])


def test_postures_span_the_arms_own_joint_range():
    arm = ArmParameters(joint_lower_limit=(0.5, 1.0), joint_upper_limit=(0.6, 1.2))
    for task in (RandomReach(), HoldPosition()):
        assert_uniform(draw(task, arm=arm).start, [0.5, 1.0], [0.6, 1.2])


def test_a_task_turns_its_uniform_numbers_corner_to_corner():
    for task in (RandomReach, HoldPosition):
        lowest, highest = task().trials(np.array([[0.0] * 4, [1.0] * 4]), TrialSettings()).start
        np.testing.assert_allclose(lowest, 0)
        np.testing.assert_allclose(highest, UPPER, rtol=1e-6)


@pytest.mark.parametrize("name", ONE_ARM_TASKS)
def test_environments_begin_the_drawn_trials(name):
    venv = ArmVecEnv(500, name, seed=3)
    observation, batch = venv.reset(), venv.batch
    assert (batch.joint[:, :2] >= 0).all()
    assert (batch.joint[:, :2] <= UPPER.astype(np.float32)).all()
    assert (batch.joint[:, 2:] == 0).all()
    assert (batch.muscle[:, 0] == np.float32(0.001)).all()
    np.testing.assert_allclose(observation[:, 12:14], hand(batch.joint[:, :2]), atol=1e-6)
    if name == "random_reach":
        assert (batch.load == 0).all()
        assert (batch.start_distance > 0.05).mean() > 0.9
    else:
        np.testing.assert_array_equal(observation[:, 12:14], observation[:, 14:])
        assert (batch.start_distance == 0).all()
        assert 9 < np.abs(batch.load).max() <= 10


def test_the_target_is_the_hand_position_of_the_goal_posture():
    env, goal = ArmEnv(), (1.2, 0.7)
    observation, _ = env.reset(options={"start": (0.3, 1.9), "goal": goal})
    np.testing.assert_allclose(observation[14:], hand(goal), atol=1e-6)
    np.testing.assert_allclose(observation[12:14], hand((0.3, 1.9)), atol=1e-6)
    observation, *_ = env.step(np.ones(6, dtype=np.float32))
    np.testing.assert_allclose(observation[14:], hand(goal), atol=1e-6)


def test_the_load_of_a_hold_is_constant_over_the_trial():
    env = ArmEnv("hold_position", trial_length=5)
    env.reset(seed=0)
    load = env.batch.load.copy()
    assert (load != 0).all()
    for _ in range(5):
        env.step(np.zeros(6, dtype=np.float32))
        np.testing.assert_array_equal(env.batch.load, load)


def test_a_task_of_ones_own_runs_in_the_environments():
    class OneReach(Task):
        id = "one_reach"
        n_uniform = 1

        def trials(self, uniform, settings):
            n = len(uniform)
            start, goal = np.tile(np.float32([0.5, 1.0]), (n, 1)), np.tile(np.float32([1.0, 1.5]), (n, 1))
            return Trials(start, goal, np.zeros((n, 2), dtype=np.float32))

    observation, _ = ArmEnv(OneReach()).reset(seed=0)
    np.testing.assert_allclose(observation[12:], [*hand([0.5, 1.0]), *hand([1.0, 1.5])], atol=1e-6)
    np.testing.assert_array_equal(ArmVecEnv(2, OneReach()).reset(), [observation] * 2)


def test_an_unknown_task_is_rejected_with_the_choices():
    for make in (make_task, ArmEnv, lambda task: ArmVecEnv(1, task)):
        with pytest.raises(ValueError, match=r"Unknown task 'reach'; choose from random_reach, hold_position"):
            make("reach")


def test_defaults_are_the_papers():
    settings = TrialSettings()
    assert (settings.trial_length, settings.threshold, settings.max_load) == (50, 0.05, 10.0)
    assert (settings.sensory_noise, settings.motor_noise, settings.feedback_delay) == (0, 0, 0)
    assert settings.arm == ArmParameters()
    assert not settings.noisy


def test_a_setting_outside_its_range_is_rejected_with_its_name_and_value():
    for name, values in {
        "trial_length": [0, -1, 2.5, "five", None],
        "feedback_delay": [-1, 0.5, "one", None],
        "threshold": [0, -0.1, float("nan"), float("inf")],
        "max_load": [-1, float("nan"), float("inf")],
        "sensory_noise": [-0.1, float("nan"), float("inf")],
        "motor_noise": [-0.1, float("nan"), float("inf")],
    }.items():
        for value in values:
            with pytest.raises(ValueError, match=name) as error:
                TrialSettings(**{name: value})
            assert repr(value) in str(error.value)
    with pytest.raises(ValueError, match=r"^Unknown load 'disk'; choose from axes, direction\.$"):
        TrialSettings(load="disk")


@pytest.mark.parametrize("make", [ArmEnv, lambda **settings: ArmVecEnv(2, **settings)], ids=["ArmEnv", "ArmVecEnv"])
def test_environments_reject_unknown_settings_render_modes_and_values(make):
    with pytest.raises(ValueError, match="length"):
        make(length=3)
    with pytest.raises(ValueError, match="trial_length"):
        make(trial_length=0)
    with pytest.raises(ValueError, match="rgb_array"):
        make(render_mode="ansi")


def test_a_batch_needs_an_arm():
    with pytest.raises(ValueError, match="at least one"):
        ArmVecEnv(0)


def test_zero_max_load_is_allowed_and_gives_none():
    assert (draw(HoldPosition(), max_load=0.0).load == 0).all()
