"""Trials are checked here, once, before any kernel sees them, whoever made the task that they are of."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.arm.parameters import ArmParameters
from bilateral_rl.envs.doors import name_of, rows, steps
from bilateral_rl.envs.hand_rows import hand_rows
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.stability import check_spring, check_stability
from bilateral_rl.envs.task import PLACES, HandForces, Spring, Task, Timeline, Trials


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
    start, goal, load = (rows(name, values, (n, *arms, 2)) for name, values in zip(PLACES, given[:3], strict=True))
    checked = Trials(start, goal, load)
    wanted = {"has_timeline": task.has_timeline, "has_forces": task.has_forces, "n_arms": bool(arms)}
    for (attribute, has), name in zip(wanted.items(), ("timeline", "forces", "spring"), strict=True):
        if (getattr(given, name) is not None) != has:
            why = f"{attribute} is {getattr(task, attribute)}"
            raise ValueError(f"trials of {name_of(task)} must have {'a' if has else 'no'} {name}: {why}.")
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
    go, jump = steps("go", timeline.go, shape), steps("jump", timeline.jump, shape)
    if (jump < go).any():
        first = tuple(np.argwhere(jump < go)[0])
        raise ValueError(f"jump must not come before go, got steps {jump[first]} and {go[first]}.")
    return Timeline(go, jump, rows("jump_goal", timeline.jump_goal, (*shape, 2)))


def _checked_forces(forces: HandForces, shape: tuple[int, ...]) -> HandForces:
    if not isinstance(forces, HandForces):
        raise TypeError(f"forces must be HandForces, got {type(forces).__name__}.")
    walls = rows("walls", forces.walls, (*shape, 2))
    if (walls < 0).any():
        raise ValueError(f"walls must have a stiffness and a damping of at least 0, got {walls[walls < 0][0]}.")
    return HandForces(
        velocity_gain=rows("velocity_gain", forces.velocity_gain, (*shape, 2, 2)),
        position_gain=rows("position_gain", forces.position_gain, (*shape, 2, 2)),
        center=rows("center", forces.center, (*shape, 2)),
        pulse=rows("pulse", forces.pulse, (*shape, 2)),
        pulse_window=steps("pulse_window", forces.pulse_window, (*shape, 2)),
        walls=walls,
    )


def _checked_spring(spring: Spring, n: int, arm: ArmParameters) -> Spring:
    if not isinstance(spring, Spring):
        raise TypeError(f"spring must be a Spring, got {type(spring).__name__}.")
    checked = Spring(*(rows(f"{name} of the spring", getattr(spring, name), (n,)) for name in Spring._fields))
    for name, values in checked._asdict().items():
        if (values < 0).any():
            raise ValueError(f"{name} of the spring must be at least 0, got {values[values < 0][0]}.")
    check_spring(checked, arm)
    return checked


def _check_postures(name: str, postures: NDArray[np.float32], arm: ArmParameters) -> None:
    lower, upper = np.array((arm.joint_lower_limit, arm.joint_upper_limit), dtype=np.float32)
    columns = postures.T.copy()  # NumPy is slow where the last axis is short
    inside = (columns >= lower[:, None]) & (columns <= upper[:, None])
    if not inside.all():
        limits = f"{lower.tolist()} to {upper.tolist()} rad"
        first = postures[~inside.all(axis=0)][0].tolist()
        raise ValueError(f"{name} must lie within the joint limits, {limits}, got {first}.")
