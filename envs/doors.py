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
from bilateral_rl.envs.hand_rows import hand_rows
from bilateral_rl.envs.refusals import shown
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.stability import check_spring, check_stability
from bilateral_rl.envs.task import NEVER, PLACES, HandForces, Spring, Task, Timeline, Trials

T = TypeVar("T")
_SINGLE = 4
"""Bytes of a number in single precision."""


_OF_LOADS, _OF_TWO_ARMS, _OF_ROLES = ("max_load", "load"), ("two_arms",), ("two_arms.roles", "two_arms.reach")
"""Settings that have no effect on a task without a load, of one arm, or of two hands that do the same."""


def settings_for(task: Task, settings: Mapping[str, Any]) -> TrialSettings:
    """Return the settings of an environment of ``task`` alone.

    Raises:
        ValueError: an unknown name, a value outside its range, or settings of a load where there is none.
    """
    usual, default = TrialSettings(**task.trial), TrialSettings()
    chosen = TrialSettings(**_merged(task.trial, settings))
    for name, lack in _without_effect(task).items():
        of = operator.attrgetter(name)
        if of(chosen) not in (of(default), of(usual)):
            raise ValueError(f"{name} has no effect on {_name(task)}, whose trials have {lack}: leave it out.")
    return chosen


def _without_effect(task: Task) -> dict[str, str]:
    """Return the settings that have no effect on ``task``, and what it has that makes them so."""
    without = {} if task.has_load else dict.fromkeys(_OF_LOADS, "no load")
    if task.n_arms == 1:
        return without | dict.fromkeys(_OF_TWO_ARMS, "one arm")
    return without if task.has_roles else without | dict.fromkeys(_OF_ROLES, "the same role for both hands")


def _merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Return nested settings with those of ``over`` in them."""
    merged = dict(base)
    for name, value in over.items():
        both = isinstance(value, Mapping) and isinstance(merged.get(name), Mapping)
        merged[name] = _merged(merged[name], value) if both else value
    return merged


def arguments_for(task: Task, settings: TrialSettings) -> dict[str, Any]:
    """Return settings as arguments of an environment of ``task``: those that have an effect there."""
    without = _without_effect(task)
    names = [field.name for field in dataclasses.fields(settings) if field.name not in without]
    return {name: getattr(settings, name) for name in names}


def _name(task: Task) -> str:
    return getattr(task, "id", type(task).__name__)  # a task for an environment alone needs no id


def checked_trials(trials: object, n: int, task: Task, settings: TrialSettings) -> Trials:
    """Return ``trials`` of ``task`` as arrays of their documented types, a row for each hand.

    Of one arm that is a row for each trial. Of two arms the fields are (2n, …), the dominant and the non-dominant hand
    of each trial in turn, and what is given in the frame of the body, forces and positions, is in the frame of the
    hand's own arm; the spring stays (n,). A field of one row is that row for all trials.

    Raises:
        TypeError: no :class:`Trials`, or a field that does not consist of numbers.
        ValueError: a field of another shape, a number that is not finite or has no meaning there, a posture out of the
            joints' range, or a timeline or forces where the task says that it has none, or none where it has them.
    """
    if not isinstance(trials, tuple) or not 3 <= len(trials) <= len(Trials._fields):
        raise TypeError(f"a task must return Trials(start, goal, load), got {type(trials).__name__}.")
    given, arm, arms = Trials(*trials), settings.arm, () if task.n_arms == 1 else (task.n_arms,)
    start, goal, load = (_rows(name, values, (n, *arms, 2)) for name, values in zip(PLACES, given[:3], strict=True))
    checked = Trials(start, goal, load)
    for name, has in (("timeline", task.has_timeline), ("forces", task.has_forces)):
        if (getattr(given, name) is not None) != has:
            raise ValueError(f"trials of {_name(task)} must have {'a' if has else 'no'} {name}: has_{name} is {has}.")
    if (given.spring is not None) != bool(arms):
        raise ValueError(f"trials of {_name(task)} must have {'a' if arms else 'no'} spring: n_arms is {task.n_arms}.")
    if given.timeline is not None:
        checked = checked._replace(timeline=_checked_timeline(given.timeline, (n, *arms)))
    if given.forces is not None:
        checked = checked._replace(forces=_checked_forces(given.forces, (n, *arms)))
    if given.spring is not None:
        checked = hand_rows(checked._replace(spring=_checked_spring(given.spring, n, arm)), settings)
    for name, postures in (("start", checked.start), ("goal", checked.goal)):
        _check_postures(name, postures, arm)
    if checked.timeline is not None:
        _check_postures("jump_goal", checked.timeline.jump_goal, arm)
    if checked.forces is not None:
        check_stability(checked.forces, arm)
        walls = checked.forces.walls
        if walls.any() and (walls.any(axis=1) & (checked.start == checked.goal).all(axis=1)).any():
            raise ValueError("walls lie along the line from start to goal, which must not be the same place.")
    return checked


def _checked_timeline(timeline: Timeline, shape: tuple[int, ...]) -> Timeline:
    if not isinstance(timeline, Timeline):
        raise TypeError(f"timeline must be a Timeline, got {type(timeline).__name__}.")
    go, jump = _steps("go", timeline.go, shape), _steps("jump", timeline.jump, shape)
    if (jump < go).any():
        first = tuple(np.argwhere(jump < go)[0])
        raise ValueError(f"jump must not come before go, got steps {jump[first]} and {go[first]}.")
    return Timeline(go, jump, _rows("jump_goal", timeline.jump_goal, (*shape, 2)))


def _checked_forces(forces: HandForces, shape: tuple[int, ...]) -> HandForces:
    if not isinstance(forces, HandForces):
        raise TypeError(f"forces must be HandForces, got {type(forces).__name__}.")
    walls = _rows("walls", forces.walls, (*shape, 2))
    if (walls < 0).any():
        raise ValueError(f"walls must have a stiffness and a damping of at least 0, got {walls[walls < 0][0]}.")
    return HandForces(
        velocity_gain=_rows("velocity_gain", forces.velocity_gain, (*shape, 2, 2)),
        position_gain=_rows("position_gain", forces.position_gain, (*shape, 2, 2)),
        center=_rows("center", forces.center, (*shape, 2)),
        pulse=_rows("pulse", forces.pulse, (*shape, 2)),
        pulse_window=_steps("pulse_window", forces.pulse_window, (*shape, 2)),
        walls=walls,
    )


def _checked_spring(spring: Spring, n: int, arm: ArmParameters) -> Spring:
    if not isinstance(spring, Spring):
        raise TypeError(f"spring must be a Spring, got {type(spring).__name__}.")
    checked = Spring(*(_rows(f"{name} of the spring", getattr(spring, name), (n,)) for name in Spring._fields))
    for name, values in checked._asdict().items():
        if (values < 0).any():
            raise ValueError(f"{name} of the spring must be at least 0, got {values[values < 0][0]}.")
    check_spring(checked, arm)
    return checked


def _steps(name: str, values: object, shape: tuple[int, ...]) -> NDArray[np.int32]:
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


def _check_postures(name: str, postures: NDArray[np.float32], arm: ArmParameters) -> None:
    lower, upper = np.array((arm.joint_lower_limit, arm.joint_upper_limit), dtype=np.float32)
    columns = postures.T.copy()  # NumPy is slow where the last axis is short
    inside = (columns >= lower[:, None]) & (columns <= upper[:, None])
    if not inside.all():
        limits = f"{lower.tolist()} to {upper.tolist()} rad"
        first = postures[~inside.all(axis=0)][0].tolist()
        raise ValueError(f"{name} must lie within the joint limits, {limits}, got {first}.")


def _rows(name: str, values: object, shape: tuple[int, ...]) -> NDArray[np.float32]:
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
