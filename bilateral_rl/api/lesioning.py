"""Lesion studies of a run: computed, and written beside it if that is asked for."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.api.checks import Names, as_path, check_tests, flag, names
from bilateral_rl.api.progress import ProgressLike, bar, console_of
from bilateral_rl.api.run import Run
from bilateral_rl.config.parse import build
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import lesion_words
from bilateral_rl.runs.folder import FINAL
from bilateral_rl.study.lesion_folder import LesionFolder
from bilateral_rl.study.lesioning import LesionSettings, LesionStudy
from bilateral_rl.vocabulary import TEST_SEED, TEST_TRIALS


@dataclass(frozen=True)
class Lesions:
    """What came of a lesion study."""

    config: TrainConfig
    """Of the run, with the spring of the tests."""
    settings: LesionSettings
    """How the networks were lesioned, retrained and tested."""
    results: pd.DataFrame
    """The long table (:mod:`bilateral_rl.analysis.results`)."""
    replaces_stale: bool = False
    """Whether it was written in the place of a table of weights that the run no longer has."""


def lesion(
    run: Run,
    lesions: Names,
    protocols: Sequence[Protocol],
    *,
    control: bool = True,
    profile: str | None = None,
    spring: float | None = None,
    trials: int = TEST_TRIALS,
    seed: int = TEST_SEED,
    weights: str = FINAL,
    out: str | Path | None = None,
    progress: ProgressLike = False,
    show: Callable[[Lesions], None] = lambda lesions: None,
) -> Lesions:
    """Test a run's networks in every state (:meth:`Run.lesion`).

    Args:
        run: the run.
        lesions: names of the lesions.
        protocols: what follows each of them.
        control: whether fresh networks are treated alike.
        profile: whose combined lesions.
        spring: stiffness of the spring between two hands in retraining and tests (N/m); None for that of the training.
        trials: number of trials of each test.
        seed: seed of the first trial.
        weights: which of the run's weights.
        out: folder of the results; None for none.
        progress: whether, or where, to show how it comes along.
        show: called with the results once they are written, and even if they cannot be.

    Raises:
        UserError: what cannot be lesioned or written; nothing is left then.
    """
    trials, seed = check_tests(trials, seed)
    chosen = names("--lesions", lesions)
    settings = build(
        LesionSettings,
        {
            "lesions": tuple(chosen) if chosen else None,
            "protocols": tuple(protocols),
            "control": flag("--control", control),
            "profile": None if profile is None else str(profile),
            "spring": spring,
            "trials": trials,
            "seed": seed,
        },
    )
    console_of(progress)  # which refuses what is none before anything is computed
    study = LesionStudy(run.folder, settings, run.only, weights)
    if out is None:
        made = Lesions(study.config, settings, _results(study, progress))
        show(made)
        return made
    output = LesionFolder(as_path("--out", out))
    if output == LesionFolder.beside(run.folder, run.only) and output.path.is_symlink():
        raise UserError(f"{output.path} is a link; name where it leads by --out, or remove it.")
    description = output.describe(run.folder, settings, run.only, weights)
    with output.claimed(run.folder, description), contextlib.ExitStack() as at_last:
        made = Lesions(study.config, settings, _results(study, progress), output.holds_stale_results(run.folder))
        at_last.callback(show, made)
        output.write(made.results, description, study.config)
    return made


def _results(study: LesionStudy, progress: ProgressLike) -> pd.DataFrame:
    with bar(progress, "lesioning", len(study.names)) as advance:
        return study.run(lambda done, total, name: advance(done, lesion_words(name) or "done"))
