"""What comes in from outside is checked here, once, before any kernel sees it: kernels trust what they are given.

Whatever is refused raises a ValueError or a TypeError of one sentence.
"""

from __future__ import annotations

import contextlib
import dataclasses
import operator
from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.arm.parameters import ArmParameters
from bilateral_rl.envs.refusals import shown
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.tasks import Task, Trials

T = TypeVar("T")
_SINGLE = 4
"""Bytes of a number in single precision."""


_OF_LOADS = ("max_load", "load")
"""Settings that have no effect on a task without a load."""


def settings_for(task: Task, settings: Mapping[str, Any]) -> TrialSettings:
    """Return the settings of an environment of ``task`` alone.

    Raises:
        ValueError: an unknown name, a value outside its range, or settings of a load where there is none.
    """
    chosen, default = TrialSettings(**settings), TrialSettings()
    for name in () if task.has_load else _OF_LOADS:
        if getattr(chosen, name) != getattr(default, name):
            raise ValueError(f"{name} has no effect on {task.id}, whose trials have no load: leave it out.")
    return chosen


def arguments_for(task: Task, settings: TrialSettings) -> dict[str, Any]:
    """Return settings as arguments of an environment of ``task``: those that have an effect there."""
    names = [field.name for field in dataclasses.fields(settings) if task.has_load or field.name not in _OF_LOADS]
    return {name: getattr(settings, name) for name in names}


def checked_trials(trials: object, n: int, arm: ArmParameters) -> Trials:
    """Return ``trials`` as float32 arrays (n, 2); a field of one row is that row for all trials.

    Raises:
        TypeError: no :class:`Trials`, or a field that does not consist of numbers.
        ValueError: a field of another shape, a number that is not finite, or a posture out of the joints' range.
    """
    if not isinstance(trials, tuple) or len(trials) != len(Trials._fields):
        raise TypeError(f"a task must return Trials(start, goal, load), got {type(trials).__name__}.")
    start, goal, load = (_rows(name, values, n) for name, values in zip(Trials._fields, trials, strict=True))
    for name, postures in (("start", start), ("goal", goal)):
        _check_postures(name, postures, arm)
    return Trials(start, goal, load)


def _check_postures(name: str, postures: NDArray[np.float32], arm: ArmParameters) -> None:
    lower, upper = np.array((arm.joint_lower_limit, arm.joint_upper_limit), dtype=np.float32)
    columns = postures.T.copy()  # NumPy is slow where the last axis is short
    inside = (columns >= lower[:, None]) & (columns <= upper[:, None])
    if not inside.all():
        limits = f"{lower.tolist()} to {upper.tolist()} rad"
        first = postures[~inside.all(axis=0)][0].tolist()
        raise ValueError(f"{name} must lie within the joint limits, {limits}, got {first}.")


def _rows(name: str, values: object, n: int) -> NDArray[np.float32]:
    """Return ``values`` as (n, 2) float32, in memory of their own."""
    array = numbers(name, values)
    if array.shape in ((2,), (1, 2)):
        array = np.broadcast_to(array, (n, 2))
    if array.shape != (n, 2):
        raise ValueError(f"{name} must have shape {(n, 2)}, or be one row for all trials, got shape {array.shape}.")
    with np.errstate(over="ignore") if array.itemsize > _SINGLE else contextlib.nullcontext():
        rows = np.array(array, dtype=np.float32, order="C")
    finite = np.isfinite(rows)
    if not finite.all():
        raise ValueError(f"{name} must consist of finite numbers, got {rows[~finite.all(axis=1)][0].tolist()}.")
    return rows


def numbers(name: str, values: object) -> NDArray[Any]:
    """Return ``values`` as an array of real numbers of any type.

    Raises:
        TypeError: anything else, such as words, objects, truth values or complex numbers.
        ValueError: rows of different lengths.
    """
    try:
        array = np.asarray(values)
    except (TypeError, ValueError):
        raise
    except Exception as error:  # what the object's own conversion raises, such as a tensor with a gradient
        raise TypeError(f"{name} cannot be read as an array: {error}") from None
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{name} must be an array of real numbers, got {array.dtype}.")
    return array


def checked_arms(arms: object, n: int) -> NDArray[np.int32]:
    """Return ``arms`` (k,) as int32.

    Raises:
        TypeError: something other than whole numbers.
        ValueError: another shape, an arm that there is not, or one that is named twice.
    """
    array = np.asarray(arms)
    if array.dtype.kind not in "iu" and array.size:
        raise TypeError(f"arms must be an array of whole numbers, got {array.dtype}.")
    if array.ndim == 1 and array.size:  # in order, as ever, or sorted to see whether one is there twice
        ordered = array if (array[1:] > array[:-1]).all() else np.unique(array)
    else:
        ordered = array
    if array.ndim != 1 or len(ordered) < len(array) or (array.size and not 0 <= ordered[0] <= ordered[-1] < n):
        raise ValueError(f"arms must be different numbers from 0 to {n - 1}, in one row, got {shown(array)}.")
    return array.astype(np.int32)


def whole_number(name: str, value: object, least: int) -> int:
    """Return ``value`` as an int.

    Raises:
        TypeError: no whole number (NumPy's are some).
        ValueError: a number below ``least``.
    """
    if isinstance(value, (bool, np.bool_)) or not hasattr(value, "__index__"):
        raise TypeError(f"{name} must be a whole number, got {shown(value)}.")
    number = operator.index(value)  # type: ignore[arg-type]
    if number < least:
        raise ValueError(f"{name} must be at least {least}, got {number}.")
    return number


def checked_seed(seed: object) -> int | None:
    """Return ``seed`` as Gymnasium takes it, None or an int of at least 0.

    Raises:
        TypeError: something else.
        ValueError: a negative number.
    """
    return None if seed is None else whole_number("seed", seed, 0)


def renewed(settings: T, cls: type[T]) -> T:
    """Return a copy of ``settings`` that is checked again, as Python's ways around a frozen dataclass are many.

    Raises:
        TypeError: no ``cls``.
        ValueError: a value outside its range.
    """
    if not isinstance(settings, cls):
        raise TypeError(f"settings must be {cls.__name__}, got {type(settings).__name__}.")
    changes = {"arm": renewed(settings.arm, ArmParameters)} if isinstance(settings, TrialSettings) else {}
    return dataclasses.replace(settings, **changes)  # type: ignore[type-var]
