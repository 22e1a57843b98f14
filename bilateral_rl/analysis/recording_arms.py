"""What is recorded of two arms: hands in rows and in their own frames become arms side by side in the body's frame."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.analysis.recording_fields import ARM, Field
from bilateral_rl.envs.body_frame import in_body_frame, vectors_between_frames
from bilateral_rl.vocabulary import SIDES


def by_arm(rows: NDArray[Any], field: Field, shoulder_distance: float) -> NDArray[Any]:
    """Return the values of a field, a row a hand, as (n, …) with the arms where the field has them.

    Args:
        rows: (n · arms, …), in the arms' own frames.
        field: what they are.
        shoulder_distance: distance of the shoulders (m).
    """
    axis = 1 + field.of_two_arms.dims.index(ARM)
    values = np.moveaxis(rows.reshape(-1, len(SIDES), *rows.shape[1:]), 1, axis)
    if field.frame == "position":
        return in_body_frame(values, shoulder_distance).astype(rows.dtype)
    if field.frame == "vector":
        return vectors_between_frames(values).astype(rows.dtype)
    if field.frame == "angle":
        return _angles_of_body(values).astype(rows.dtype)
    return values


def _angles_of_body(angles: NDArray[Any]) -> NDArray[np.float64]:
    """Return angles (…, 2 arms) from the x axes of the arms' own frames as angles from that of the body, in (-π, π]."""
    directions = np.stack((np.cos(angles), np.sin(angles)), axis=-1, dtype=np.float64)
    x, y = np.moveaxis(vectors_between_frames(directions), -1, 0)
    return np.asarray(np.arctan2(y, x))
