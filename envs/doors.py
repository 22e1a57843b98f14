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

from bilateral_rl.envs.refusals import shown
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.task import NEVER, Task
from bilateral_rl.envs.two_arms import OF_ROLES

T = TypeVar("T")
_SINGLE = 4
"""Bytes of a number in single precision."""


_OF_LOADS, _OF_TWO_ARMS = ("max_load", "load"), ("two_arms",)
"""Settings that have no effect on a task without a load, or of one arm."""


def settings_for(task: Task, settings: Mapping[str, Any]) -> TrialSettings:
    """Return the settings of an environment of ``task`` alone.

    Raises:
        ValueError: an unknown name, a value outside its range, or one that has no effect on the task.
    """
    usual, default = TrialSettings(**task.trial), TrialSettings()
    chosen = TrialSettings(**_merged(task.trial, settings))
    for name, sentence in without_effect(task).items():
        of = operator.attrgetter(name)
        if of(chosen) not in (of(default), of(usual)):
            raise ValueError(sentence)
    return chosen


def without_effect(task: Task) -> dict[str, str]:
    """Return the settings that have no effect on ``task``, each with a sentence that refuses it."""
    why = {} if task.has_load else dict.fromkeys(_OF_LOADS, "no load")
    if task.n_arms == 1:
        why |= dict.fromkeys(_OF_TWO_ARMS, "one arm")
    elif not task.has_roles:
        why |= dict.fromkeys(OF_ROLES, "roles of their own")
    words = "{} has no effect on {}, whose trials have {}: leave it out."
    return {name: words.format(name, name_of(task), has) for name, has in why.items()}


def _merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Return nested settings with those of ``over`` in them."""
    merged = dict(base)
    for name, value in over.items():
        both = isinstance(value, Mapping) and isinstance(merged.get(name), Mapping)
        merged[name] = _merged(merged[name], value) if both else value
    return merged


def arguments_for(task: Task, settings: TrialSettings) -> dict[str, Any]:
    """Return settings as arguments of an environment of ``task``: those that have an effect there."""
    without, default = without_effect(task), TrialSettings()
    names = [field.name for field in dataclasses.fields(settings) if field.name not in without]
    arguments = {name: getattr(settings, name) for name in names}
    for outer, _, inner in (name.partition(".") for name in without):
        if inner:
            usual = getattr(getattr(default, outer), inner)
            arguments[outer] = dataclasses.replace(arguments[outer], **{inner: usual})
    return arguments


def name_of(task: Task) -> str:
    """Return a task's name in sentences."""
    return getattr(task, "id", type(task).__name__)  # a task for an environment alone needs no id


def steps(name: str, values: object, shape: tuple[int, ...]) -> NDArray[np.int32]:
    """Return steps as int32 of ``shape``; one row is for all trials."""
    array = numbers(name, values)
    if array.shape in (shape[1:], (1, *shape[1:])):
        array = np.broadcast_to(array, shape)
    if array.shape != shape:
        raise ValueError(f"{name} must have shape {shape}, or be one for all trials, got shape {array.shape}.")
    if array.dtype.kind == "f" and not (np.isfinite(array) & (array == np.trunc(array))).all():
        raise ValueError(f"{name} must consist of whole numbers of steps.")
    if ((array < 0) | (array > NEVER)).any():
        raise ValueError(
            f"{name} must lie between 0 and {NEVER:,} (never), got {array[(array < 0) | (array > NEVER)][0]}."
        )
    return np.ascontiguousarray(array, dtype=np.int32)


def rows(name: str, values: object, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return ``values`` as float32 of ``shape``, in memory of their own; one row is for all trials."""
    array = numbers(name, values)
    if array.shape in (shape[1:], (1, *shape[1:])):
        array = np.broadcast_to(array, shape)
    if array.shape != shape:
        raise ValueError(f"{name} must have shape {shape}, or be one row for all trials, got shape {array.shape}.")
    with np.errstate(over="ignore") if array.itemsize > _SINGLE else contextlib.nullcontext():
        rows = np.array(array, dtype=np.float32, order="C")
    finite = np.isfinite(rows)
    if not finite.all():
        first = rows[~finite.reshape(len(rows), -1).all(axis=1)][0].tolist()
        raise ValueError(f"{name} must consist of finite numbers, got {first}.")
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
    values = {field.name: getattr(settings, field.name) for field in dataclasses.fields(settings)}  # type: ignore[arg-type]
    inner = {name: value for name, value in values.items() if dataclasses.is_dataclass(type(value))}
    changes = {name: renewed(value, type(value)) for name, value in inner.items()}
    return dataclasses.replace(settings, **changes)  # type: ignore[type-var]
