"""`bilateral-rl lesion`."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import shlex
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress
from rich.table import Table
from torch.utils.tensorboard import SummaryWriter

from bilateral_rl.analysis.formats import mean_sd
from bilateral_rl.analysis.metrics import Metric, find_metric, preferred_metric
from bilateral_rl.analysis.results import RETRAINING, State, by_seed
from bilateral_rl.analysis.specialization import ALONE, specialization_by_seed
from bilateral_rl.commands.checks import check_trials
from bilateral_rl.config.parse import plain
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.figures.labels import with_unit
from bilateral_rl.figures.lesions import lesion_effects
from bilateral_rl.figures.saving import save
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.files import refuse_traps, replacing
from bilateral_rl.policies.lesions import lesion_words
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import parse_run
from bilateral_rl.study.lesioning import LesionSettings, LesionStudy

RESULTS, SETTINGS = "lesions.csv", "settings.json"
_SHOWN = ("final_error",)
"""Metrics on the screen, beside the task's preferred one."""


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
    """Test a run's networks intact and lesioned; print, and write beside the run, what they do."""
    check_trials(trials, seed)
    folder, only = parse_run(run)
    settings = LesionSettings(tuple(lesions) if lesions else None, retrain, profile, trials, seed)
    study = LesionStudy(folder, settings, only, weights)
    place = out or default_place(folder, only)
    asked = plain({"run": str(folder.path.resolve()), "weights": weights, **dataclasses.asdict(settings)})
    if out is None and place.is_symlink():
        raise UserError(f"{place} is a link; name where it leads by --out, or remove it.")
    with _claimed(place, folder, asked):
        results = _with_progress(study, console)
    title = escape(f"{run} ({weights}), {trials} trials of seed {seed}")
    console.print(f"[italic]{title}", soft_wrap=True, highlight=False)
    console.print(_table(results, study))
    if index := _specialization(results, study):
        console.print(index, highlight=False)
    _write(results, study.config, place, asked)
    shown = escape(shlex.quote(str(place)))
    console.print(
        f"Saved in [bold]{shown}[/bold]: {RESULTS}, figures and tensorboard.", soft_wrap=True, highlight=False
    )


def default_place(folder: RunFolder, only: int | None) -> Path:
    """Beside the run, or the one seed of it."""
    seed = "" if only is None else f"-seed-{only}"
    path = folder.path.resolve()
    return path.with_name(f"{path.name}{seed}-lesions")


@contextlib.contextmanager
def _claimed(place: Path, folder: RunFolder, asked: Mapping[str, Any]) -> Iterator[None]:
    """A context in which ``place`` is there to write into; if anything fails, nothing is left of it.

    Raises:
        UserError: other files could be harmed there, or none be written.
    """
    is_new = not place.exists()
    try:
        _check_place(place, folder, asked)
        yield
    except BaseException:
        if is_new:
            with contextlib.suppress(OSError):
                place.rmdir()
        raise


def _check_place(place: Path, folder: RunFolder, asked: Mapping[str, Any]) -> None:
    if place.resolve().is_relative_to(folder.path.resolve()):
        raise UserError(f"{place} lies in the run, which stays as it is; choose another --out.")
    try:
        place.mkdir(parents=True, exist_ok=True)
        refuse_traps(place)
        if any(place.iterdir()) and not (place / RESULTS).is_file():
            raise UserError(f"{place} holds other things than an earlier {RESULTS}; choose another --out.")
        if RunFolder(place).read_json(SETTINGS, default=asked) != asked:
            raise UserError(f"{place} holds lesions made with other settings; choose another --out, or remove it.")
        with tempfile.TemporaryFile(dir=place):
            pass
    except OSError as error:
        raise UserError(f"Cannot write {place}: {error.strerror}. Choose another --out.") from None


def _with_progress(study: LesionStudy, console: Console) -> pd.DataFrame:
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task("lesioning", total=len(study.names))

        def on_state(done: int, total: int, name: str) -> None:
            progress.update(task, completed=done, description=lesion_words(name) or "done")

        return study.run(on_state)


def _metrics(config: TrainConfig) -> list[Metric]:
    return [find_metric(name) for name in (preferred_metric(config.task, config.trial.threshold), *_SHOWN)]


def _table(results: pd.DataFrame, study: LesionStudy) -> Table:
    """Mean ± standard deviation over the seeds, a row a state, below each metric."""
    table = Table("lesion")
    for retrained in _treatments(study):
        table.add_column(RETRAINING[retrained], justify="right")
    for metric in _metrics(study.config):
        table.add_section()
        table.add_row(f"[bold]{with_unit(metric)}")
        for name in study.names:
            states = [State(study.config.task, study.config.model, name, again) for again in _treatments(study)]
            values = [mean_sd(by_seed(results, metric.name, state), 1) for state in states]
            table.add_row(lesion_words(name), *values)
    if (seeds := results["seed"].nunique()) > 1:
        table.caption = f"mean ± standard deviation over {seeds} seeds"
    return table


def _specialization(results: pd.DataFrame, study: LesionStudy) -> str:
    """The specialization index in words; empty unless both sides were lesioned."""
    if not set(ALONE.values()) <= set(study.names):
        return ""
    metric, parts = _metrics(study.config)[0], []
    for retrained in _treatments(study):
        state = State(study.config.task, study.config.model, retrained=retrained)
        index = specialization_by_seed(results, metric.name, state)
        parts.append(f"{mean_sd(index, 3, '+')} {RETRAINING[retrained]}")
    return f"Specialization index: {', '.join(parts)} (above 0: the dominant side does more alone)."


def _treatments(study: LesionStudy) -> tuple[bool, ...]:
    return (False, True) if study.settings.retrain else (False,)


def _write(results: pd.DataFrame, config: TrainConfig, place: Path, asked: Mapping[str, Any]) -> None:
    for pattern in ("events.out.tfevents.*", "lesions_*.png", "lesions_*.pdf"):
        for old in place.glob(pattern):
            old.unlink()
    with replacing(place / RESULTS) as temporary:
        results.to_csv(temporary, index=False)
    with replacing(place / SETTINGS) as temporary:
        temporary.write_text(json.dumps(asked, indent=2) + "\n", encoding="utf-8")
    for metric in _metrics(config):
        save(lesion_effects(results, config.task, metric, [config.model]), place / f"lesions_{metric.name}")
    with SummaryWriter(str(place)) as board:
        means = results.groupby(["metric", "lesion", "retrained"], sort=False)["value"].mean().reset_index()
        for row in means.to_dict("records"):
            # Along the x axis: epochs of retraining.
            board.add_scalar(f"lesions_{row['metric']}/{row['lesion']}", row["value"], int(row["retrained"]))
