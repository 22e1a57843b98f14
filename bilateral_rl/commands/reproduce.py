"""`bilateral-rl reproduce`."""

from __future__ import annotations

import shlex
import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from bilateral_rl.api.reproduction import Plan, make_plan, run_plan
from bilateral_rl.claims import Judgement, Verdict
from bilateral_rl.commands.jobs import ending_if_stopped, print_failures, print_unsourced
from bilateral_rl.config.parse import parse_overrides
from bilateral_rl.study.agenda import Step
from bilateral_rl.study.report import counts_of
from bilateral_rl.study.words import WORDS

_STYLES: dict[Verdict, str] = {"supported": "green", "not supported": "red", "undecided": "yellow"}
_SHOWN = 3
"""Largest number of readings that stand side by side."""


def reproduce(
    *,
    algo: str,
    profile: str,
    models: Sequence[str] | None,
    study: str,
    tasks: Sequence[str] | None,
    seeds: str | None,
    quick: bool,
    n_jobs: int | None,
    ray: str | None,
    overrides: Sequence[str],
    readings: Sequence[str] | None,
    out: Path | None,
    console: Console,
) -> None:
    """Train, lesion and test models on every task, and report what that says of the paper's claims, or of two arms.

    Args:
        algo: the algorithm of every training.
        profile: "paper", or "released" for the losses and lesions of its released code.
        models: which models; None for all. Several may stand in one word, with commas between.
        study: "paper", or "two_arms".
        tasks: which of the study's tasks; None for all. Several may stand in one word, too.
        seeds: networks of each model, as ``--seeds`` takes them; None for the usual number of them.
        quick: whether it is a preview.
        n_jobs: number of trainings at a time; None for one a CPU.
        ray: address of a Ray cluster; None for this machine.
        overrides: settings of every training, as ``--set`` takes them.
        readings: readings, as ``--readings`` takes them; None for the usual ones.
        out: folder of the study; None for one below ``runs``.
        console: where to print.

    Raises:
        UserError: a study that cannot be made, or not there.
        SystemExit: somebody stopped it.
    """
    began = time.monotonic()
    of = algo, profile, _apart(models), seeds, quick, n_jobs, parse_overrides(overrides), readings, out
    plan = make_plan(*of, study, _apart(tasks))
    with ending_if_stopped(console):
        made = run_plan(plan, ray, console, lambda: _announce(plan, console))
    for note in filter(None, (made.notes, made.unjudged)):
        console.print(f"[yellow]Note:[/yellow] {escape(note)}", highlight=False)
    console.print(_verdicts(made.judgements, WORDS[plan.study.subject].claim))
    if quick:
        console.print("[yellow]A preview: few seeds, short trainings, few trials. No verdict here is a result.")
    for judgement in made.judgements[:_SHOWN]:
        console.print(f"{judgement.reading}: {counts_of(judgement.claims)}", highlight=False)
    console.print(f"{(time.monotonic() - began) / 60:.1f} minutes.", highlight=False)
    print_failures(made.outcomes, console)
    print_unsourced(made.unsourced, console)
    console.print(f"Report: [bold]{_quoted(made.report)}[/bold]", soft_wrap=True, highlight=False)


def _apart(words: Sequence[str] | None) -> list[str] | None:
    """Take words apart at their commas."""
    return None if words is None else [one.strip() for word in words for one in word.split(",")]


def _announce(plan: Plan, console: Console) -> None:
    study = plan.study
    if plan.left_out:
        because = f"they ask for what --algo {study.algo} and --profile {study.profile} leave no room for"
        names = ", ".join(plan.left_out)
        console.print(f"{len(plan.left_out)} readings are left out, as {because}: {names}.", highlight=False)
    console.print(_costs(plan.steps, plan.at_once))
    trainings, networks = len(plan.grid.tables), sum(step.networks for step in plan.steps)
    of = "" if networks == trainings else f", of {networks} networks,"
    begins = f"{trainings} trainings{of} into [bold]{_quoted(plan.folder)}[/bold]"
    console.print(f"{begins}; Ctrl-C stops and saves, the same command goes on.", soft_wrap=True, highlight=False)


def _costs(steps: Sequence[Step], at_once: int) -> Table:
    """What is to be trained and lesioned, and what of it is left to do."""
    minutes = sum(step.seconds for step in steps) / 60
    title = f"Left to do: about {minutes:.0f} core-minutes, {at_once} trainings at a time"
    table = Table(title=title, title_justify="left")
    for column in ("trainings", "networks", "to train", "lesion protocols", "to do", "minutes"):
        table.add_column(column, overflow="fold")
    for step in steps:
        trained, measured = f"{step.to_train}", f"{step.to_measure} of {step.tables}"
        protocols = ", ".join(by_spring(step.protocols))
        table.add_row(step.name, f"{step.networks}", trained, protocols, measured, f"{step.seconds / 60:.0f}")
    return table


def by_spring(names: Sequence[str]) -> list[str]:
    """Return protocols in words that break at spaces: each once, with the springs of its tests (N/m) behind it."""
    springs: dict[str, list[str]] = {}
    for name in names:
        protocol, _, spring = name.partition("-spring-")
        springs.setdefault(protocol, []).extend([spring] if spring else [])
    return [f"{name} (spring {' and '.join(of)} N/m)" if of else name for name, of in springs.items()]


def _verdicts(judgements: Sequence[Judgement], claim: str) -> Table:
    """The verdicts of a few readings side by side; of many, how many have which."""
    few = len(judgements) <= _SHOWN
    columns = [judgement.reading for judgement in judgements] if few else list(_STYLES)
    title = "Verdicts" if few else f"Verdicts: under how many of {len(judgements)} readings"
    table = Table("", claim, *columns, title=title, title_justify="left")
    for claims in zip(*(judgement.claims for judgement in judgements), strict=True):
        verdicts = [claim.verdict for claim in claims]
        if few:
            cells = [f"[{_STYLES[verdict]}]{verdict}" for verdict in verdicts]
        else:
            cells = [f"[{style}]{verdicts.count(verdict)}" for verdict, style in _STYLES.items()]
        table.add_row(claims[0].number, claims[0].statement, *cells)
    return table


def _quoted(path: Path) -> str:
    return escape(shlex.quote(str(path)))
