"""`bilateral-rl lesion`."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress

from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.commands.checks import check_trials
from bilateral_rl.commands.lesion_tables import print_lesions
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import lesion_words
from bilateral_rl.runs.policies import parse_run
from bilateral_rl.study.lesion_folder import RESULTS, LesionFolder, lesion_metrics
from bilateral_rl.study.lesioning import LesionSettings, LesionStudy


def lesion(
    *,
    run: str,
    lesions: Sequence[str] | None,
    protocols: Sequence[Protocol],
    control: bool,
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
        protocols: what follows each lesion; each state is tested once per protocol.
        control: whether fresh networks are treated alike.
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
        protocols=tuple(protocols),
        control=control,
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
            title = f"{run} ({weights}), {trials} trials of seed {seed}"
            console.print(f"[italic]{escape(title)}", soft_wrap=True, highlight=False)
            print_lesions(results, lesion_metrics(study.config), console)
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
