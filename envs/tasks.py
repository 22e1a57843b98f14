"""The tasks there are: the paper's two (section 3), those of two arms, and experiments."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.draws import draw_loads, uniform_postures
from bilateral_rl.envs.task import FEATURES, NEVER, PLACES, HandForces, Spring, Task, Timeline, Trials
from bilateral_rl.envs.two_arm_tasks import ReachAndHold, TwoHolds, TwoReaches

if TYPE_CHECKING:
    from bilateral_rl.envs.experiments.experiment import Experiment
    from bilateral_rl.envs.settings import TrialSettings

__all__ = [
    "FEATURES",
    "NEVER",
    "PLACES",
    "TASKS",
    "HandForces",
    "HoldPosition",
    "RandomReach",
    "ReachAndHold",
    "Spring",
    "Task",
    "TaskLike",
    "Timeline",
    "Trials",
    "TwoHolds",
    "TwoReaches",
    "make_task",
]


class RandomReach(Task):
    """Reach from one random posture to the hand position of another; no load."""

    id = "random_reach"
    has_load = False

    def trials(self, uniform: NDArray[np.float64], settings: TrialSettings) -> Trials:
        return Trials(
            start=uniform_postures(uniform[:, :2], settings),
            goal=uniform_postures(uniform[:, 2:], settings),
            load=np.zeros((len(uniform), 2), dtype=np.float32),
        )


class HoldPosition(Task):
    """Stay where the hand starts against a constant load, drawn as ``settings.load`` says."""

    id = "hold_position"
    judged_by = "time_in_goal"

    def trials(self, uniform: NDArray[np.float64], settings: TrialSettings) -> Trials:
        start = uniform_postures(uniform[:, :2], settings)
        return Trials(start=start, goal=start, load=draw_loads(uniform[:, 2:], settings))


_ALL: tuple[type[Task], ...] = (RandomReach, HoldPosition, TwoReaches, ReachAndHold, TwoHolds)
TASKS: dict[str, type[Task]] = {task.id: task for task in _ALL}


TaskLike: TypeAlias = "str | PathLike[str] | Task | Experiment"
"""What names or is a task."""


def make_task(task: TaskLike) -> Task:
    """Return a task.

    Args:
        task: the name of one of :data:`TASKS`, the name of a paradigm such as "curl_field", an experiment or the YAML
            file of one, or a task already.

    Raises:
        ValueError: there is none of that name, or a file that holds no experiment.
        TypeError: something else.
    """
    if isinstance(task, Task):
        return task
    if isinstance(task, type) and issubclass(task, Task):
        raise TypeError(f"a task is an object of its class: give {task.__name__}(), not {task.__name__}.")
    if isinstance(task, str) and task in TASKS:
        return TASKS[task]()
    from bilateral_rl.envs.experiments.files import find_experiment  # what these tasks do without
    from bilateral_rl.envs.experiments.task import ExperimentTask

    return ExperimentTask(find_experiment(task))
