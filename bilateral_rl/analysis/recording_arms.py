"""What is recorded of two arms: hands in rows and in their own frames become arms side by side in the body's frame.

And back, where one of the hands alone is looked at.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.analysis.recording_fields import ARM, EVERY_FIELD, Field
from bilateral_rl.envs.body_frame import in_arm_frames, in_body_frame, vectors_between_frames
from bilateral_rl.vocabulary import SIDES


def has_arms(field: Field) -> bool:
    """Return whether a field has the dimension of two arms."""
    return ARM in field.dims


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
        return _angles_between_frames(values).astype(rows.dtype)
    return values


def of_arm(values: NDArray[Any], field: Field, arm: int, shoulder_distance: float) -> NDArray[Any]:
    """Return what a field of two arms has of one of them, in that arm's own frame.

    Args:
        values: (n, …), with the arms where the field has them.
        field: what they are.
        arm: 0, the dominant one, or 1.
        shoulder_distance: distance of the shoulders (m).
    """
    own = values
    if field.frame == "position":
        own = in_arm_frames(values, shoulder_distance).astype(values.dtype)
    elif field.frame == "vector":
        own = vectors_between_frames(values).astype(values.dtype)
    elif field.frame == "angle":
        own = _angles_between_frames(values).astype(values.dtype)
    return np.asarray(np.take(own, arm, axis=1 + field.dims.index(ARM)))


def of_one_arm(field: Field) -> Field:
    """Return the field of a recording of one arm that one of two arms has become; its view has the other hand, too."""
    own = next(one for one in EVERY_FIELD if one.name == field.name)
    dims = tuple(dim for dim in field.dims if dim != ARM)
    return own if own.dims == dims else dataclasses.replace(own, dims=dims)


def _angles_between_frames(angles: NDArray[Any]) -> NDArray[np.float64]:
    """Return angles (…, 2 arms) from the x axis of either frame as those from that of the other one, in (-π, π]."""
    directions = np.stack((np.cos(angles), np.sin(angles)), axis=-1, dtype=np.float64)
    x, y = np.moveaxis(vectors_between_frames(directions), -1, 0)
    return np.asarray(np.arctan2(y, x))
