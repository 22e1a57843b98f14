"""Jobs, of which a study is a list: what to call, how long it takes against the others, and how it ended."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path, PurePosixPath
from typing import Any

from bilateral_rl.io.errors import UserError

JobProgress = Callable[[float, str], None]
"""Called by a job with how much of it is done, from 0 to 1, and what it does, in a few words.

The first call tells what was done before this time, even if that is nothing, so that remaining time can be reckoned.
"""


class JobState(StrEnum):
    """Whether and how a job has ended."""

    DONE = "done"
    FAILED = "failed"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class Job:
    """One call of a function, which depends on no other job.

    The function is called as ``function(folder, progress, **arguments)`` in a process of its own: ``folder`` is the
    study's, ``progress`` a :data:`JobProgress`. It writes only files of its own below ``folder``, the ``result`` last
    and whole: where that file is, the job is done and is not called again. Called again after it was interrupted or
    killed, it goes on where it was. At the first SIGINT it saves and returns, or lets KeyboardInterrupt through.

    Raises:
        ValueError: a name or a result that is not a plain relative path, or numbers that are not positive.
    """

    name: str
    """Such as "random_reach/cc_s"; unique in its study, also the name of the log."""
    work: str
    """The function, as "module:function"."""
    result: str
    """The file, relative to the study's folder, whose presence says that the job is done."""
    arguments: Mapping[str, Any] = field(default_factory=dict)
    """Arguments of the function, such as JSON can hold."""
    cost: float = 1.0
    """How much work it is, in a unit of the study's own."""
    threads: int = 1
    """CPUs that it keeps busy; a function that takes a number of threads gets it through its arguments."""

    def __post_init__(self) -> None:
        for path in (self.name, self.result):
            if not is_inside(path):
                raise ValueError(f"{path!r} is not a path below the study's folder")
        if self.cost <= 0 or self.threads < 1:
            raise ValueError(f"{self.name} has cost {self.cost} and {self.threads} threads; both must be positive")

    def is_done(self, folder: Path) -> bool:
        """Whether its result is in the study's folder."""
        return (folder / self.result).is_file()

    def log(self, folder: Path) -> Path:
        """The file that keeps what the job prints, of every time that it ran."""
        return folder / "logs" / f"{self.name}.log"


@dataclass(frozen=True)
class JobOutcome:
    """How a job ended."""

    job: Job
    state: JobState
    seconds: float = 0.0
    """How long it ran this time."""
    error: str | None = None
    """Why it failed, in one line."""
    log: Path | None = None
    """What it printed, and the traceback; None if it never ran."""


def begin(jobs: Sequence[Job], folder: Path) -> tuple[dict[str, JobOutcome], list[Job]]:
    """Make a study's folder, and see what is done in it already.

    Args:
        jobs: of the study.
        folder: the study's.

    Returns:
        The outcomes, by name, of the jobs whose result is there; and the other jobs, the longest first, so that none is
        left alone at the end.

    Raises:
        ValueError: two jobs have one name.
        UserError: the folder cannot be made.
    """
    if len({job.name for job in jobs}) < len(jobs):
        raise ValueError("two jobs of a study have one name")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"Cannot write the study {folder}: {error.strerror}. Choose another --out.") from None
    outcomes = {}
    for job in jobs:
        if job.is_done(folder):
            log = job.log(folder)
            outcomes[job.name] = JobOutcome(job, JobState.DONE, log=log if log.is_file() else None)
    return outcomes, sorted((job for job in jobs if job.name not in outcomes), key=lambda job: -job.cost)


def is_inside(path: str) -> bool:
    """Whether a relative path stays in the folder that it starts from."""
    parts = PurePosixPath(path)
    return bool(parts.parts) and not parts.is_absolute() and ".." not in parts.parts and "\0" not in path
