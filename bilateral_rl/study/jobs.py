"""Jobs, of which a study is a list: what to call, how long it takes against the others, and how it ended."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path, PurePosixPath
from typing import Any, Protocol

from bilateral_rl.io.errors import UserError


class JobState(StrEnum):
    """Where a job is."""

    WAITING = "waiting"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    INTERRUPTED = "interrupted"


class JobProgress(Protocol):
    """How a job tells where it is."""

    def update(self, done: float, text: str = "") -> None:
        """Tell how much of it is done, from 0 to 1, and what it does, in a few words.

        The first call tells what was done before this time, be it 0, so that remaining time can be reckoned.
        """


@dataclass(frozen=True)
class Job:
    """One call of a function, which depends on no other job.

    The function is called as ``function(folder, progress, **arguments)`` in a process of its own: ``folder`` is the
    study's, ``progress`` a :class:`JobProgress`. It writes only files of its own below ``folder``, the ``result`` last
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
    """Of the function: what JSON can hold."""
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
        """Whether its result is there."""
        return (folder / self.result).is_file()

    def log(self, folder: Path) -> Path:
        """Where what it prints is kept, of every time that it ran."""
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


def make_study_folder(folder: Path) -> None:
    """Make it if it is not there. Raises UserError if it cannot."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"Cannot write the study {folder}: {error.strerror}. Choose another --out.") from None


def done_before(jobs: Sequence[Job], folder: Path) -> dict[str, JobOutcome]:
    """Outcomes of those jobs whose result is there already, by name. Raises ValueError for a name given twice."""
    if len({job.name for job in jobs}) < len(jobs):
        raise ValueError("two jobs of a study have one name")
    return {
        job.name: JobOutcome(job, JobState.DONE, log=_if_there(job.log(folder))) for job in jobs if job.is_done(folder)
    }


def longest_first(jobs: Sequence[Job]) -> list[Job]:
    """By falling cost, so that no long job is left alone at the end; those of the same cost as they came."""
    return sorted(jobs, key=lambda job: -job.cost)


def is_inside(path: str) -> bool:
    """Whether a relative path stays in the folder that it starts from."""
    parts = PurePosixPath(path)
    return bool(parts.parts) and not parts.is_absolute() and ".." not in parts.parts and "\0" not in path


def _if_there(path: Path) -> Path | None:
    return path if path.is_file() else None
