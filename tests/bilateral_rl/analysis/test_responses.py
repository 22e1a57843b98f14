"""Responses to cues, jumps and pulses on paths that are worked out by hand."""

import numpy as np
import pytest

from bilateral_rl.analysis.responses import (
    hold_error,
    hold_speed,
    jump_latency,
    premature_movement,
    pulse_deviation,
    pulse_latency,
    reaction_time,
    return_time,
)
from bilateral_rl.envs.tasks import NEVER

DT = 0.01


def along_x(*x):
    """One hand that moves along x (m)."""
    return np.stack([np.array(x, dtype=float), np.zeros(len(x))], axis=1)[None]


def test_a_reaction_begins_with_the_first_step_above_a_twentieth_of_the_peak():
    hand = along_x(0, 0, 0, 0, 0.004, 0.104, 0.204, 0.204)  # from the cue on steps of 0, 0, 4, 100, 100 and 0 mm
    assert reaction_time(hand, [2], DT) == pytest.approx(0.02)
    assert reaction_time(hand, [1], DT) == pytest.approx(0.03)


def test_what_moves_before_the_cue_is_no_reaction_to_it():
    hand = along_x(0, 0.1, 0.2, 0.2, 0.21, 0.22)
    assert reaction_time(hand, [2], DT) == pytest.approx(0.01)
    assert np.isnan(reaction_time(along_x(0, 0.1, 0.1, 0.1), [1], DT))
    assert np.isnan(reaction_time(hand, [NEVER], DT))


def test_a_hold_is_all_that_lies_before_the_cue():
    hand = along_x(0, 0.01, -0.03, 0, 0.5)
    distance = np.array([[0.01, 0.03, 0.0, 0.5]])
    assert premature_movement(hand, [2]) == pytest.approx(0.03)
    assert hold_error(distance, [2]) == pytest.approx(0.02)
    assert hold_speed(hand, [2], DT) == pytest.approx((1 + 4) / 2)
    for measured in (premature_movement(hand, [0]), hold_error(distance, [0]), hold_speed(hand, [0], DT)):
        assert np.isnan(measured)


def test_without_a_cue_the_whole_trial_is_a_hold():
    hand = along_x(0, 0.01, -0.03, 0, 0.5)
    assert premature_movement(hand, [NEVER]) == pytest.approx(0.5)
    assert hold_error(np.array([[0.01, 0.03, 0.0, 0.5]]), [NEVER]) == pytest.approx(0.135)


def test_a_jump_is_followed_when_the_velocity_along_it_rises():
    # 10 mm a step along y; along x 2 mm a step until the jump at step 2, the same for two steps more, then 20.
    x = np.cumsum([0, 2, 2, 2, 2, 20, 20]) / 1000
    hand = np.stack([x, 0.01 * np.arange(7)], axis=1)[None]
    assert jump_latency(hand, [2], [[0.1, 0]], DT) == pytest.approx(0.02)
    assert np.isnan(jump_latency(hand, [2], [[-0.1, 0]], DT))  # the hand goes the other way
    assert np.isnan(jump_latency(hand, [NEVER], [[0.1, 0]], DT))
    assert np.isnan(jump_latency(hand, [2], [[0, 0]], DT))


def test_a_pulse_deviates_from_the_path_in_a_reach_and_from_the_goal_in_a_hold():
    hand = np.array([[[0, 0], [1, 0.5], [2, -0.3], [3, 0.1]]])
    assert pulse_deviation(hand, [[5, 0]], [1]) == pytest.approx(0.3)
    assert pulse_deviation(hand, [[5, 0]], [0]) == pytest.approx(0.5)
    assert pulse_deviation(hand, [[0, 0]], [0]) == pytest.approx(np.hypot(3, 0.1))
    assert np.isnan(pulse_deviation(hand, [[5, 0]], [NEVER]))


def test_a_pulse_is_answered_when_the_hand_stops_to_go_along_with_it():
    hand = along_x(0, 0, 1, 3, 4, 4, 2)
    assert pulse_latency(hand, [[2, 0]], [1], DT) == pytest.approx(0.03)  # pushed in steps 1 to 3, at rest in step 4
    moving = hand + along_x(*np.arange(7))  # the same on top of a steady movement
    assert pulse_latency(moving, [[2, 0]], [1], DT) == pytest.approx(0.03)
    assert np.isnan(pulse_latency(along_x(0, 0, 0.01, 0.02), [[2, 0]], [1], DT))
    assert np.isnan(pulse_latency(hand, [[-2, 0]], [NEVER], DT))


def test_the_hand_is_back_after_the_last_step_outside():
    distance = np.array([[0.3, 0.01, 0.1, 0.02, 0.06, 0.04, 0.01]])
    assert return_time(distance, [1], 0.05, DT) == pytest.approx(0.04)
    assert return_time(distance, [1], 0.2, DT) == 0
    assert return_time(distance, [1], 0.005, DT) == pytest.approx(0.06)
    assert np.isnan(return_time(distance, [NEVER], 0.05, DT))
