"""Between the frame of the body, in which people see both arms, and the frame in which each arm is computed.

The body's midline is x = 0, and the shoulders lie at its sides, the dominant (right) one at +d/2. In its own frame an
arm's shoulder is at the origin, and x points away from the midline: the non-dominant arm is the mirror image of the
dominant one, so that both are the same arm with the same numbers.

Arrays have the arms on an axis of their own, the dominant one first, followed by x and y.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

_OUTWARD = np.array([1.0, -1.0])
"""Where x of an arm's own frame points to in the frame of the body."""


def vectors_between_frames(vectors: ArrayLike) -> NDArray[np.float64]:
    """Return vectors (…, 2 arms, 2), such as forces, of either frame in the other one: the way back is the same."""
    given = np.asarray(vectors, dtype=np.float64)
    return np.stack([given[..., 0] * _OUTWARD, given[..., 1]], axis=-1)


def in_body_frame(positions: ArrayLike, shoulder_distance: float) -> NDArray[np.float64]:
    """Return positions (…, 2 arms, 2) (m) of each arm's own frame in the frame of the body."""
    given = np.asarray(positions, dtype=np.float64)
    return np.stack([(given[..., 0] + shoulder_distance / 2) * _OUTWARD, given[..., 1]], axis=-1)


def in_arm_frames(positions: ArrayLike, shoulder_distance: float) -> NDArray[np.float64]:
    """Return positions (…, 2 arms, 2) (m) of the frame of the body in each arm's own frame."""
    given = np.asarray(positions, dtype=np.float64)
    return np.stack([given[..., 0] * _OUTWARD - shoulder_distance / 2, given[..., 1]], axis=-1)


def in_frame_of_other_arm(positions: ArrayLike, shoulder_distance: float) -> NDArray[np.float64]:
    """Return positions (…, 2) (m) of one arm's own frame in the other arm's own frame: the same for both arms."""
    given = np.asarray(positions, dtype=np.float64)
    return np.stack([-given[..., 0] - shoulder_distance, given[..., 1]], axis=-1)
