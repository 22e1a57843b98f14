"""Inverse kinematics is exact, in both solutions and within the joints' limits."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bilateral_rl.envs import ArmParameters, hand_position, inverse_kinematics
from bilateral_rl.envs.kinematics import UnreachableError, is_in_workspace

WIDE = ArmParameters(joint_lower_limit=(-math.pi, -math.pi), joint_upper_limit=(math.pi, math.pi))
"""An arm whose joints take every posture."""
shoulders = st.floats(-math.pi + 1e-6, math.pi)
elbows = st.floats(1e-3, math.pi - 1e-3)


@given(shoulders, elbows, st.sampled_from(("positive", "negative")))
def test_the_posture_that_a_hand_came_from_comes_back(shoulder, elbow, sign):
    posture = np.array([shoulder, elbow if sign == "positive" else -elbow])
    hand = hand_position(posture, WIDE)
    found = inverse_kinematics(hand, WIDE, sign)
    np.testing.assert_allclose(hand_position(found, WIDE), hand, rtol=0, atol=1e-12)
    turn = (found - posture + math.pi) % (2 * math.pi) - math.pi
    np.testing.assert_allclose(turn, 0, atol=1e-10)


@given(st.floats(0.03, 0.64), st.floats(-math.pi, math.pi), st.tuples(st.floats(0.1, 0.5), st.floats(0.1, 0.5)))
def test_both_solutions_have_the_same_hand_and_opposite_elbows(distance, angle, links):
    arm = ArmParameters(
        link_length=links, joint_lower_limit=WIDE.joint_lower_limit, joint_upper_limit=WIDE.joint_upper_limit
    )
    near, far = abs(links[0] - links[1]), sum(links)
    hand = (near + (far - near) * distance) * np.array([math.cos(angle), math.sin(angle)])
    over, under = (inverse_kinematics(hand, arm, elbow) for elbow in ("positive", "negative"))
    assert 0 <= over[1] == pytest.approx(-under[1], abs=1e-12)
    for posture in (over, under):
        np.testing.assert_allclose(hand_position(posture, arm), hand, rtol=0, atol=1e-12)


def test_positions_may_have_any_shape():
    postures = np.random.default_rng(0).uniform(0.1, [2.3, 2.6], (3, 4, 5, 2))
    found = inverse_kinematics(hand_position(postures, ArmParameters()), ArmParameters())
    np.testing.assert_allclose(found, postures, atol=1e-12)
    assert inverse_kinematics(np.zeros((0, 2)), ArmParameters()).shape == (0, 2)


def test_a_stretched_arm_and_joints_at_their_limits_are_reached():
    arm = ArmParameters()
    corners = [[a, b] for a in (0.0, math.radians(135)) for b in (0.0, math.radians(155))]
    found = inverse_kinematics(hand_position(corners, arm), arm)
    np.testing.assert_allclose(found, corners, atol=1e-7)  # where it is stretched, an angle is the root of a rounding
    assert (found >= arm.joint_lower_limit).all()
    assert (found <= arm.joint_upper_limit).all()


def test_a_full_turn_of_the_shoulder_brings_it_into_its_range():
    arm = ArmParameters(joint_lower_limit=(4.0, 0.0), joint_upper_limit=(6.0, 2.0))
    np.testing.assert_allclose(inverse_kinematics(hand_position([5.0, 1.0], arm), arm), [5.0, 1.0], atol=1e-12)


@pytest.mark.parametrize(
    ("lower", "upper"),
    [
        ((0.0, 0.0), (2.356, 2.705)),
        ((4.0, 0.3), (6.0, 2.0)),
        ((-2.0, -1.0), (2.5, 4.0)),
        ((-4.0, 0.5), (4.0, 1.0)),
        ((0.0, -2.0), (1.0, -0.1)),
    ],
)
def test_the_workspace_is_where_there_is_a_posture(lower, upper):
    arm = ArmParameters(joint_lower_limit=lower, joint_upper_limit=upper)
    positions = np.random.default_rng(0).uniform(-0.7, 0.7, (500, 2))

    def taken(position):
        try:
            inverse_kinematics(position, arm)
        except UnreachableError:
            return False
        return True

    expected = [taken(position) for position in positions]
    np.testing.assert_array_equal(is_in_workspace(positions, arm), expected)
    assert any(expected) == (upper[1] > 0)


@pytest.mark.parametrize(
    ("hand", "elbow", "sentence"),
    [
        (
            [0.7, 0.0],
            "positive",
            r"^the position \[0.7, 0\] m is out of the arm's reach, which is from 0.024 to",
        ),
        ([[0.0, 0.4], [0.01, 0.0]], "positive", r"^the position \[0.01, 0\] m is out of the arm's reach"),
        (
            [0.0, 0.4],
            "negative",
            r"^the position \[0, 0.4\] m cannot be taken by this arm with a negative elbow",
        ),
        ([0.0, -0.5], "positive", r"^the position \[0, -0.5\] m cannot be taken by this arm with a positive elbow"),
        ([0.0, 0.4], "left", "^elbow must be positive or negative, got 'left'"),
        ([0.0, float("nan")], "positive", "finite"),
        ([0.0, 0.4, 0.1], "positive", r"positions \(…, 2\)"),
    ],
)
def test_what_an_arm_cannot_take_is_refused_by_position_and_reach(hand, elbow, sentence):
    with pytest.raises(ValueError, match=sentence):
        inverse_kinematics(hand, ArmParameters(), elbow)
