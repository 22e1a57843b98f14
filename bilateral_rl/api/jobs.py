"""The jobs of a study, as the Python face and the commands run them."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path

from bilateral_rl.api.progress import ProgressLike, console_of
from bilateral_rl.io.errors import Stopped
from bilateral_rl.study.board import SILENT, ConsoleBoard
from bilateral_rl.study.jobs import Job, JobOutcome, JobState
from bilateral_rl.study.local import run_local


def run_jobs(
    jobs: Sequence[Job], folder: Path, *, title: str, at_once: int, ray: str | None, progress: ProgressLike
) -> list[JobOutcome]:
    """Run the jobs of a study, on this machine or on a Ray cluster.

    Args:
        jobs: the jobs.
        folder: folder of the study.
        title: of the board, one word.
        at_once: number of jobs at a time, on this machine.
        ray: address of the cluster; None for this machine.
        progress: whether, or where, to show how they come along.

    Returns:
        How each job ended, in the order of ``jobs``.

    Raises:
        UserError: a cluster that is not there, or jobs that it cannot take.
        Stopped: somebody stopped the jobs.
    """
    console = console_of(progress)
    with contextlib.ExitStack() as stack:
        board = SILENT if console is None else stack.enter_context(ConsoleBoard(console, title))
        if ray is None:
            outcomes = run_local(jobs, folder, at_once, board)
        else:
            from bilateral_rl.study.ray_cluster import run_on_ray

            outcomes = run_on_ray(jobs, folder, ray, board)
    if any(outcome.state == JobState.INTERRUPTED for outcome in outcomes):
        done = sum(outcome.state == JobState.DONE for outcome in outcomes)
        raise Stopped(f"Stopped with {done} of {len(outcomes)} jobs done; called again, it goes on.")
    return outcomes


def failures(outcomes: Sequence[JobOutcome]) -> list[str]:
    """Return, for each job that failed, its name with the reason."""
    return [f"{outcome.job.name}: {outcome.error}" for outcome in outcomes if outcome.state == JobState.FAILED]


def unsourced_in_words(paths: Sequence[Path]) -> str:
    """Say which results do not say which weights they are of; "" if all do."""
    if not paths:
        return ""
    others = f" and {len(paths) - 1} more" if len(paths) > 1 else ""
    return (
        f"{paths[0]}{others} do not say which weights they are of, so that it would go unnoticed if their runs were "
        "trained on since."
    )


def notes_on(outcomes: Sequence[JobOutcome], unsourced: Sequence[Path]) -> list[str]:
    """Return what a person should know of jobs that failed, and of results that do not say what they are of."""
    return [*(f"Failed: {failure}" for failure in failures(outcomes)), *filter(None, [unsourced_in_words(unsourced)])]
