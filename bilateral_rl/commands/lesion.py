"""`bilateral-rl lesion`."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress
from rich.table import Table

from bilateral_rl.analysis.formats import mean_sd
from bilateral_rl.analysis.protocols import DEFAULT_PROTOCOLS, Protocol
from bilateral_rl.analysis.results import State, by_seed, protocol_words
from bilateral_rl.analysis.specialization import ALONE, specialization_by_seed
from bilateral_rl.commands.checks import check_trials
from bilateral_rl.figures.labels import with_unit
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import lesion_words
from bilateral_rl.runs.policies import parse_run
from bilateral_rl.study.lesion_folder import RESULTS, LesionFolder, lesion_metrics
from bilateral_rl.study.lesioning import LesionSettings, LesionStudy


def lesion(
    *,
    run: str,
    lesions: Sequence[str] | None,
    retrain: bool,
    profile: str | None,
    trials: int,
    seed: int,
    weights: str,
    out: Path | None,
    console: Console,
) -> None:
    """Test a run's networks intact and lesioned; write beside the run, and print, what they do.

    Args:
        run: RUN, or RUN:SEED for one network of it.
        lesions: their names; None for all that the model can have.
        retrain: whether networks also adapt to each state.
        profile: whose combined lesions: "paper" or "released"; None for the run's profile.
        trials: number of trials of each test.
        seed: seed of the first trial.
        weights: which of the run's weights.
        out: folder of the results; None for the one beside the run.
        console: where to print.

    Raises:
        UserError: what cannot be lesioned or written; nothing is left then.
    """
    check_trials(trials, seed)
    folder, only = parse_run(run)
    settings = LesionSettings(
        lesions=tuple(lesions) if lesions else None,
        protocols=DEFAULT_PROTOCOLS if retrain else (Protocol("none"),),
        profile=profile,
        trials=trials,
        seed=seed,
    )
    study = LesionStudy(folder, settings, only, weights)
    output = LesionFolder(out) if out else LesionFolder.beside(folder, only)
    if out is None and output.path.is_symlink():
        raise UserError(f"{output.path} is a link; name where it leads by --out, or remove it.")
    description = output.describe(folder, settings, only, weights)
    with output.claimed(folder, description):
        replaces_stale = output.holds_stale_results(folder)
        results = _with_progress(study, console)
        try:
            output.write(results, description, study.config)
        finally:
            _print(results, study, f"{run} ({weights}), {trials} trials of seed {seed}", console)
    if replaces_stale:
        console.print("[yellow]Note:[/yellow] these take the place of lesions of weights that the run no longer has.")
    path = escape(shlex.quote(str(output.path)))
    console.print(f"Saved in [bold]{path}[/bold]: {RESULTS}, figures and tensorboard.", soft_wrap=True, highlight=False)


def _with_progress(study: LesionStudy, console: Console) -> pd.DataFrame:
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task("lesioning", total=len(study.names))

        def on_state(done: int, total: int, name: str) -> None:
            progress.update(task, completed=done, description=lesion_words(name) or "done")

        return study.run(on_state)


def _print(results: pd.DataFrame, study: LesionStudy, title: str, console: Console) -> None:
    console.print(f"[italic]{escape(title)}", soft_wrap=True, highlight=False)
    console.print(_table(results, study))
    if index := _specialization(results, study):
        console.print(index, highlight=False)


def _table(results: pd.DataFrame, study: LesionStudy) -> Table:
    """Mean ± standard deviation over the seeds, a row a state, below each metric."""
    table = Table("lesion")
    table.columns[0].no_wrap = True  # the others' heads can be wrapped
    for protocol in _protocols(study):
        table.add_column(protocol_words(protocol), justify="right")
    for metric in lesion_metrics(study.config):
        table.add_section()
        table.add_row(f"[bold]{with_unit(metric)}")
        for name in study.names:
            states = [State(study.config.task, study.config.model, name, protocol) for protocol in _protocols(study)]
            values = [mean_sd(by_seed(results, metric.name, state), 1) for state in states]
            table.add_row(lesion_words(name), *values)
    if (seeds := results["seed"].nunique()) > 1:
        table.caption = f"mean ± standard deviation over {seeds} seeds"
    return table


def _specialization(results: pd.DataFrame, study: LesionStudy) -> str:
    """The specialization index in words; empty unless both sides were lesioned."""
    if not set(ALONE.values()) <= set(study.names):
        return ""
    metric, parts = lesion_metrics(study.config)[0], []
    for protocol in _protocols(study):
        state = State(study.config.task, study.config.model, protocol=protocol)
        index = specialization_by_seed(results, metric.name, state)
        parts.append(f"{mean_sd(index, 3, '+')} {protocol_words(protocol)}")
    return f"Specialization index: {', '.join(parts)} (above 0: the dominant side does more alone)."


def _protocols(study: LesionStudy) -> list[str]:
    return [protocol.name for protocol in study.settings.protocols]
