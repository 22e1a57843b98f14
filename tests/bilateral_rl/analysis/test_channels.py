"""Deviations and forces on a channel on paths that are worked out by hand."""

import numpy as np
import pytest

from bilateral_rl.analysis.channels import (
    compensation,
    deviation_at_peak_speed,
    force_on_walls,
    largest_deviation,
    peak_force,
    signed_deviation,
)

CURL = 15 * np.array([[0, 1], [-1, 0]])
"""N·s/m; it pushes to the right of wherever the hand goes."""


def test_left_of_the_path_is_positive():
    hand = np.array([[[1, 1], [1, 2], [0, 4], [1.5, 6]]])  # to a target straight ahead: up
    np.testing.assert_allclose(signed_deviation(hand, [[1, 7]]), [[0, 0, 1, -0.5]])
    assert largest_deviation(hand, [[1, 7]]) == pytest.approx(1)
    assert largest_deviation(hand[:, ::-1], [[1.5, 0]]) == pytest.approx(-1.5)  # down: x is to the left
    assert deviation_at_peak_speed(hand, [[1, 7]]) == pytest.approx(-0.5)  # the last step is the fastest
    assert np.isnan(signed_deviation(hand, [[1, 1]])).all()


def test_a_hand_that_is_not_adapted_goes_where_a_clockwise_field_pushes():
    velocity = np.array([0.3, 0.1])
    hand = np.array([[[0, 0], 0.1 * velocity + 0.01 * CURL @ velocity]])
    assert signed_deviation(hand, [[0.3, 0.1]])[0, 1] < 0


@pytest.fixture
def channel():
    """Start and target of a channel at 45°, the field's force on a hand whose speed is a bell, and the bell."""
    bell = np.sin(np.linspace(0, np.pi, 21)[:-1]) ** 2
    velocity = (bell[:, None] * np.array([1, 1]) / np.sqrt(2))[None]
    hand = np.concatenate([np.zeros((1, 1, 2)), 0.01 * velocity.cumsum(axis=1)], axis=1)
    return hand[:, 0], hand[:, -1], velocity @ CURL.T, bell


def test_the_walls_of_a_full_compensation_do_what_the_field_would(channel):
    start, target, field, _ = channel
    assert compensation(field, field, start, target) == pytest.approx(1)


def test_the_compensation_is_the_share_of_the_field_whatever_else_is_constant(channel):
    start, target, field, _ = channel
    left = np.array([-1, 1]) / np.sqrt(2)
    assert compensation(0.4 * field + 3 * left, field, start, target) == pytest.approx(0.4)
    assert compensation(-0.2 * field, field, start, target) == pytest.approx(-0.2)
    assert compensation(np.zeros_like(field), field, start, target) == pytest.approx(0)
    assert np.isnan(compensation(field, 0 * field, start, target))


def test_the_hand_presses_to_the_left_against_a_field_to_the_right(channel):
    start, target, field, bell = channel
    np.testing.assert_allclose(force_on_walls(field, start, target)[0], 15 * bell, atol=1e-12)
    assert peak_force(field, start, target) == pytest.approx(15)
    assert peak_force(-field, start, target) == pytest.approx(-15)
