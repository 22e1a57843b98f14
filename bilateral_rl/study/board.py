"""The board of a study: how all its jobs come along, on a terminal or in lines."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TaskProgressColumn, TextColumn
from rich.table import Column
from rich.text import Text

from bilateral_rl.io.terminal import printable
from bilateral_rl.study.jobs import Job, JobOutcome, JobState

LINE_INTERVAL = 30.0
"""Seconds between two lines on the whole study, where there is no terminal."""


class Board:
    """Who is told how a study comes along; subclass it to watch, or leave it unwatched."""

    def begin(self, jobs: Sequence[Job], done: AbstractSet[str]) -> None:
        """The study has these jobs, of which those named were done before."""

    def on_start(self, job: Job) -> None:
        """It runs now, or, on a cluster that has lost it, once more."""

    def on_progress(self, job: Job, done: float, text: str) -> None:
        """So much of it is done, from 0 to 1."""

    def on_end(self, outcome: JobOutcome) -> None:
        """It runs no more."""

    def on_interrupt(self) -> None:
        """Somebody asked to stop; running jobs save."""

    def tick(self) -> None:
        """Some time has passed."""


SILENT = Board()


@dataclass
class _Share:
    """How much of one job is done, and was done when it started."""

    cost: float
    done: float = 0.0
    before: float | None = None


class Tally:
    """How much of a study is done, and how long the rest will take.

    The unit is the jobs' cost: one that is half done counts half its cost.

    Args:
        jobs: of the study.
        done: names of those that are done before it starts.
    """

    def __init__(self, jobs: Sequence[Job], done: AbstractSet[str]) -> None:
        self._shares = {job.name: _Share(job.cost) for job in jobs}
        self.states = {job.name: JobState.DONE if job.name in done else JobState.WAITING for job in jobs}
        for name in done:
            self._shares[name].done = self._shares[name].before = 1.0

    def start(self, job: Job) -> None:
        """The job runs."""
        self.states[job.name] = JobState.RUNNING
        self._shares[job.name] = _Share(job.cost)

    def progress(self, job: Job, done: float) -> None:
        """The job has come so far."""
        share = self._shares[job.name]
        share.done = min(max(done, 0.0), 1.0)
        if share.before is None:
            share.before = share.done

    def end(self, job: Job, state: JobState) -> None:
        """The job ended so."""
        share = self._shares[job.name]
        self.states[job.name] = state
        if state != JobState.INTERRUPTED:
            share.done = 1.0
        if state == JobState.FAILED:
            share.before = 1.0  # how soon it failed says nothing of how long the others take

    def fraction(self) -> float:
        """Of the whole study."""
        total = sum(share.cost for share in self._shares.values())
        return sum(share.cost * share.done for share in self._shares.values()) / total if total else 1.0

    def remaining(self, seconds: float) -> float | None:
        """Seconds to go, if it goes on as in the ``seconds`` since it started; None when nothing tells yet."""
        worked = sum(share.cost * (share.done - (share.before or 0.0)) for share in self._shares.values())
        left = sum(share.cost * (1 - share.done) for share in self._shares.values())
        return seconds * left / worked if worked > 0 else None

    def summary(self) -> str:
        """Such as "3 of 14 jobs done, 1 failed"."""
        states = list(self.states.values())
        failed = states.count(JobState.FAILED)
        return f"{states.count(JobState.DONE)} of {len(states)} jobs done" + (f", {failed} failed" if failed else "")


class ConsoleBoard(Board):
    """A bar for the study and for each running job, and a line when one ends; lines only where there is no terminal.

    Args:
        console: where.
        title: of the study, one word.
        clock: seconds.
    """

    def __init__(self, console: Console, title: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._console, self._title, self._clock = console, title, clock
        self._draws = console.is_terminal and not console.is_dumb_terminal
        self._bars = Progress(
            TextColumn("{task.description}", markup=False, table_column=Column(no_wrap=True)),
            BarColumn(bar_width=20),
            TaskProgressColumn(),
            TextColumn("{task.fields[text]}", markup=False, table_column=Column(no_wrap=True, overflow="ellipsis")),
            console=console,
            refresh_per_second=4,
            disable=not self._draws,
        )
        self._tasks: dict[str, TaskID] = {}
        self._tally = Tally([], set())
        self._began = self._last_line = clock()

    def __enter__(self) -> ConsoleBoard:
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()

    def begin(self, jobs: Sequence[Job], done: AbstractSet[str]) -> None:
        self._tally = Tally(jobs, done)
        self._began = self._last_line = self._clock()
        self._whole = self._bars.add_task(self._title, total=1.0, text="")
        if done:
            self._say(f"{len(done)} of {len(jobs)} jobs were done before.")
        self.tick()

    def on_start(self, job: Job) -> None:
        self._tally.start(job)
        self._remove(job)
        self._tasks[job.name] = self._bars.add_task(job.name, total=1.0, text="")

    def on_progress(self, job: Job, done: float, text: str) -> None:
        self._tally.progress(job, done)
        self._bars.update(self._tasks[job.name], completed=done, text=text)

    def on_end(self, outcome: JobOutcome) -> None:
        self._tally.end(outcome.job, outcome.state)
        self._remove(outcome.job)
        line = f"{outcome.job.name} {outcome.state} after {duration(outcome.seconds)}"
        self._say(f"{line}: {outcome.error} ({outcome.log})" if outcome.error else line)
        self.tick()

    def on_interrupt(self) -> None:
        self._bars.console.print(
            "Stopping: running jobs save what they have. Ctrl-C again kills them.", highlight=False
        )

    def tick(self) -> None:
        self._bars.update(self._whole, completed=self._tally.fraction(), text=self._where())
        if not self._draws and self._clock() - self._last_line >= LINE_INTERVAL:
            self._last_line = self._clock()
            self._say(f"{self._title}: {100 * self._tally.fraction():.0f} %, {self._where()}")

    def _where(self) -> str:
        remaining = self._tally.remaining(self._clock() - self._began)
        return self._tally.summary() + (f", about {duration(remaining)} left" if remaining else "")

    def _remove(self, job: Job) -> None:
        if job.name in self._tasks:
            self._bars.remove_task(self._tasks.pop(job.name))

    def _say(self, line: str) -> None:
        self._console.print(Text(printable(line)), soft_wrap=True)


def duration(seconds: float) -> str:
    """For people: "40 s", "12 min" or "1 h 05 min"."""
    if seconds < 59.5:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"
