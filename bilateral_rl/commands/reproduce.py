"""`bilateral-rl reproduce`."""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from bilateral_rl.claims import Claim
from bilateral_rl.claims.margins import PAPER_SEEDS
from bilateral_rl.commands.train import INTERRUPTED_EXIT
from bilateral_rl.config import parse as settings
from bilateral_rl.study.board import ConsoleBoard
from bilateral_rl.study.folder import claim_folder
from bilateral_rl.study.jobs import Job, JobOutcome, JobState
from bilateral_rl.study.local import run_local
from bilateral_rl.study.plan import QUICK_SEEDS, Study, side_by_side
from bilateral_rl.study.report import counts_of
from bilateral_rl.study.reproduction import REPORT, conclude

_STYLES = {"supported": "green", "not supported": "red", "undecided": "yellow"}


def reproduce(
    *,
    algo: str,
    profile: str,
    seeds: int | None,
    quick: bool,
    n_jobs: int | None,
    ray: str | None,
    overrides: Sequence[str],
    out: Path | None,
    console: Console,
) -> None:
    """Train, lesion and test every model on every task, and report what that says of the paper's claims."""
    given = seeds if seeds is not None else (QUICK_SEEDS if quick else PAPER_SEEDS)
    study = Study(algo, profile, given, quick, settings.parse_overrides(overrides))
    at_once, threads = side_by_side(n_jobs, len(study.configs()))
    jobs = study.jobs(threads)
    folder = out or Path("runs") / study.name
    claim_folder(folder, study.to_values())
    place = escape(shlex.quote(str(folder)))
    console.print(
        f"{len(jobs)} trainings into [bold]{place}[/bold]; Ctrl-C stops and saves, the same command goes on.",
        soft_wrap=True,
        highlight=False,
    )
    began = time.monotonic()
    outcomes = run_jobs(jobs, folder, at_once, ray, study.name, console)
    leave_if_interrupted(outcomes, console)
    claims = _conclude(study, folder, outcomes, console)
    console.print(_verdicts(claims))
    if quick:
        console.print("[yellow]A preview: few seeds, short trainings, few trials. No verdict here is a result.")
    minutes = (time.monotonic() - began) / 60
    console.print(f"{counts_of(claims)} {minutes:.1f} minutes.", highlight=False)
    for outcome in outcomes:
        if outcome.state == JobState.FAILED:
            console.print(f"[red]Failed:[/red] {outcome.job.name}: {escape(outcome.error or '')}", soft_wrap=True)
    console.print(f"Report: [bold]{escape(shlex.quote(str(folder / REPORT)))}[/bold]", soft_wrap=True, highlight=False)


def run_jobs(
    jobs: Sequence[Job], folder: Path, at_once: int, ray: str | None, title: str, console: Console
) -> list[JobOutcome]:
    """The jobs of a study, on this machine or on the Ray cluster at ``ray``."""
    with ConsoleBoard(console, title) as board:
        if ray is None:
            return run_local(jobs, folder, at_once, board)
        from bilateral_rl.study.ray_cluster import run_on_ray

        return run_on_ray(jobs, folder, ray, board)


def leave_if_interrupted(outcomes: Sequence[JobOutcome], console: Console) -> None:
    """End the command if somebody stopped its jobs."""
    if any(outcome.state == JobState.INTERRUPTED for outcome in outcomes):
        done = sum(outcome.state == JobState.DONE for outcome in outcomes)
        console.print(f"Stopped with {done} of {len(outcomes)} jobs done; the same command goes on.", highlight=False)
        sys.exit(INTERRUPTED_EXIT)


def _conclude(study: Study, folder: Path, outcomes: Sequence[JobOutcome], console: Console) -> list[Claim]:
    if not console.is_terminal:
        return conclude(study, folder, outcomes, lambda text: console.print(f"{text} …", highlight=False))
    with console.status("concluding") as status:
        return conclude(study, folder, outcomes, lambda text: status.update(f"{text} …"))


def _verdicts(claims: Sequence[Claim]) -> Table:
    table = Table("", "the paper's claim", "verdict", title="Verdicts", title_justify="left")
    for claim in claims:
        table.add_row(claim.number, claim.statement, f"[{_STYLES[claim.verdict]}]{claim.verdict}")
    return table
