"""Trainings over a grid of settings."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from bilateral_rl.analysis.metric import Metric
from bilateral_rl.api.checks import SeedsLike, as_path, check_tests, seeds_text, settings_by_name, whole
from bilateral_rl.api.jobs import notes_on, run_jobs
from bilateral_rl.api.notes import tell
from bilateral_rl.api.progress import ProgressLike
from bilateral_rl.api.wording import in_python
from bilateral_rl.config.code_tasks import allow_code
from bilateral_rl.config.parse import Values, plain
from bilateral_rl.config.seeds import parse_seeds
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.files import replacing
from bilateral_rl.study.folder import claimed_folder
from bilateral_rl.study.jobs import JobOutcome
from bilateral_rl.study.lesioning import measured_metrics
from bilateral_rl.study.outcome import unsourced
from bilateral_rl.study.plan import side_by_side
from bilateral_rl.study.sweep import Sweep, read_sweep
from bilateral_rl.vocabulary import TEST_TRIALS

RESULTS = "sweep.csv"
"""The table of all results in a sweep's folder."""


@dataclass(frozen=True)
class Swept:
    """What came of a sweep."""

    study: Sweep
    """The sweep."""
    folder: Path
    """Its folder."""
    outcomes: Sequence[JobOutcome]
    """How its trainings ended."""
    results: pd.DataFrame
    """The long table of those that are done; empty if none is."""

    @property
    def unsourced(self) -> list[Path]:
        """The results that do not say which weights they are of."""
        return unsourced(self.folder / job.result for job in self.study.jobs())


@in_python
def sweep(
    grid: Mapping[str, Iterable[Any]],
    algo: str = "bptt",
    *,
    seeds: SeedsLike = None,
    settings: Mapping[str, Any] | None = None,
    trials: int = TEST_TRIALS,
    jobs: int | None = None,
    ray: str | None = None,
    out: str | Path = "runs/sweep",
    progress: ProgressLike = True,
) -> pd.DataFrame:
    """Train at every point of a grid of settings, test the networks, and return what came out.

    Called again, it goes on where it was. A training that fails stops no other, and is a warning.

    Args:
        grid: the values of each setting, such as ``{"model": ["bi_s", "cc_s"], "bptt.patience": [2, 5]}``.
        algo: "bptt", "ppo", "a2c", "sac" or "td3".
        seeds: networks at each point: how many, of seeds 0 and up; or which, as ``range(100, 130)``. None for one, or
            for what ``settings`` say.
        settings: settings of every training, such as ``{"bptt.learning_rate": 0.01}``.
        trials: number of trials of each test.
        jobs: trainings at a time; None for one a CPU.
        ray: address of a Ray cluster, or "local"; None for this machine without Ray.
        out: folder of the sweep.
        progress: whether bars show how it comes along, or the rich console where they do.

    Returns:
        A row a value: ``model``, ``task``, ``algo``, ``seed``, ``lesion`` ("intact"), ``metric``, ``value`` (the mean
        over a network's trials in the metric's unit), ``point``, and a column for each setting of the grid. It is in
        ``sweep.csv`` too.

    Raises:
        UserError: a sweep that cannot be made, or not there, or of which nothing is done.
        Stopped: somebody interrupted it.
    """
    points = grid_texts(grid)
    fixed = settings_by_name("--set", settings)
    swept = run_sweep(algo, points, seeds_text(seeds), fixed, [], trials, jobs, ray, as_path("--out", out), progress)
    tell(notes_on(swept.outcomes, swept.unsourced))
    if swept.results.empty:
        raise nothing_done(swept.folder)
    return swept.results


def run_sweep(
    algo: str,
    grid: Mapping[str, Sequence[str]],
    seeds: str | None,
    settings: Values,
    metrics: Sequence[Metric],
    trials: int,
    n_jobs: int | None,
    ray: str | None,
    folder: Path,
    progress: ProgressLike,
) -> Swept:
    """Make a sweep, as far as it can be made, and write its table.

    Args:
        algo: the algorithm of every training.
        grid: values of each setting, as ``--grid`` takes them.
        seeds: networks at each point, as ``--seeds`` takes them.
        settings: of every training, as nested dictionaries.
        metrics: what somebody wants to see of it.
        trials: number of trials of each test.
        n_jobs: number of trainings at a time; None for one a CPU.
        ray: address of a Ray cluster; None for this machine.
        folder: of the sweep.
        progress: whether, or where, to show how it comes along.

    Raises:
        UserError: a sweep that cannot be made, or not there, or a metric that nothing in it is measured by.
        Stopped: somebody interrupted it.
    """
    trials, _ = check_tests(trials)
    allow_code([*grid.get("task", ()), settings.get("task")])
    study = Sweep(algo, grid, settings | _seed_settings(seeds, {*grid, *settings}), trials)
    n_jobs = None if n_jobs is None else whole("--jobs", n_jobs, least=1)
    at_once, threads = side_by_side(n_jobs, len(study.points()), algo)
    jobs = study.jobs(threads)
    _check_measured(study, metrics)
    with claimed_folder(folder, study.to_values()):
        outcomes = run_jobs(jobs, folder, title="sweep", at_once=at_once, ray=ray, progress=progress)
    results = read_sweep(study, folder)
    if not results.empty:
        with replacing(folder / RESULTS) as temporary:
            results.to_csv(temporary, index=False)
    return Swept(study, folder, outcomes, results)


def nothing_done(folder: Path) -> UserError:
    """Return the error of a sweep without results."""
    return UserError(f"No training of the sweep is done; the logs are in {folder / 'logs'}.")


def grid_texts(grid: Mapping[str, Iterable[Any]]) -> dict[str, list[str]]:
    """Return the values of each setting as ``--set`` takes them. Raises UserError for what is no grid."""
    if not isinstance(grid, Mapping) or not all(
        isinstance(values, Iterable) and not isinstance(values, (str, Mapping)) for values in grid.values()
    ):
        raise UserError(
            f'--grid takes values by setting, such as {{"bptt.penalty": ["weights", "activity"]}}, not {grid}.'
        )
    return {str(name): [_text(value) for value in values] for name, values in grid.items()}


def _text(value: Any) -> str:
    """Write one value as YAML, on one line."""
    if isinstance(value, str):
        return value
    try:
        return yaml.safe_dump(plain(value), default_flow_style=True, width=10**6).removesuffix("...\n").strip()
    except yaml.YAMLError:
        raise UserError(f"--grid takes numbers, words and lists of them, not {value!r}.") from None


def _seed_settings(seeds: str | None, named: Collection[str]) -> Values:
    """Return what ``--seeds`` comes to. Raises UserError for seeds that ``named``, the settings given, name too."""
    if seeds is None:
        return {}
    if "seeds" in named:
        raise UserError("--seeds says how many networks there are at each point: leave seeds out of --set and --grid.")
    return parse_seeds(seeds, "seed in --set or --grid" if "seed" in named else "").settings


def _check_measured(study: Sweep, metrics: Sequence[Metric]) -> None:
    """Raise a UserError for a metric that no training of the sweep is measured by."""
    measured = {metric.name: None for point in study.points() for metric in measured_metrics(study.config(point))}
    for metric in metrics:
        if metric.name not in measured:
            raise UserError(
                f"No training of the sweep is measured by {metric.name}; choose from {', '.join(measured)}."
            )
