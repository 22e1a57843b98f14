"""Tasks that users write as classes: ``module:Class``, imported only where the user has named it.

A run of such a task keeps these words, and may come from a stranger, whose words must not run code. So a process
imports what somebody has named to it, at the command line, in Python, or by passing the permission on to a job.
"""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from bilateral_rl.io.errors import UserError

if TYPE_CHECKING:
    from bilateral_rl.envs.tasks import Task

_WORDS = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*(\.[A-Za-z_]\w*)*", re.ASCII)
_NAMED: set[str] = set()
"""What somebody has named to this process."""


def is_code(task: str) -> bool:
    """Whether words for a task name a class, as ``module:Class``."""
    return _WORDS.fullmatch(task) is not None


def allow_code(tasks: Iterable[object]) -> None:
    """Let this process import the classes among ``tasks``, which the user has named himself; other words do nothing."""
    _NAMED.update(task for task in tasks if isinstance(task, str) and is_code(task))


def confirm_code(learned: str, task: object, run: object) -> None:
    """Let this process import the class that a run learned, if ``task`` names it; None says nothing.

    Raises:
        UserError: it names something else.
    """
    if task is None:
        return
    if task != learned or not isinstance(task, str):
        raise UserError(f"{run} learned {learned}, and --task {task} names something else: leave it out.")
    allow_code([task])


def is_allowed(task: str) -> bool:
    """Whether the user has named this class to this process."""
    return task in _NAMED


def code_task(task: str) -> Task:
    """Return the task of the class ``module:Class``, which may lie in the working directory.

    Raises:
        UserError: nobody has named it to this process, it cannot be imported, or is no task.
    """
    from bilateral_rl.envs.tasks import Task  # numerical

    if not is_allowed(task):
        raise UserError(
            f"The task is a class, {task}, and importing it runs its code: if you trust that, say so by --task {task}."
        )
    module_name, _, name = task.partition(":")
    here = str(Path.cwd())
    if here not in sys.path and "" not in sys.path:  # which a script has not that is installed
        sys.path.append(here)
    try:
        found: object = importlib.import_module(module_name)
        for part in name.split("."):
            found = getattr(found, part)
        made = found() if isinstance(found, type) else found
    except Exception as error:  # whatever that code does
        raise UserError(f"The task {task} cannot be made: {type(error).__name__}: {error}.") from error
    if not isinstance(made, Task):
        raise UserError(f"{task} is no task: it must be a subclass of bilateral_rl.envs.Task that takes no arguments.")
    if not re.fullmatch(r"[A-Za-z0-9_][\w.-]{0,59}", str(getattr(made, "id", "")), re.ASCII):
        raise UserError(f"{task} needs an id of letters, digits, _, - and ., of which folders are made.")
    return made
