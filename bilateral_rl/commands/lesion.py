"""`bilateral-rl lesion`."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress
from rich.table import Table
from torch.utils.tensorboard import SummaryWriter

from bilateral_rl.analysis.lesioning import LesionSettings, LesionStudy
from bilateral_rl.analysis.metrics import Metric, find_metric, preferred_metric, specialization_index
from bilateral_rl.analysis.results import by_seed
from bilateral_rl.config import TrainConfig
from bilateral_rl.controllers import parse_run
from bilateral_rl.errors import UserError
from bilateral_rl.figures.lesions import lesion_effects
from bilateral_rl.figures.saving import save
from bilateral_rl.run_folder import RunFolder, replacing

RESULTS = "lesions.csv"
_SHOWN = ("final_error",)
"""Metrics on the screen, beside the task's preferred one."""


def lesion(
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
    """Test a run's networks intact and lesioned; print, and write beside the run, what they do."""
    if trials < 1 or seed < 0:
        raise UserError(f"--trials must be at least 1 and --seed at least 0, got {trials} and {seed}.")
    folder, only = parse_run(run)
    settings = LesionSettings(tuple(lesions) if lesions else None, retrain, profile, trials, seed)
    study = LesionStudy(folder, settings, only, weights)
    place = out or default_place(folder, only)
    _check_place(place, folder)
    results = _with_progress(study, console)
    console.print(_table(results, study, f"{run} ({weights}), {trials} trials of seed {seed}"))
    _write(results, study.config, place)
    shown = escape(shlex.quote(str(place)))
    console.print(
        f"Saved in [bold]{shown}[/bold]: {RESULTS}, figures and tensorboard.", soft_wrap=True, highlight=False
    )


def default_place(folder: RunFolder, only: int | None) -> Path:
    """Beside the run, or the one seed of it."""
    seed = "" if only is None else f"-seed-{only}"
    path = folder.path.resolve()
    return path.with_name(f"{path.name}{seed}-lesions")


def _check_place(place: Path, folder: RunFolder) -> None:
    """Raise a UserError where other files could be harmed."""
    if place.resolve().is_relative_to(folder.path.resolve()):
        raise UserError(f"{place} lies in the run, which stays as it is; choose another --out.")
    try:
        place.mkdir(parents=True, exist_ok=True)
        if any(place.iterdir()) and not (place / RESULTS).is_file():
            raise UserError(f"{place} holds other things than an earlier {RESULTS}; choose another --out.")
    except OSError as error:
        raise UserError(f"Cannot write {place}: {error.strerror}. Choose another --out.") from None


def _with_progress(study: LesionStudy, console: Console) -> pd.DataFrame:
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task("lesioning", total=len(study.names))

        def on_state(done: int, total: int, name: str) -> None:
            progress.update(task, completed=done, description=name.replace("_", " ") or "done")

        return study.run(on_state)


def _metrics(config: TrainConfig) -> list[Metric]:
    return [find_metric(name) for name in (preferred_metric(config.task, config.trial.threshold), *_SHOWN)]


def _table(results: pd.DataFrame, study: LesionStudy, title: str) -> Table:
    """Mean ± standard deviation over the seeds, a row a state."""
    metrics = _metrics(study.config)
    table = Table("lesion", title=escape(title), title_justify="left")
    for metric in metrics:
        table.add_column(f"{metric.label} ({metric.unit})", justify="right")
        if study.settings.retrain:
            table.add_column("retrained", justify="right")
    for name in study.names:
        table.add_row(name.replace("_", " "), *_cells(results, study, metrics, name))
    table.caption = _caption(results, study, metrics[0])
    return table


def _cells(results: pd.DataFrame, study: LesionStudy, metrics: Sequence[Metric], lesion: str) -> list[str]:
    task, model = study.config.task, study.config.model
    states = (False, True) if study.settings.retrain else (False,)
    return [_spread(by_seed(results, metric.name, task, model, lesion, r)) for metric in metrics for r in states]


def _spread(values: pd.Series) -> str:
    mean = f"{values.mean():.1f}"
    return mean if len(values) == 1 else f"{mean} ± {values.std(ddof=1):.1f}"


def _caption(results: pd.DataFrame, study: LesionStudy, metric: Metric) -> str:
    """The specialization index, where both sides were lesioned."""
    task, model = study.config.task, study.config.model
    parts = []
    for retrained, words in ((False, "without"), (True, "with")):
        alone = [
            by_seed(results, metric.name, task, model, lesion, retrained)
            for lesion in ("deep_non_dominant", "deep_dominant")
        ]
        if min(len(values) for values in alone):
            index = specialization_index(*(values.to_numpy() for values in alone))
            parts.append(f"{np.nanmean(index):+.3f} {words} retraining")
    seeds = f"mean ± standard deviation over {results['seed'].nunique()} seeds" if results["seed"].nunique() > 1 else ""
    index_text = (
        f"specialization index {', '.join(parts)} (above 0: the dominant side does more alone)" if parts else ""
    )
    return "; ".join(text for text in (index_text, seeds) if text)


def _write(results: pd.DataFrame, config: TrainConfig, place: Path) -> None:
    metrics = _metrics(config)
    with replacing(place / RESULTS) as temporary:
        results.to_csv(temporary, index=False)
    for metric in metrics:
        save(lesion_effects(results, config.task, metric, [config.model]), place / f"lesions_{metric.name}")
    for old in place.glob("events.out.tfevents.*"):
        old.unlink()
    with SummaryWriter(str(place)) as board:
        means = results.groupby(["metric", "lesion", "retrained"], sort=False)["value"].mean().reset_index()
        for row in means.to_dict("records"):
            # Along the x axis: epochs of retraining.
            board.add_scalar(f"lesions_{row['metric']}/{row['lesion']}", row["value"], int(row["retrained"]))
