"""The two tasks: what a trial is drawn from (paper section 3)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.refusals import shown

if TYPE_CHECKING:
    from bilateral_rl.envs.settings import TrialSettings

Float32 = NDArray[np.float32]


class Trials(NamedTuple):
    """The postures and loads of ``n`` trials."""

    start: Float32
    """(n, 2): shoulder and elbow angle at the start (rad); the arm is at rest."""
    goal: Float32
    """(n, 2): angles (rad) whose hand position is the target."""
    load: Float32
    """(n, 2): constant force on the hand (N)."""


class Task(ABC):
    """A distribution of trials; subclass it for a task of your own.

    Attributes:
        id: name in commands and run folders.
        n_uniform: uniform numbers that one trial takes.
        has_load: whether its trials draw a load, as ``settings.load`` and ``settings.max_load`` say.
    """

    id: ClassVar[str]
    n_uniform: ClassVar[int] = 4
    has_load: ClassVar[bool] = True

    @abstractmethod
    def trials(self, uniform: NDArray[np.float64], settings: TrialSettings) -> Trials:
        """Draw ``n`` trials.

        Args:
            uniform: (n, n_uniform) random numbers in [0, 1).
            settings: how trials run: joint limits, and the largest load.

        Returns:
            The trials, whose fields are arrays (n, 2) or lists, or one row where all trials have the same. Postures
            lie within the joint limits; anything else is refused when the trials begin.
        """


class RandomReach(Task):
    """Reach from one random posture to the hand position of another; no load."""

    id = "random_reach"
    has_load = False

    def trials(self, uniform: NDArray[np.float64], settings: TrialSettings) -> Trials:
        return Trials(
            start=_postures(uniform[:, :2], settings),
            goal=_postures(uniform[:, 2:], settings),
            load=np.zeros((len(uniform), 2), dtype=np.float32),
        )


class HoldPosition(Task):
    """Stay where the hand starts against a constant load, drawn as ``settings.load`` says."""

    id = "hold_position"

    def trials(self, uniform: NDArray[np.float64], settings: TrialSettings) -> Trials:
        start = _postures(uniform[:, :2], settings)
        return Trials(start=start, goal=start, load=_loads(uniform[:, 2:], settings))


TASKS: dict[str, type[Task]] = {task.id: task for task in (RandomReach, HoldPosition)}


def make_task(task: str | Task) -> Task:
    """Return the task called ``task``, or ``task`` itself. Raises ValueError naming the valid choices."""
    if isinstance(task, Task):
        return task
    if isinstance(task, type) and issubclass(task, Task):
        raise TypeError(f"a task is an object of its class: give {task.__name__}(), not {task.__name__}.")
    if not isinstance(task, str) or task not in TASKS:
        raise ValueError(f"unknown task {shown(task)}; choose from {', '.join(TASKS)}.")
    return TASKS[task]()


def _postures(uniform: NDArray[np.float64], settings: TrialSettings) -> Float32:
    """Return postures (n, 2), uniform over the joint range (rad)."""
    lower, upper = np.array(settings.arm.joint_lower_limit), np.array(settings.arm.joint_upper_limit)
    return np.asarray(lower + uniform * (upper - lower), dtype=np.float32)


def _loads(uniform: NDArray[np.float64], settings: TrialSettings) -> Float32:
    """Return loads (n, 2) on the hand (N).

    The text says "random direction, random bounded intensity": we read it as a size that is uniform itself, rather than
    a load uniform over the disk, of which most would be near the bound.
    """
    if settings.load == "axes":
        return np.asarray((2 * uniform - 1) * settings.max_load, dtype=np.float32)
    angle, size = 2 * np.pi * uniform[:, 0], settings.max_load * uniform[:, 1]
    return np.asarray(size[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1), dtype=np.float32)
