"""Recordings of a run: everything that moved in trials, kept or written part by part."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from bilateral_rl.analysis import recording_files
from bilateral_rl.analysis.recording import Recording
from bilateral_rl.analysis.recording_of_runs import Recorder
from bilateral_rl.api.checks import Names, check_tests, names
from bilateral_rl.api.progress import ProgressLike, bar
from bilateral_rl.api.run import Run
from bilateral_rl.config.parse import Values
from bilateral_rl.config.tasks import TaskWords
from bilateral_rl.policies.lesions import INTACT


def recorder_of(
    run: Run, trials: int, seed: int, lesions: Names, task: TaskWords | None, settings: Values, weights: str
) -> Recorder:
    """Return what records trials of a run (:meth:`Run.record`). Raises UserError for what cannot be recorded so."""
    trials, seed = check_tests(trials, seed)
    return Recorder.of_run(
        run.folder,
        run.only,
        trials=trials,
        seed=seed,
        lesions=names("--lesion", lesions) or [INTACT],
        task=task,
        settings=settings,
        weights=weights,
    )


def record_to(
    path: Path,
    run: Run,
    trials: int,
    seed: int,
    lesions: Names,
    task: TaskWords | None,
    settings: Values,
    weights: str,
    progress: ProgressLike,
) -> Recorder:
    """Write a recording (:meth:`Run.record_to`), and return what recorded it.

    Raises:
        UserError: what cannot be recorded so, or a file that cannot be written; none is left then.
    """
    check_tests(trials, seed)
    recording_files.check_path(path)
    recorder = recorder_of(run, trials, seed, lesions, task, settings, weights)
    recording_files.write(path, parts_of(recorder, progress), recorder.total)
    return recorder


def parts_of(recorder: Recorder, progress: ProgressLike) -> Iterator[Recording]:
    """Yield the parts of a recording, with a bar that counts trials."""
    with bar(progress, "recording", recorder.total) as advance:
        done = 0
        for part in recorder.parts():
            yield part
            done += len(part)
            advance(done, "")
