"""Postures and positions of the hand, without dynamics."""

from __future__ import annotations

from typing import Literal

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
    upper, fore = arm.link_length
    distance = np.hypot(positions[..., 0], positions[..., 1])
    nearest, farthest = abs(upper - fore), upper + fore
    _refuse(
        positions,
        (distance < nearest - _ROUNDING) | (distance > farthest + _ROUNDING),
        f"is out of the arm's reach, which is from {nearest:.4g} to {farthest:.4g} m of the shoulder",
    )
    postures = _postures(positions, distance, upper, fore, 1.0 if elbow == "positive" else -1.0)
    lower, higher = np.array(arm.joint_lower_limit), np.array(arm.joint_upper_limit)
    # Full turns of the shoulder lead to the same hand, and the range may begin anywhere.
    turns = np.ceil((lower[0] - _ROUNDING - postures[..., 0]) / (2 * np.pi))
    postures[..., 0] += 2 * np.pi * turns
    outside = (postures < lower - _ROUNDING) | (postures > higher + _ROUNDING)
    limits = f"{np.round(lower, 3).tolist()} to {np.round(higher, 3).tolist()} rad"
    _refuse(
        positions,
        outside.any(axis=-1),
        f"cannot be taken by this arm with a {elbow} elbow: its joints go from {limits}",
    )
    return np.asarray(np.clip(postures, lower, higher))


def is_in_workspace(hand: NDArray[np.float64], arm: ArmParameters) -> NDArray[np.bool_]:
    """Return (…), whether the arm can take positions (…, 2) (m) with a positive elbow; the very rim is left out.

    It takes no trigonometric function of them, as it is asked of 72 a trial: the law of cosines has the elbow's angle,
    and cross products say on which side of the shoulder's limits the upper arm lies.
    """
    (upper, fore), x, y = arm.link_length, hand[..., 0], hand[..., 1]
    (first, least), (last, most) = arm.joint_lower_limit, arm.joint_upper_limit
    cosine = (x * x + y * y - (upper * upper + fore * fore)) / (2 * upper * fore)
    if most <= 0 or least >= np.pi:
        return np.zeros(cosine.shape, dtype=np.bool_)
    bends = (cosine < np.cos(max(least, 0.0)) - _ROUNDING) & (cosine > np.cos(min(most, np.pi)) + _ROUNDING)
    along, across = upper + fore * cosine, fore * np.sqrt(np.maximum(1 - cosine * cosine, 0.0))
    upper_x, upper_y = x * along + y * across, y * along - x * across
    after = np.cos(first) * upper_y - np.sin(first) * upper_x > _ROUNDING
    before = np.sin(last) * upper_x - np.cos(last) * upper_y > _ROUNDING
    if last - first >= 2 * np.pi:
        return np.asarray(bends)
    return np.asarray(bends & ((after & before) if last - first <= np.pi else (after | before)))


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


def _refuse(positions: NDArray[np.float64], wrong: np.bool_ | NDArray[np.bool_], why: str) -> None:
    if wrong.any():
        raise UnreachableError(positions[wrong][0], why)
