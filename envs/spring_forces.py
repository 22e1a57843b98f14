"""The force of the spring between two hands, for pictures and records; the arms' kernels have it in ``arm``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bilateral_rl.envs.kinematics import hand_velocity

if TYPE_CHECKING:
    from bilateral_rl.envs.trials import TrialBatch

Float64 = NDArray[np.float64]


def to_other_hand(hands: ArrayLike, shoulder_distance: float) -> Float64:
    """Return where the other hand is from each one, and how it moves relative to it, (…, 2 arms, 4) (m, m/s).

    Args:
        hands: (…, 2 arms, 4): position (m) and velocity (m/s) of both hands, each in its own arm's frame.
        shoulder_distance: distance of the shoulders (m).
    """
    own = np.asarray(hands, dtype=np.float64)
    other = own[..., ::-1, :] * (-1, 1, -1, 1) - (shoulder_distance, 0, 0, 0)
    return np.asarray(other - own)


def spring_forces(
    apart: ArrayLike,
    rest: NDArray[np.floating],
    stiffness: ArrayLike,
    damping: ArrayLike,
    kind: Literal["vector", "distance"],
) -> Float64:
    """Return the force of the spring and its damper on both hands, (…, 2 arms, 2) (N), each in its own arm's frame.

    Args:
        apart: (…, 2 arms, 4), of :func:`to_other_hand`.
        rest: (…, 2 arms, 2), where the other hand was at the start (m).
        stiffness: (…) of the spring (N/m).
        damping: (…) of the damper (N·s/m).
        kind: what the spring holds, as :class:`~bilateral_rl.envs.two_arms.SpringSettings` says.
    """
    vector, rate = np.split(np.asarray(apart, dtype=np.float64), 2, axis=-1)
    k, c = (np.asarray(values, dtype=np.float64)[..., None, None] for values in (stiffness, damping))
    if kind == "vector":
        return np.asarray(k * (vector - rest) + c * rate)
    length, rest_length = (np.linalg.norm(of, axis=-1, keepdims=True) for of in (vector, rest))
    direction = vector / np.maximum(length, np.finfo(np.float64).tiny)  # hands at one place pull in no direction
    along = np.sum(direction * rate, axis=-1, keepdims=True)
    return np.asarray((k * (length - rest_length) + c * along) * direction)


def forces_of_springs(batch: TrialBatch) -> NDArray[np.float32]:
    """Return the present forces of the springs between the hands of running arms, (2n, 2) (N), in their own frames."""
    settings = batch.settings
    angles, rates = np.split(batch.joint, 2, axis=-1)
    hands = np.concatenate([batch.hand, hand_velocity(angles, rates, settings.arm)], axis=-1).reshape(batch.n, 2, 4)
    rest = batch.state_array("rest")  # of the dominant hand; seen from the other one it is as far, the other way
    forces = spring_forces(
        to_other_hand(hands, settings.two_arms.shoulder_distance),
        np.stack([rest, rest * np.array((1, -1))], axis=1),
        batch.state_array("stiffness"),
        batch.state_array("damping"),
        settings.two_arms.spring.kind,
    )
    return forces.reshape(-1, 2).astype(np.float32)
