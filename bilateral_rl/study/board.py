"""The board of a study: it shows how all jobs come along, on a terminal or in lines."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from collections.abc import Set as AbstractSet

from rich.console import Console
from rich.progress import BarColumn, TaskID, TaskProgressColumn, TextColumn
from rich.table import Column
from rich.text import Text

from bilateral_rl.io.bars import Bars, draws
from bilateral_rl.io.terminal import printable
from bilateral_rl.study.jobs import Job, JobOutcome, JobState

LINE_INTERVAL = 30.0
"""Seconds between two lines about the whole study, where there is no terminal."""


class Board:
    """An observer of a study; subclass it to watch, or leave it unwatched."""

    def begin(self, jobs: Sequence[Job], done: AbstractSet[str]) -> None:
        """The study has these jobs; those named in ``done`` were done before."""

    def on_start(self, job: Job) -> None:
        """A job starts, or, on a cluster that has lost it, starts once more."""

    def on_progress(self, job: Job, done: float, text: str) -> None:
        """A job has come so far, from 0 to 1, and says in a few words what it does."""

    def on_end(self, outcome: JobOutcome) -> None:
        """A job has ended."""

    def on_interrupt(self) -> None:
        """Somebody asked to stop; running jobs save."""

    def tick(self) -> None:
        """Some time has passed."""


SILENT = Board()


class ConsoleBoard(Board):
    """A bar for the study and for each running job, and a line when one ends; lines only where there is no terminal.

    The unit is the jobs' cost: a job that is half done counts half its cost. The remaining time is reckoned here, as
    rich's own would take for speed what earlier calls had done, and jobs that failed at once.

    Args:
        console: where to print.
        title: of the study, one word.
        clock: returns seconds.
    """

    def __init__(self, console: Console, title: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._console, self._title, self._clock = console, title, clock
        self._draws = draws(console)
        self._bars = Bars(
            TextColumn("{task.description}", markup=False, table_column=Column(no_wrap=True)),
            BarColumn(bar_width=20),
            TaskProgressColumn(),
            TextColumn("{task.fields[text]}", markup=False, table_column=Column(no_wrap=True, overflow="ellipsis")),
            console=console,
        )
        self._tasks: dict[str, TaskID] = {}
        self.begin([], set())

    def __enter__(self) -> ConsoleBoard:
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()

    def begin(self, jobs: Sequence[Job], done: AbstractSet[str]) -> None:
        self._costs = {job.name: job.cost for job in jobs}
        self._done = dict.fromkeys(done, 1.0)  # share of each job that is done,
        self._before = dict.fromkeys(done, 1.0)  # and that was done when it started: no measure of speed
        self._ended = Counter({JobState.DONE: len(done)})
        self._began = self._last_line = self._clock()
        if jobs:
            self._whole = self._bars.add_task(self._title, total=1.0, text="")
            if done:
                self._say(f"{len(done)} of {len(jobs)} jobs were done before.")
            self.tick()

    def on_start(self, job: Job) -> None:
        self._done.pop(job.name, None)
        self._before.pop(job.name, None)
        self._remove(job)
        self._tasks[job.name] = self._bars.add_task(job.name, total=1.0, text="")

    def on_progress(self, job: Job, done: float, text: str) -> None:
        self._done[job.name] = min(max(done, 0.0), 1.0)
        self._before.setdefault(job.name, self._done[job.name])
        self._bars.update(self._tasks[job.name], completed=done, text=text)

    def on_end(self, outcome: JobOutcome) -> None:
        name, state = outcome.job.name, outcome.state
        self._ended[state] += 1
        if state != JobState.INTERRUPTED:
            self._done[name] = 1.0
        if state == JobState.FAILED:
            self._before[name] = 1.0  # how soon it failed says nothing of how long the others take
        self._remove(outcome.job)
        line = f"{name} {state} after {duration(outcome.seconds)}"
        self._say(f"{line}: {outcome.error} ({outcome.log})" if outcome.error else line)
        self.tick()

    def on_interrupt(self) -> None:
        self._bars.console.print(
            "Stopping: running jobs save what they have. Ctrl-C again kills them.", highlight=False
        )

    def tick(self) -> None:
        fraction, text = self.fraction(), self.summary()
        if remaining := self.remaining():
            text += f", about {duration(remaining)} left"
        self._bars.update(self._whole, completed=fraction, text=text)
        if not self._draws and self._clock() - self._last_line >= LINE_INTERVAL:
            self._last_line = self._clock()
            self._say(f"{self._title}: {100 * fraction:.0f} %, {text}")

    def fraction(self) -> float:
        """Share of the whole study that is done, from 0 to 1."""
        total = sum(self._costs.values())
        return self._cost(self._done) / total if total else 1.0

    def remaining(self) -> float | None:
        """Seconds to go at the pace since the study began; None as long as nothing tells."""
        worked = self._cost(self._done) - self._cost(self._before)
        left = sum(self._costs.values()) - self._cost(self._done)
        return (self._clock() - self._began) * left / worked if worked > 0 else None

    def summary(self) -> str:
        """How many jobs are done and failed: "3 of 14 jobs done, 1 failed"."""
        failed = f", {self._ended[JobState.FAILED]} failed" if self._ended[JobState.FAILED] else ""
        return f"{self._ended[JobState.DONE]} of {len(self._costs)} jobs done{failed}"

    def _cost(self, shares: Mapping[str, float]) -> float:
        return sum(self._costs[name] * share for name, share in shares.items())

    def _remove(self, job: Job) -> None:
        if job.name in self._tasks:
            self._bars.remove_task(self._tasks.pop(job.name))

    def _say(self, line: str) -> None:
        self._console.print(Text(printable(line)), soft_wrap=True)


def duration(seconds: float) -> str:
    """A duration for people: "40 s", "12 min" or "1 h 05 min"."""
    if seconds < 59.5:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"
