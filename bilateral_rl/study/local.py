"""The jobs of a study on this machine, each in a process of its own, so many at a time."""

from __future__ import annotations

import os
from collections.abc import Sequence
from multiprocessing.connection import wait
from pathlib import Path

from bilateral_rl.io.errors import UserError
from bilateral_rl.study.board import SILENT, Board
from bilateral_rl.study.jobs import Job, JobOutcome, JobState, begin
from bilateral_rl.study.process import JobProcess
from bilateral_rl.training.progress import StopRequest

_INTERVAL = 0.1
"""Seconds after which to look again, at the latest."""


def run_local(jobs: Sequence[Job], folder: Path, n_processes: int, board: Board = SILENT) -> list[JobOutcome]:
    """Do every job that is not done, the longest first; one that fails, however it does, stops no other.

    At the first Ctrl-C running jobs are asked to save and stop, and no other starts; at the second they are killed.
    Called again, those without a result go on. When this process dies, its jobs do as well.

    Args:
        jobs: of the study.
        folder: the study's; what jobs print goes to ``logs/<name>.log`` below it.
        n_processes: how many run at a time.
        board: told how they come along.

    Returns:
        How each ended, in the order of ``jobs``.

    Raises:
        UserError: less than one process, a folder that cannot be written, or Windows, where processes have no groups.
    """
    if not hasattr(os, "killpg"):
        raise UserError("Studies run on Linux and macOS; on Windows, train, lesion and compare the models one by one.")
    if n_processes < 1:
        raise UserError(f"Jobs need at least one process, got {n_processes}; give --jobs a positive number.")
    outcomes, to_do = begin(jobs, folder)
    board.begin(jobs, set(outcomes))
    outcomes |= _Processes(to_do, folder, board).run(n_processes)
    return [outcomes[job.name] for job in jobs]


class _Processes:
    def __init__(self, waiting: list[Job], folder: Path, board: Board) -> None:
        self._waiting, self._folder, self._board = waiting, folder, board
        self._running: list[JobProcess] = []
        self._outcomes: dict[str, JobOutcome] = {}

    def run(self, n: int) -> dict[str, JobOutcome]:
        """Run every job, ``n`` at a time, and return their outcomes by name."""
        stop = StopRequest()
        try:
            with stop.on_interrupt():
                while not stop.requested and (self._waiting or self._running):
                    while self._waiting and len(self._running) < n:
                        self._start(self._waiting.pop(0))
                    self._look(interrupted=False)
                if stop.requested:
                    self._board.on_interrupt()
                for process in self._running:
                    process.interrupt()
                while self._running:
                    self._look(interrupted=True)
        except KeyboardInterrupt:
            pass  # the second
        finally:
            for process in self._running:
                process.kill()
            self._collect(interrupted=True)
        return self._outcomes | {job.name: JobOutcome(job, JobState.INTERRUPTED) for job in self._waiting}

    def _start(self, job: Job) -> None:
        self._running.append(JobProcess(job, self._folder, job.log(self._folder)))
        self._board.on_start(job)

    def _look(self, interrupted: bool) -> None:
        """Wait for a moment, then tell the board what has happened."""
        wait([process.pipe for process in self._running if process.pipe is not None], _INTERVAL)
        for process in self._running:
            for report in process.reports():
                self._board.on_progress(process.job, *report)
        self._collect(interrupted)
        self._board.tick()

    def _collect(self, interrupted: bool) -> None:
        for process in [process for process in self._running if process.ended]:
            self._running.remove(process)
            outcome = process.outcome(interrupted)
            self._outcomes[process.job.name] = outcome
            self._board.on_end(outcome)
