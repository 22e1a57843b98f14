import warnings

import numpy as np
import pytest

from bilateral_rl.analysis.kinematics import (
    effort,
    end_point_errors,
    end_point_variability,
    force_effort,
    hand_speed,
    initial_direction_error,
    mean_speed,
    path_length_ratio,
    peak_speed,
    perpendicular_deviation,
    rms_error,
    time_to_peak_speed,
)

DT = 0.01
PATHS = (path_length_ratio, perpendicular_deviation, initial_direction_error)
SPEEDS = (peak_speed, time_to_peak_speed, mean_speed)

# Slow, fast, slow; 3-4-5 triangles. The target is (8, 6), 10 away.
HAND = np.array([[[0, 0], [1, 0], [4, 4], [8, 4]]], dtype=float)
TARGET = np.array([[8.0, 6.0]])


@pytest.fixture(autouse=True)
def no_warnings():
    with warnings.catch_warnings(), np.errstate(all="raise"):
        warnings.simplefilter("error")
        yield


def rotated_and_moved(points):
    angle = 0.7
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return points @ rotation.T + np.array([0.3, -1.2])


def random_trials(n=20, steps=50):
    generator = np.random.default_rng(0)
    return generator.normal(size=(n, steps + 1, 2)).cumsum(axis=1), 5 * generator.normal(size=(n, 2))


def test_speeds_are_those_of_the_steps():
    np.testing.assert_allclose(hand_speed(HAND, 0.5), [[2, 10, 8]])
    assert peak_speed(HAND, 0.5) == pytest.approx(10)
    assert mean_speed(HAND, 0.5) == pytest.approx(20 / 3)


def test_the_peak_lies_in_the_middle_of_the_fastest_step():
    assert time_to_peak_speed(HAND, 0.5) == pytest.approx(0.75)


def test_the_peak_of_a_bell_is_found_to_half_a_step():
    t = np.linspace(0, 1, 101)
    x = 10 * t**3 - 15 * t**4 + 6 * t**5  # a minimum-jerk reach, fastest at half its duration: 1.875 lengths a duration
    hand = np.stack([x, 2 * x], axis=1)[None]
    assert time_to_peak_speed(hand, DT)[0] == pytest.approx(0.5, abs=0.51 * DT)
    assert peak_speed(hand, DT)[0] == pytest.approx(1.875 * np.sqrt(5), rel=1e-3)


def test_the_path_is_measured_against_the_distance_of_the_target():
    assert path_length_ratio(HAND, TARGET) == pytest.approx((1 + 5 + 4) / 10)


def test_a_straight_path_has_the_ratio_of_the_way_that_it_goes():
    for share in (0.5, 1.0, 1.5):
        hand = np.linspace(0, share, 11)[None, :, None] * TARGET
        assert path_length_ratio(hand, TARGET) == pytest.approx(share)
        assert perpendicular_deviation(hand, TARGET) == pytest.approx(0, abs=1e-12)
        assert initial_direction_error(hand, TARGET) == pytest.approx(0, abs=1e-7)


def test_a_half_circle_is_half_pi_times_as_long_and_deviates_by_its_radius():
    angle = np.linspace(0, np.pi, 1001)
    for side in (1, -1):
        hand = np.stack([1 - np.cos(angle), side * np.sin(angle)], axis=1)[None]
        target = np.array([[2.0, 0.0]])
        assert path_length_ratio(hand, target) == pytest.approx(np.pi / 2, rel=1e-5)
        assert perpendicular_deviation(hand, target) == pytest.approx(1, rel=1e-5)


def test_the_deviation_is_from_the_line_through_start_and_target():
    # Distances of the hand from the line 3x = 4y: 0, 3/5, 4/5, 8/5.
    assert perpendicular_deviation(HAND, TARGET) == pytest.approx(8 / 5)


def test_the_initial_direction_is_the_hands_after_its_fastest_step():
    # The fastest step ends in (4, 4), at 45 degrees; the target is at atan(3/4).
    assert initial_direction_error(HAND, TARGET) == pytest.approx(np.pi / 4 - np.arctan(3 / 4))


def test_direction_errors_have_no_sign_and_reach_half_a_turn():
    for degrees in (-180, -120, -30, 0, 60, 180):
        direction = np.radians(degrees)
        hand = np.array([[[0.2, 0.1], [0.2 + np.cos(direction), 0.1 + np.sin(direction)]]])
        error = initial_direction_error(hand, np.array([[3.2, 0.1]]))
        assert np.degrees(error[0]) == pytest.approx(abs(degrees))


def test_final_errors_point_from_the_target_to_the_hand():
    np.testing.assert_array_equal(end_point_errors(HAND, TARGET), [[0, -2]])


def test_variability_is_the_spread_of_the_errors_wherever_the_targets_are():
    target = np.array([[10, 0], [-3, 2], [0, 7], [1, 1]], dtype=float)
    common = np.array([0.5, -0.25])
    corners = np.array([[3, 4], [3, -4], [-3, 4], [-3, -4]], dtype=float)  # each 5 from their mean
    hand = np.stack([np.zeros((4, 2)), target + common + corners], axis=1)
    assert end_point_variability(hand, target) == pytest.approx(5)


def test_the_mean_squared_final_error_is_squared_bias_plus_squared_variability():
    hand, target = random_trials()
    errors = end_point_errors(hand, target)
    bias = np.linalg.norm(errors.mean(axis=0))
    assert (errors**2).sum(axis=1).mean() == pytest.approx(bias**2 + end_point_variability(hand, target) ** 2)


def test_one_trial_has_no_variability():
    assert np.isnan(end_point_variability(HAND, TARGET))


def test_the_error_in_hold_spans_all_steps_but_not_the_start():
    hand = np.array([[[9, 9], [3, 4], [0, 0], [0, 1], [0, -1]]], dtype=float)
    assert rms_error(hand, np.zeros((1, 2))) == pytest.approx(np.sqrt((25 + 0 + 1 + 1) / 4))


def test_effort_is_the_integral_of_squared_excitations():
    excitation = np.full((2, 50, 6), 0.5)
    excitation[1, 25:] = 0
    np.testing.assert_allclose(effort(excitation, DT), [6 * 0.25 * 0.5, 6 * 0.25 * 0.25])


def test_effort_scaled_by_force_weighs_strong_muscles_more():
    excitation = np.zeros((2, 10, 2))
    excitation[0, :, 0] = excitation[1, :, 1] = 1
    # Forces of 1 and 3 N have a mean of 2 N: excitations count half and one and a half.
    np.testing.assert_allclose(force_effort(excitation, (1, 3), 0.1), [0.25, 2.25])
    np.testing.assert_allclose(force_effort(excitation, (7, 7), 0.1), effort(excitation, 0.1))


def test_where_the_arm_stands_makes_no_difference():
    for measure in (*PATHS, rms_error, end_point_variability):
        hand, target = random_trials()
        np.testing.assert_allclose(measure(rotated_and_moved(hand), rotated_and_moved(target)), measure(hand, target))


def test_lengths_grow_with_the_arm_and_shapes_do_not():
    for measure, factor in (
        (path_length_ratio, 1),
        (perpendicular_deviation, 3),
        (initial_direction_error, 1),
        (rms_error, 3),
        (end_point_variability, 3),
    ):
        hand, target = random_trials()
        np.testing.assert_allclose(measure(3 * hand, 3 * target), factor * measure(hand, target))


def test_a_trial_that_starts_on_its_target_has_no_path_measure_and_leaves_the_others_alone():
    for measure in PATHS:
        for offset in (0, 1e-7):
            hand, target = random_trials(3)
            expected = measure(hand, target)
            target[1] = hand[1, 0] + offset
            expected[1] = np.nan
            np.testing.assert_array_equal(measure(hand, target), expected)


def test_a_hand_that_never_moves_has_no_direction_and_no_peak():
    hand = np.full((1, 11, 2), 0.4, dtype=np.float32)
    assert np.isnan(initial_direction_error(hand, TARGET)[0])
    assert np.isnan(time_to_peak_speed(hand, DT)[0])
    assert peak_speed(hand, DT)[0] == mean_speed(hand, DT)[0] == path_length_ratio(hand, TARGET)[0] == 0


def test_a_trial_with_a_nan_gets_nan_alone():
    hand, target = random_trials(3)
    broken = hand.copy()
    broken[1, 7:] = np.nan
    others = [0, 2]
    for measure in (*PATHS, rms_error):
        assert np.isnan(measure(broken, target)[1])
        np.testing.assert_array_equal(measure(broken, target)[others], measure(hand, target)[others])
    for measure in SPEEDS:
        assert np.isnan(measure(broken, DT)[1])
        np.testing.assert_array_equal(measure(broken, DT)[others], measure(hand, DT)[others])
    assert end_point_variability(broken, target) == end_point_variability(hand[others], target[others])


def test_single_precision_is_computed_in_double():
    hand, target = random_trials()
    single = hand.astype(np.float32), target.astype(np.float32)
    double = single[0].astype(np.float64), single[1].astype(np.float64)
    for measure in (*PATHS, rms_error):
        np.testing.assert_array_equal(measure(*single), measure(*double))
