"""The job of one training of a study: train, then measure, lesions included; called again, it goes on."""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from bilateral_rl.config.code_tasks import allow_code
from bilateral_rl.config.parse import Values, build, plain
from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import RLConfig, TrainConfig
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.files import replacing
from bilateral_rl.policies.lesions import lesion_words
from bilateral_rl.runs.folder import FAILED, FINAL, FINISHED, RunFolder
from bilateral_rl.study.folder import MACHINE_SETTINGS
from bilateral_rl.study.jobs import JobProgress
from bilateral_rl.study.lesioning import LesionSettings, LesionStudy
from bilateral_rl.study.provenance import describe_source, source_file
from bilateral_rl.training import checkpoint
from bilateral_rl.training import run as training
from bilateral_rl.training.progress import Outcome, Progress

_TABLE_SHARE = 0.2
"""What a table of results takes against the training, roughly, for the progress bar."""


def train_and_measure(
    folder: Path,
    progress: JobProgress,
    config: Values,
    tables: Sequence[Mapping[str, Any]],
    runs: str,
    known_runs: str | None = None,
    code: Sequence[str] = (),
) -> None:
    """Train, unless that is done, and write tables of results (:mod:`bilateral_rl.analysis.results`).

    Args:
        folder: of the study.
        progress: called with how far the job is.
        config: settings of the training.
        tables: each a dictionary with ``result``, the file in ``folder`` that takes the table, and ``lesions``, fields
            of :class:`~bilateral_rl.study.lesioning.LesionSettings`. What a table is of is written beside it.
        runs: the folder in ``folder`` that takes the run.
        known_runs: the folder in ``folder`` below which a run of the same settings is taken instead; None for ``runs``.
        code: classes of tasks that the user has named to whoever began the study, so that the job may import them.

    Raises:
        UserError: a training that failed.
        KeyboardInterrupt: somebody stopped the training; it is saved.
    """
    allow_code(code)
    resolved = resolve(None, None, [config])
    training_share = 1 / (1 + _TABLE_SHARE * len(tables))
    known = folder / (runs if known_runs is None else known_runs)
    run = _trained_run(folder / runs, known, resolved, lambda done, text: progress(training_share * done, text))
    machine = {"threads": resolved.threads, "device": resolved.device}
    for i, table in enumerate(tables):

        def on_state(done: int, total: int, name: str, before: int = i) -> None:
            share = (before + done / total) / len(tables)
            text = f"testing: {lesion_words(name)}" if name else "tested"
            progress(training_share + (1 - training_share) * share, text)

        settings = build(LesionSettings, machine | table["lesions"])
        _write(LesionStudy(run, settings).run(on_state), run, settings, folder / table["result"])


def _write(results: pd.DataFrame, run: RunFolder, settings: LesionSettings, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    source = describe_source(run, FINAL, path.parent) | dataclasses.asdict(settings)
    RunFolder(path.parent).write_json(source_file(path).name, plain(source))
    with replacing(path) as temporary:  # last: its presence says that it is done
        results.to_csv(temporary, index=False)


def find_run(runs: Path, config: TrainConfig) -> RunFolder | None:
    """Find the run of ``config`` below ``runs``, at whatever depth and for whatever machine it was made.

    It is told by its settings: another run of the same model, which somebody trained on, may lie beside it.
    """
    folders = runs.glob(f"**/{config.task_folder}/{config.model}-{config.algo}-*/config.yaml")
    matching = (run for path in sorted(folders) if is_run_of(run := RunFolder(path.parent), config))
    return next(matching, None)


def is_run_of(run: RunFolder, config: TrainConfig) -> bool:
    """Whether a run was made by these settings, for whatever machine; not if its configuration is damaged.

    One that an earlier version made, whose updates did something else by the same settings, was not.
    """
    try:
        stored = run.config().to_values()
    except UserError:
        return False
    requested = config.to_values()
    same = all(stored.get(name) == requested[name] for name in requested if name not in MACHINE_SETTINGS)
    return same and not (isinstance(config, RLConfig) and _goes_by_other_rules(run))


def _goes_by_other_rules(run: RunFolder) -> bool:
    try:
        return run.is_saved and checkpoint.goes_by_other_rules(run.load_resume(only=[checkpoint.RULES]))
    except UserError:  # whoever goes on with it says what is damaged
        return False


def _trained_run(runs: Path, known: Path, config: TrainConfig, progress: JobProgress) -> RunFolder:
    """The finished run: as it is, resumed, or made now. Raises UserError if it failed."""
    run = find_run(known, config)
    state = run.status().get("state") if run else None
    if run and state == FINISHED:
        return run
    if run and state == FAILED:
        raise UserError(f"The training {run.path} failed before; remove that folder to try again.")
    watch = _Watch(config, progress)
    # The jobs of a study fill the cores: seeds that are one job train one after the other.
    if run and run.is_saved:
        return _finished(training.resume(run, config, watch, at_once=1))
    if run:
        with run.locked():  # not while another process has just begun to train there
            shutil.rmtree(run.path)
    return _finished(training.train(config, runs, watch, at_once=1))


def _finished(outcome: Outcome) -> RunFolder:
    if outcome.interrupted:
        raise KeyboardInterrupt
    return outcome.folder


class _Watch(Progress):
    """Passes a training's progress on to the job's."""

    def __init__(self, config: TrainConfig, progress: JobProgress) -> None:
        self._total, self._progress = config.total, progress
        self._text = "training"

    def on_start(self, done: int) -> None:
        self.on_step(done)

    def on_step(self, done: int) -> None:
        self._progress(done / self._total, self._text)

    def on_evaluation(self, done: int, measures: dict[str, float]) -> None:
        training = f"{measures['seeds_training']:.0f} seeds, " if "seeds_training" in measures else ""
        self._text = f"training: {training}goal {measures['goal_completion_percent']:.0f} %"
        self.on_step(done)
