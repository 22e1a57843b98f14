"""Where hands start and go: postures drawn from the places of an experiment, and whether an arm can take them all."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bilateral_rl.envs.arm.parameters import ArmParameters
from bilateral_rl.envs.experiments.places import CenterOut, Place, Region
from bilateral_rl.envs.experiments.standing import StandingArm

Float64 = NDArray[np.float64]
_FINE = 41
"""Points along each side of a box, and around and across a disk, at which it is asked whether an arm reaches all."""


def draw_postures(place: Place, uniform: Float64, arm: StandingArm, center: Float64 | None = None) -> Float64:
    """Return postures (n, 2) drawn from a place (rad).

    Args:
        place: the distribution.
        uniform: (n, 2) numbers in [0, 1).
        arm: whose joints and links, in whose place.
        center: (n, 2): the hand's position around which a circle lies that has no center of its own (m).

    Raises:
        ValueError: a position that the arm cannot take.
    """
    if place.joints is not None:
        return _draw_joints(place.joints, uniform, arm.physics)
    return arm.postures(_draw_hands(place, uniform, center), place.elbow)


def listed_hands(place: Place, arm: StandingArm, center: Float64 | None = None) -> Float64 | None:
    """Return the positions (k, 2) of the hand that a place consists of (m); None if it is a region, or drawn around.

    Raises:
        ValueError: postures out of the joints' range.
    """
    if place.joints is not None:
        postures = _listed(place.joints)
        return None if postures is None else arm.hand_position(_within_limits(postures, arm.physics))
    if place.hand is not None:
        return _listed(place.hand)
    around = place.center_out
    assert around is not None
    middle = around.center if around.center is not None else center
    if middle is None:
        return None
    return (np.asarray(middle, dtype=np.float64).reshape(-1, 1, 2) + _circle(around)).reshape(-1, 2)


def number_listed(place: Place) -> int | None:
    """Return of how many points a place consists; None if it is a region."""
    if place.center_out is not None:
        return place.center_out.number
    points = _listed(place.hand if place.joints is None else place.joints)
    return None if points is None else len(points)


def check_place(place: Place, arm: StandingArm, center: Float64 | None = None) -> None:
    """Raise a ValueError unless the arm can take all of a place: of a region, its rim and a fine grid are tried.

    Args:
        place: the distribution.
        arm: whose joints and links, in whose place.
        center: (k, 2): the positions around which a circle may lie that has no center of its own (m).
    """
    if place.joints is not None:
        if isinstance(place.joints, Region):
            assert place.joints.low is not None
            assert place.joints.high is not None
            _within_limits(np.array([place.joints.low, place.joints.high]), arm.physics)
        else:
            listed_hands(place, arm)
        return
    hands = listed_hands(place, arm, center)
    if hands is None:
        assert isinstance(place.hand, Region)
        hands = _fine_grid(place.hand)
    arm.postures(hands, place.elbow)


def _draw_joints(
    joints: str | tuple[tuple[float, float], ...] | Region, uniform: Float64, arm: ArmParameters
) -> Float64:
    if isinstance(joints, str):
        return _in_box(arm.joint_lower_limit, arm.joint_upper_limit, uniform)
    postures = _listed(joints)
    if postures is not None:
        return _chosen(_within_limits(postures, arm), uniform[:, 0])
    assert isinstance(joints, Region)
    assert joints.low is not None
    assert joints.high is not None
    return _within_limits(_in_box(joints.low, joints.high, uniform), arm)


def _draw_hands(place: Place, uniform: Float64, center: Float64 | None) -> Float64:
    around = place.center_out
    if around is not None:
        middle = np.asarray(around.center if around.center is not None else center, dtype=np.float64)
        return np.asarray(middle + _chosen(_circle(around), uniform[:, 0]))
    assert place.hand is not None
    positions = _listed(place.hand)
    if positions is not None:
        return _chosen(positions, uniform[:, 0])
    assert isinstance(place.hand, Region)
    return _in_region(place.hand, uniform)


def _in_region(region: Region, uniform: Float64) -> Float64:
    if region.center is not None and region.radius is not None:
        angle, radius = 2 * np.pi * uniform[:, 0], region.radius * np.sqrt(uniform[:, 1])
        return np.asarray(np.array(region.center) + radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    assert region.low is not None
    assert region.high is not None
    return _in_box(region.low, region.high, uniform)


def _in_box(low: ArrayLike, high: ArrayLike, uniform: Float64) -> Float64:
    lowest, highest = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    return lowest + uniform * (highest - lowest)


def _listed(points: object) -> Float64 | None:
    """Return the points (k, 2) of a list or a grid; None for a whole region."""
    if isinstance(points, Region):
        return None if points.grid is None else _grid(points, points.grid)
    return None if isinstance(points, str) else np.array(points, dtype=np.float64)


def _grid(region: Region, numbers: tuple[int, int]) -> Float64:
    assert region.low is not None
    assert region.high is not None
    # One point along a side is its middle.
    sides = [
        np.linspace(low, high, n) if n > 1 else np.array([(low + high) / 2])
        for low, high, n in zip(region.low, region.high, numbers, strict=True)
    ]
    return np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 2)


def _fine_grid(region: Region) -> Float64:
    """Return points (k, 2) that fill a region, those of its rim among them."""
    side = np.linspace(0.0, 1.0, _FINE)
    uniform = np.stack(np.meshgrid(side, side, indexing="ij"), axis=-1).reshape(-1, 2)
    return _in_region(region, uniform)


def _circle(around: CenterOut) -> Float64:
    angles = np.radians(around.first_angle + 360.0 * np.arange(around.number) / around.number)
    return around.radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def chosen_index(uniform: Float64, n: int) -> NDArray[np.intp]:
    """Return which of ``n`` things each uniform number (k,) chooses."""
    return np.minimum((uniform * n).astype(np.intp), n - 1)


def _chosen(points: Float64, uniform: Float64) -> Float64:
    return np.asarray(points[chosen_index(uniform, len(points))])


def _within_limits(postures: Float64, arm: ArmParameters) -> Float64:
    lower, upper = np.array(arm.joint_lower_limit), np.array(arm.joint_upper_limit)
    outside = ((postures < lower) | (postures > upper)).any(axis=-1)
    if outside.any():
        limits = f"{np.round(lower, 3).tolist()} to {np.round(upper, 3).tolist()} rad"
        raise ValueError(f"the posture {postures[outside][0].tolist()} is out of the joints' range, {limits}.")
    return postures
