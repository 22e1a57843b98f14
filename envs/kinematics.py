"""Postures and positions of the hand, without dynamics."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bilateral_rl.envs.arm.parameters import ArmParameters

_ROUNDING = 1e-9
"""By how much angles may be out of the joints' range, and positions out of reach, by rounding alone (rad, m)."""


class UnreachableError(ValueError):
    """A position that an arm cannot take.

    Attributes:
        position: (2,) (m).
        reason: why not.
    """

    def __init__(self, position: NDArray[np.float64], reason: str) -> None:
        self.position, self.reason = position, reason
        super().__init__(f"the position [{position[0]:.4g}, {position[1]:.4g}] m {reason}.")


def hand_position(angles: ArrayLike, arm: ArmParameters) -> NDArray[np.float64]:
    """Return the position (…, 2) of the hand (m) at postures (…, 2), angles of shoulder and elbow (rad).

    The shoulder is at the origin.
    """
    postures = np.asarray(angles, dtype=np.float64)
    shoulder, forearm = postures[..., 0], postures[..., 0] + postures[..., 1]
    upper, fore = arm.link_length
    return np.stack(
        [upper * np.cos(shoulder) + fore * np.cos(forearm), upper * np.sin(shoulder) + fore * np.sin(forearm)], axis=-1
    )


def hand_velocity(joint: ArrayLike, velocity: ArrayLike, arm: ArmParameters) -> NDArray[np.float32]:
    """Return the velocity of the hand (…, 2) (m/s) from the joints' angles and velocities (…, 2) each (rad, rad/s)."""
    angle, rate = np.cumsum(joint, axis=-1, dtype=np.float64), np.cumsum(velocity, axis=-1, dtype=np.float64)
    speed = rate * np.asarray(arm.link_length)  # of each link's end about its beginning
    across = np.stack([-np.sin(angle), np.cos(angle)], axis=-2)  # (…, axis, link)
    return np.asarray((speed[..., None, :] * across).sum(axis=-1), dtype=np.float32)


def inverse_kinematics(
    hand: ArrayLike, arm: ArmParameters, elbow: Literal["positive", "negative"] = "positive"
) -> NDArray[np.float64]:
    """Return the postures (…, 2) at which the hand is at positions (…, 2), exactly.

    Args:
        hand: positions (m), the shoulder at the origin.
        arm: whose links and joints.
        elbow: which of the two postures: that with an elbow angle of at least 0, or of at most 0.

    Returns:
        Angles of shoulder and elbow (rad).

    Raises:
        UnreachableError: positions that are out of the links' reach, or that the joints' limits do not allow with this
            elbow; a ValueError, as those of another shape.
    """
    if elbow not in ("positive", "negative"):
        raise ValueError(f"elbow must be positive or negative, got {elbow!r}.")
    positions = np.asarray(hand, dtype=np.float64)
    if positions.shape[-1:] != (2,) or not np.isfinite(positions).all():
        raise ValueError("hand must be positions (…, 2) of finite numbers (m).")
    solved = _solved(positions, arm, 1.0 if elbow == "positive" else -1.0)
    nearest, farthest = _reach(arm)
    _refuse(
        positions,
        solved.out_of_reach,
        f"is out of the arm's reach, which is from {nearest:.4g} to {farthest:.4g} m of the shoulder",
    )
    lower, higher = np.array(arm.joint_lower_limit), np.array(arm.joint_upper_limit)
    limits = f"{np.round(lower, 3).tolist()} to {np.round(higher, 3).tolist()} rad"
    _refuse(
        positions,
        solved.out_of_range,
        f"cannot be taken by this arm with a {elbow} elbow: its joints go from {limits}",
    )
    return np.asarray(np.clip(solved.postures, lower, higher))


def is_in_workspace(hand: NDArray[np.float64], arm: ArmParameters) -> NDArray[np.bool_]:
    """Return whether the arm can take positions (…, 2) (m) with a positive elbow, (…)."""
    solved = _solved(hand, arm, 1.0)
    return ~(solved.out_of_reach | solved.out_of_range)


class _Solved(NamedTuple):
    """Postures (…, 2) (rad), and for which positions (…) there is none: of any arm of these links, or of this one."""

    postures: NDArray[np.float64]
    out_of_reach: NDArray[np.bool_]
    out_of_range: NDArray[np.bool_]


def _solved(positions: NDArray[np.float64], arm: ArmParameters, sign: float) -> _Solved:
    distance = np.hypot(positions[..., 0], positions[..., 1])
    nearest, farthest = _reach(arm)
    postures = _postures(positions, distance, *arm.link_length, sign)
    lower, higher = np.array(arm.joint_lower_limit), np.array(arm.joint_upper_limit)
    # Full turns of the shoulder lead to the same hand, and the range may begin anywhere.
    turns = np.ceil((lower[0] - _ROUNDING - postures[..., 0]) / (2 * np.pi))
    postures[..., 0] += 2 * np.pi * turns
    outside = (postures < lower - _ROUNDING) | (postures > higher + _ROUNDING)
    return _Solved(
        postures,
        out_of_reach=np.asarray((distance < nearest - _ROUNDING) | (distance > farthest + _ROUNDING)),
        out_of_range=np.asarray(outside.any(axis=-1)),
    )


def _reach(arm: ArmParameters) -> tuple[float, float]:
    """Return the least and the greatest distance of the hand from the shoulder that the links allow (m)."""
    upper, fore = arm.link_length
    return abs(upper - fore), upper + fore


def _postures(
    positions: NDArray[np.float64], distance: NDArray[np.float64], upper: float, fore: float, sign: float
) -> NDArray[np.float64]:
    """Return the postures by Heron's formula, which keeps its precision where the arm is stretched or folded.

    With a the triangle's side between shoulder and hand, tan²(elbow / 2) is
    ((u + f)² − a²) / (a² − (u − f)²), for the outer angle of the elbow.
    """
    stretched = np.maximum((upper + fore - distance) * (upper + fore + distance), 0.0)
    folded = np.maximum((distance - abs(upper - fore)) * (distance + abs(upper - fore)), 0.0)
    elbow = sign * 2 * np.arctan2(np.sqrt(stretched), np.sqrt(folded))
    toward = np.arctan2(positions[..., 1], positions[..., 0])
    return np.stack([toward - np.arctan2(fore * np.sin(elbow), upper + fore * np.cos(elbow)), elbow], axis=-1)


def _refuse(positions: NDArray[np.float64], wrong: NDArray[np.bool_], why: str) -> None:
    if wrong.any():
        raise UnreachableError(positions[wrong][0], why)
