"""The forces on the hands of trials, in the one form that the kernels compute: offset + B v − K x."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.task import HandForces

Float32 = NDArray[np.float32]


class AffineForces(NamedTuple):
    """Forces on ``n`` hands beside load and pulse, as :mod:`bilateral_rl.envs.arm.hand_force` takes them."""

    offset: Float32
    """(n, 2): what depends on neither position nor velocity (N)."""
    velocity_gain: Float32
    """(n, 2, 2): B, of fields and walls together (N·s/m)."""
    position_gain: Float32
    """(n, 2, 2): K, likewise (N/m)."""


def affine_forces(forces: HandForces, start: NDArray[Any], target: NDArray[Any]) -> AffineForces:
    """Fold fields and walls into one affine force.

    The walls of a channel along the line through start and target push back across it: with n its unit normal,
    −n (stiffness · n·(x − start) + damping · n·v).

    Args:
        forces: of n trials.
        start: (n, 2), position of the hand at the start (m).
        target: (n, 2), position of the target (m); a channel needs one that is apart from the start.
    """
    if not forces.walls.any():  # most trials, and a large part of the time that one takes to begin
        return AffineForces(_times(forces.position_gain, forces.center), forces.velocity_gain, forces.position_gain)
    across = np.einsum("ni,nj->nij", *[channel_normals(start, target)] * 2)  # (n, 2, 2): projection across the line
    stiffness, damping = (forces.walls[:, i, None, None] * across for i in range(2))
    return AffineForces(
        offset=_times(forces.position_gain, forces.center) + _times(stiffness, start),
        velocity_gain=forces.velocity_gain - damping,
        position_gain=forces.position_gain + stiffness,
    )


def channel_normals(start: NDArray[Any], target: NDArray[Any]) -> Float32:
    """Return the unit vectors (n, 2) to the left of the line from start to target (m); 0 where they coincide."""
    along = target - start
    length = np.linalg.norm(along, axis=1, keepdims=True)
    left = np.stack([-along[:, 1], along[:, 0]], axis=1)
    return np.asarray(np.divide(left, length, out=np.zeros_like(left), where=length > 0), dtype=np.float32)


def _times(matrices: NDArray[Any], vectors: NDArray[Any]) -> Float32:
    return np.asarray(np.einsum("nij,nj->ni", matrices, vectors), dtype=np.float32)
