"""Where pictures show bones and muscles: the courses of muscles along the arm, from posture and moment arms."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from bilateral_rl.envs.arm import physics
from bilateral_rl.envs.arm.parameters import N_MUSCLES, ArmParameters
from bilateral_rl.envs.canvas import Points

_FLEXION, _EXTENSION = 1.0, -1.0
_GIRDLE = -0.13 * np.array((math.cos(math.radians(15)), math.sin(math.radians(15))))  # where the shoulder girdle begins


class Route(NamedTuple):
    """How a muscle runs: from attachment to attachment, passing the joints between them at its moment arms."""

    side: float
    """1 where it flexes, -1 where it extends."""
    attachments: tuple[tuple[int, float, float], ...]
    """Bone (0 shoulder girdle, 1 upper arm, 2 forearm), fraction of its length, distance beside its axis (m)."""
    belly: tuple[float, float]
    """Where the belly begins and ends, as fractions of the route."""
    half_width: float
    """Half the belly's width at its thickest (m)."""


ROUTES = {
    "pectoralis": Route(_FLEXION, ((0, 0.03, 0.008), (1, 0.4, 0.006)), (0.04, 0.94), 0.017),
    "deltoid": Route(_EXTENSION, ((0, 0.15, 0.008), (1, 0.44, 0.006)), (0.04, 0.94), 0.016),
    "brachioradialis": Route(_FLEXION, ((1, 0.64, 0.008), (2, 0.8, 0.01)), (0.2, 0.8), 0.016),
    "triceps lateral": Route(_EXTENSION, ((1, 0.42, 0.008), (1, 0.72, 0.022), (2, 0.08, 0.006)), (0.04, 0.8), 0.014),
    "biceps": Route(_FLEXION, ((0, 0.8, 0.01), (1, 0.52, 0.044), (2, 0.17, 0.008)), (0.26, 0.82), 0.018),
    "triceps long": Route(_EXTENSION, ((0, 0.75, 0.01), (1, 0.5, 0.05), (2, 0.12, 0.008)), (0.22, 0.78), 0.016),
}
"""The route of each muscle by name; it is drawn, and has no part in the physics."""


def elbow_and_hand(arm: ArmParameters, angles: Points) -> tuple[Points, Points]:
    """Return the positions (2,) of elbow and hand (m) at a posture (2,) (rad)."""
    position = physics.hand(_parameters(arm), _at_rest(angles))
    return arm.link_length[0] * direction(angles[0]), np.array([position[0], position[1]])


def joint_positions(arm: ArmParameters, angles: Points) -> Points:
    """Return the positions (4, 2) of where the shoulder girdle begins, shoulder, elbow and hand (m) at a posture."""
    return np.stack((_GIRDLE, np.zeros(2), *elbow_and_hand(arm, angles)))


def moment_arms(arm: ArmParameters, angles: Points) -> Points:
    """Return the magnitudes (6, 2) of each muscle's moment arms at shoulder and elbow (m) at a posture (2,) (rad)."""
    paths = [physics.geometry(_parameters(arm), _at_rest(angles), m) for m in range(N_MUSCLES)]
    return np.abs([(path[2], path[3]) for path in paths])


@lru_cache(maxsize=4)
def _parameters(arm: ArmParameters) -> Any:
    """Return the struct that the physics takes; called from Python, it computes in single precision."""
    return physics.kernel_parameters(arm, wp.float32)


def _at_rest(angles: Points) -> Any:
    return physics.arm_types(wp.float32).vec4(*angles, 0.0, 0.0)


def muscle_course(joints: Points, route: Route, moment_arm: Points) -> Points:
    """Return a muscle's smooth course (64, 2) from origin to insertion, evenly spaced (m).

    Args:
        joints: (4, 2), where the shoulder girdle begins, shoulder, elbow and hand (m).
        route: how the muscle runs.
        moment_arm: (2,), its moment arms at shoulder and elbow (m), at which it passes these joints.
    """
    bones = np.diff(joints, axis=0)
    angle = np.arctan2(bones[:, 1], bones[:, 0])
    points: list[Points] = []
    reached = route.attachments[0][0]
    for bone, fraction, distance in route.attachments:
        for joint in range(reached + 1, bone + 1):
            around = _around_joint(angle[joint - 1], angle[joint], route.side, moment_arm[joint - 1])
            points.extend(joints[joint] + around)
        outward = route.side * direction(angle[bone] + np.pi / 2)
        points.append(joints[bone] + fraction * bones[bone] + distance * outward)
        reached = bone
    return _resample(_smooth(np.stack(points)), 64)


def ribbon(course: Points, half_width: Points) -> Points:
    """Return the outline (2 n, 2) of a band around a line (n, 2), of half width (n, 1)."""
    tangent = np.gradient(course, axis=0)
    outward = tangent[:, ::-1] * (-1, 1) / np.linalg.norm(tangent, axis=1, keepdims=True)
    return np.concatenate((course + half_width * outward, (course - half_width * outward)[::-1]))


def direction(angle: ArrayLike) -> Points:
    """Return unit vectors (…, 2) at angles (…) (rad)."""
    return np.stack((np.cos(angle), np.sin(angle)), axis=-1)


def _around_joint(proximal: float, distal: float, side: float, radius: float) -> Points:
    """Return points (n, 2) by which a muscle passes a joint at 0, ``radius`` off both bones (angles in rad).

    A muscle is wrapped around the outside of the bend, as an extensor around a flexed joint, or spans its inside.
    """
    flexion = (distal - proximal + np.pi) % (2 * np.pi) - np.pi
    if side * flexion < 0:
        return side * radius * direction(np.linspace(proximal, proximal + flexion, 5) + np.pi / 2)
    # Bounded, as the point that far off both bones recedes without end when they fold onto each other.
    distance = radius / max(math.cos(flexion / 2), 0.5)
    return side * distance * direction(np.array([proximal + flexion / 2 + np.pi / 2]))


def _smooth(points: Points) -> Points:
    """Return the quadratic B-spline of control points (n, 2), by Chaikin's corner cutting; both ends stay."""
    for _ in range(3):
        start, end = points[:-1], points[1:]
        cut = np.stack((0.75 * start + 0.25 * end, 0.25 * start + 0.75 * end), axis=1).reshape(-1, 2)
        points = np.concatenate((points[:1], cut, points[-1:]))
    return points


def _resample(points: Points, n: int) -> Points:
    """Return ``n`` evenly spaced points (n, 2) along a line."""
    length = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))))
    return np.stack([np.interp(np.linspace(0, length[-1], n), length, axis) for axis in points.T], axis=1)
