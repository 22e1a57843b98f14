"""The jobs of a study, as commands run them and report on them."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from bilateral_rl.study.board import ConsoleBoard
from bilateral_rl.study.jobs import Job, JobOutcome, JobState
from bilateral_rl.study.local import run_local

INTERRUPTED_EXIT = 128 + signal.SIGINT


def run_jobs(
    jobs: Sequence[Job], folder: Path, *, title: str, at_once: int, ray: str | None, console: Console
) -> list[JobOutcome]:
    """Run the jobs of a study, on this machine or on a Ray cluster; end the command if somebody stops them.

    Args:
        jobs: the jobs.
        folder: folder of the study.
        title: of the board, one word.
        at_once: number of jobs at a time, on this machine.
        ray: address of the cluster; None for this machine.
        console: where to print how they come along.

    Returns:
        How each job ended, in the order of ``jobs``.

    Raises:
        UserError: a cluster that is not there, or jobs that it cannot take.
        SystemExit: somebody stopped the jobs.
    """
    with ConsoleBoard(console, title) as board:
        if ray is None:
            outcomes = run_local(jobs, folder, at_once, board)
        else:
            from bilateral_rl.study.ray_cluster import run_on_ray

            outcomes = run_on_ray(jobs, folder, ray, board)
    if any(outcome.state == JobState.INTERRUPTED for outcome in outcomes):
        done = sum(outcome.state == JobState.DONE for outcome in outcomes)
        console.print(f"Stopped with {done} of {len(outcomes)} jobs done; the same command goes on.", highlight=False)
        sys.exit(INTERRUPTED_EXIT)
    return outcomes


def print_failures(outcomes: Sequence[JobOutcome], console: Console) -> None:
    """Print a line for each job that failed, with the reason."""
    for outcome in outcomes:
        if outcome.state == JobState.FAILED:
            console.print(f"[red]Failed:[/red] {escape(f'{outcome.job.name}: {outcome.error}')}", soft_wrap=True)


def print_unsourced(paths: Sequence[Path], console: Console) -> None:
    """Print a note on results that do not say which weights they are of."""
    if paths:
        others = f" and {len(paths) - 1} more" if len(paths) > 1 else ""
        console.print(
            f"[yellow]Note:[/yellow] {escape(str(paths[0]))}{others} do not say which weights they are of, so that it "
            "would go unnoticed if their runs were trained on since.",
            soft_wrap=True,
            highlight=False,
        )
