"""The paper's measures on trials short enough to measure by hand (section 3)."""

import math

import numpy as np
import pytest

from bilateral_rl.envs import ArmEnv
from bilateral_rl.envs.measures import trial_measures

IN, OUT = 0.01, 0.30


def measure(distance, start_distance=0.6, threshold=0.05):
    """The measures of one trial, as plain numbers: completion, speed, time in goal, final error."""
    measures = trial_measures([distance], [start_distance], threshold)
    return tuple(column.item() for column in measures[:4])


@pytest.mark.parametrize(
    ("distance", "steps"),
    [
        ([OUT, OUT, IN, IN, IN, OUT], 3),
        ([IN, IN, IN], 1),
        ([OUT, OUT, IN, IN, IN], 3),  # the last three steps count
        ([IN, IN, OUT, IN, IN, IN, OUT], 4),  # an interrupted visit does not start the completing one
        ([IN, IN, IN, OUT, IN, IN, IN], 1),  # the first of two completing visits
    ],
)
def test_speed_is_the_start_distance_over_the_steps_until_the_goal_was_reached_for_good(distance, steps):
    completed, speed, inside, error = measure(distance)
    assert completed is True
    assert speed == pytest.approx(0.6 / steps)
    assert (inside, error) == (distance.count(IN), distance[-1])


@pytest.mark.parametrize(
    ("distance", "third", "time"),
    [
        ([OUT, OUT, IN, IN, IN, OUT], 5, 3),
        ([IN, IN, IN, IN], 3, 1),
        ([IN, IN, OUT, IN, IN, IN, OUT], 6, 4),
        ([IN, IN, OUT, OUT, IN, IN], None, 6),  # never reached: the whole trial
        ([IN, IN], None, 2),
    ],
)
def test_a_reach_that_counts_to_the_third_step_takes_two_more_and_one_that_fails_takes_the_trial(distance, third, time):
    measures = trial_measures([distance], [0.6], 0.05)
    assert measures.time_to_goal.tolist() == [time]
    np.testing.assert_allclose(measures.speed_to_third_step, [0.6 / third if third else np.nan])
    assert np.isnan(measures.speed_to_third_step[0]) == (not measures.goal_completion[0])


def test_visits_shorter_than_three_steps_do_not_complete_however_many():
    for distance in (
        [OUT] * 5, [IN, IN, OUT, IN, IN, OUT], [IN, OUT, IN, OUT, IN, OUT], [OUT, OUT, OUT, OUT, IN, IN],
        [IN, IN, OUT, OUT, IN, IN], [IN], [IN, IN],
    ):  # fmt: skip
        completed, speed, inside, error = measure(distance)
        assert completed is False
        assert math.isnan(speed)
        assert (inside, error) == (distance.count(IN), distance[-1])


def test_the_threshold_itself_is_within_the_goal():
    assert measure([0.05] * 3, threshold=0.05)[0] is True
    assert measure([np.nextafter(0.05, 1)] * 3, threshold=0.05)[0] is False


def test_a_trial_that_starts_on_its_target_has_no_speed():
    assert math.isnan(measure([IN] * 3, start_distance=0.0)[1])
    held = trial_measures([[IN] * 4] * 2, [0.0, 0.0], 0.05).means()
    assert held["goal_completion_percent"] == 100
    assert math.isnan(held["speed_to_goal_cm_per_step"])


def test_trials_of_a_batch_are_measured_one_by_one():
    rng = np.random.default_rng(0)
    distance, start = rng.uniform(0, 0.1, (50, 12)), rng.uniform(0, 1, 50)
    together = trial_measures(distance, start, 0.05)
    assert together.goal_completion.dtype == np.bool_
    for i in range(50):
        for column, alone in zip(together, trial_measures(distance[i : i + 1], start[i : i + 1], 0.05), strict=True):
            np.testing.assert_equal(column[i], alone[0])


@pytest.mark.parametrize("task", ["random_reach", "hold_position"])
def test_the_last_info_of_a_trial_measures_its_distances(task):
    env = ArmEnv(task, trial_length=20, threshold=0.15)
    rng, outcomes = np.random.default_rng(0), set()
    for seed in range(20):
        observation, _ = env.reset(seed=seed)
        start, distances, rewards, truncated = np.linalg.norm(observation[12:14] - observation[14:]), [], [], False
        while not truncated:
            observation, _, _, truncated, info = env.step(rng.uniform(-1, 1, 6).astype(np.float32))
            distances.append(np.linalg.norm(observation[12:14] - observation[14:]))
            rewards.append(info["vector_reward"])
            assert info["distance"] == pytest.approx(distances[-1], abs=1e-6)
        completed, speed, inside, error = measure(distances, start, 0.15)
        success = completed if task == "random_reach" else error <= 0.15  # a hold starts in its goal
        assert info["is_success"] is success
        np.testing.assert_allclose(info["speed_to_goal"], speed, rtol=1e-5, atol=1e-7)
        assert info["time_in_goal"] == inside
        assert info["final_error"] == pytest.approx(error, abs=1e-6)
        np.testing.assert_allclose(info["vector_return"], np.sum(rewards, axis=0), rtol=1e-5)
        outcomes.add(success)
    assert outcomes == {True, False}


def test_means_are_in_percent_centimeters_and_steps_and_speed_that_of_the_trials_that_reached():
    measures = trial_measures([[OUT, IN, IN, IN], [OUT] * 4], [0.6, 0.4], 0.05)
    assert measures.means() == pytest.approx(
        {
            "goal_completion_percent": 50.0,
            "speed_to_goal_cm_per_step": 30.0,
            "time_in_goal_steps": 1.5,
            "final_error_cm": 15.5,
        }
    )
    assert math.isnan(trial_measures([[OUT] * 4], [0.4], 0.05).means()["speed_to_goal_cm_per_step"])


def test_measures_count_from_the_onset_of_the_target():
    distance = [[IN, IN, IN, OUT, OUT, IN, IN, IN, OUT, IN]]
    measures = trial_measures(distance, [0.3], 0.05, [2])
    assert measures.goal_completion
    assert measures.time_to_goal == 4  # steps 2, 3, 4 and 5, the first of three within the threshold
    assert measures.speed_to_goal == 0.3 / 4
    assert measures.time_in_goal == 5
    too_late = trial_measures(distance, [0.3], 0.05, [6])
    assert not too_late.goal_completion
    assert too_late.time_to_goal == 4
    assert too_late.time_in_goal == 3


def test_an_onset_at_the_start_is_none():
    distance = np.random.default_rng(0).uniform(0, 0.1, (200, 12))
    start = np.full(200, 0.4)
    for ours, theirs in zip(
        trial_measures(distance, start, 0.05), trial_measures(distance, start, 0.05, np.zeros(200, int)), strict=True
    ):
        np.testing.assert_array_equal(ours, theirs)


def test_without_a_cue_a_trial_is_completed_by_staying():
    measures = trial_measures([[IN] * 4, [IN, IN, IN, OUT]], [0.0, 0.0], 0.05, [4, 4])
    assert measures.goal_completion.tolist() == [True, False]
    assert measures.time_in_goal.tolist() == [0, 0]
    assert measures.time_to_goal.tolist() == [0, 0]
    assert np.isnan(measures.speed_to_goal).all()


@pytest.mark.parametrize(
    ("onset", "error"),
    [([5], ValueError), ([-1], ValueError), ([0, 0], ValueError), ([0.5], TypeError), ("soon", TypeError)],
)
def test_an_onset_outside_the_trial_is_refused(onset, error):
    with pytest.raises(error, match="onset"):
        trial_measures([[IN] * 4], [0.3], 0.05, onset)
