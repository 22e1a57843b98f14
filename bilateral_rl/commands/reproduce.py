"""`bilateral-rl reproduce`."""

from __future__ import annotations

import shlex
import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from bilateral_rl.claims import Claim
from bilateral_rl.claims.margins import PAPER_SEEDS
from bilateral_rl.commands.jobs import print_failures, print_unsourced, run_jobs
from bilateral_rl.config import parse as settings
from bilateral_rl.config.seeds import Seeds, parse_seeds
from bilateral_rl.study.folder import claimed_folder
from bilateral_rl.study.jobs import JobOutcome
from bilateral_rl.study.outcome import unsourced
from bilateral_rl.study.plan import QUICK_SEEDS, Study, side_by_side
from bilateral_rl.study.report import counts_of
from bilateral_rl.study.reproduction import REPORT, conclude

_STYLES = {"supported": "green", "not supported": "red", "undecided": "yellow"}


def reproduce(
    *,
    algo: str,
    profile: str,
    seeds: str | None,
    quick: bool,
    n_jobs: int | None,
    ray: str | None,
    overrides: Sequence[str],
    out: Path | None,
    console: Console,
) -> None:
    """Train, lesion and test every model on every task, and report what that says of the paper's claims.

    Args:
        algo: the algorithm of every training.
        profile: "paper", or "released" for the losses and lesions of its released code.
        seeds: networks of each model, as ``--seeds`` takes them; None for the usual number of them.
        quick: whether it is a preview.
        n_jobs: number of trainings at a time; None for one a CPU.
        ray: address of a Ray cluster; None for this machine.
        overrides: settings of every training, as ``--set`` takes them.
        out: folder of the study; None for one below ``runs``.
        console: where to print.

    Raises:
        UserError: a study that cannot be made, or not there.
        SystemExit: somebody stopped it.
    """
    began = time.monotonic()
    study = _study(algo, profile, seeds, quick, settings.parse_overrides(overrides))
    at_once, threads = side_by_side(n_jobs, study.n_jobs)
    jobs = study.jobs(threads)
    folder = out or Path("runs") / study.name
    begins = f"{len(jobs)} trainings into [bold]{_quoted(folder)}[/bold]"
    with claimed_folder(folder, study.to_values()):
        console.print(f"{begins}; Ctrl-C stops and saves, the same command goes on.", soft_wrap=True, highlight=False)
        outcomes = run_jobs(jobs, folder, title=study.name, at_once=at_once, ray=ray, console=console)
    claims = _conclude(study, folder, outcomes, console)
    console.print(_verdicts(claims))
    if quick:
        console.print("[yellow]A preview: few seeds, short trainings, few trials. No verdict here is a result.")
    minutes = (time.monotonic() - began) / 60
    console.print(f"{counts_of(claims)} {minutes:.1f} minutes.", highlight=False)
    print_failures(outcomes, console)
    print_unsourced(unsourced(folder / job.result for job in jobs), console)
    console.print(f"Report: [bold]{_quoted(folder / REPORT)}[/bold]", soft_wrap=True, highlight=False)


def _study(algo: str, profile: str, seeds: str | None, quick: bool, overrides: settings.Values) -> Study:
    if seeds is None:
        chosen = Seeds(QUICK_SEEDS if quick else PAPER_SEEDS)
    else:
        chosen = parse_seeds(seeds, "--set seed" if "seed" in overrides else "")
    return Study(algo, profile, chosen.first or 0, chosen.n, quick, overrides)


def _conclude(study: Study, folder: Path, outcomes: Sequence[JobOutcome], console: Console) -> list[Claim]:
    with console.status("concluding") as status:
        return conclude(study, folder, outcomes, lambda text: status.update(f"{text} …"))


def _verdicts(claims: Sequence[Claim]) -> Table:
    table = Table("", "the paper's claim", "verdict", title="Verdicts", title_justify="left")
    for claim in claims:
        table.add_row(claim.number, claim.statement, f"[{_STYLES[claim.verdict]}]{claim.verdict}")
    return table


def _quoted(path: Path) -> str:
    return escape(shlex.quote(str(path)))
