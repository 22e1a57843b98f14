"""Kinds of numbers and lists that experiments are made of, in the short forms that people write."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from bilateral_rl.envs.quantities import Number, Whole
from bilateral_rl.envs.refusals import shown

LONGEST_LIST = 1_000
"""Places or forces in a list, far beyond use."""
_LARGEST = 1e6

Share = Annotated[Number, Field(ge=0, le=1)]
"""A share of trials."""
Count = Annotated[Whole, Field(ge=1, le=LONGEST_LIST)]
Size = Annotated[Number, Field(ge=0, le=_LARGEST)]
_Step = Annotated[Whole, Field(ge=0, le=10_000)]
_Bounded = Annotated[Number, Field(ge=-_LARGEST, le=_LARGEST)]


def form(value: object) -> str:
    """Tell the forms of a setting apart: a word, a list of numbers, or settings by name."""
    if isinstance(value, str):
        return "<word>"
    return "<list>" if isinstance(value, Sequence) or not _has_fields(value) else "<settings>"


def _has_fields(value: object) -> bool:
    return isinstance(value, Mapping) or hasattr(value, "__dataclass_fields__")


def _as_steps(value: Any) -> object:
    steps = value if isinstance(value, Sequence) and not isinstance(value, str) else (value, value)
    if len(steps) != 2:
        raise ValueError(f"must be a number of steps, or the first and the last, got {shown(value)}")
    if all(isinstance(step, int) for step in steps) and steps[0] > steps[1]:
        raise ValueError(f"must have the first number of steps before the last, got {shown(value)}")
    return steps


def _as_point(value: object) -> object:
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != 2:
        raise ValueError(f"must be two numbers, got {shown(value)}")
    return value


def _as_points(value: object) -> object:
    if not isinstance(value, Sequence) or isinstance(value, str):
        raise ValueError(f"must be two numbers, or a list of such pairs, got {shown(value)}")
    if not any(isinstance(one, Sequence) and not isinstance(one, str) for one in value):
        return (value,)
    return value


def _as_matrix(value: object) -> object:
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != 2:
        raise ValueError(f"must be a matrix of two by two, [[…, …], […, …]], got {shown(value)}")
    return value


def _as_stiffness(value: object) -> object:
    return value if isinstance(value, Sequence) and not isinstance(value, str) else ((value, 0.0), (0.0, value))


Steps = Annotated[tuple[_Step, _Step], BeforeValidator(_as_steps)]
"""A number of steps, as (first, last) of uniform ones."""
Point = Annotated[tuple[_Bounded, _Bounded], BeforeValidator(_as_point)]
"""Two numbers, along x and y, or of shoulder and elbow."""
Points = Annotated[tuple[Point, ...], Field(min_length=1, max_length=LONGEST_LIST), BeforeValidator(_as_points)]
"""One such pair or several."""
Matrix = Annotated[tuple[Point, Point], BeforeValidator(_as_matrix)]
Stiffness = Annotated[tuple[Point, Point], BeforeValidator(_as_matrix), BeforeValidator(_as_stiffness)]
"""A matrix, or a number times the identity."""
Grid = Annotated[tuple[Count, Count], BeforeValidator(_as_point)]
"""Numbers of points along x and y, or of shoulder and elbow."""
