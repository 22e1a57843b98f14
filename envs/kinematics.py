"""Postures and positions of the hand, without dynamics."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bilateral_rl.envs.arm.parameters import ArmParameters


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
