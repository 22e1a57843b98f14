"""`bilateral-rl sweep`."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Sequence
from pathlib import Path

import pandas as pd
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from bilateral_rl.analysis.formats import mean_sd
from bilateral_rl.analysis.metrics import Metric, find_metric, preferred_metric
from bilateral_rl.commands.checks import check_trials
from bilateral_rl.commands.jobs import print_failures, print_unsourced, run_jobs
from bilateral_rl.config import parse as settings
from bilateral_rl.config.seeds import parse_seeds
from bilateral_rl.figures.labels import with_unit
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.files import replacing
from bilateral_rl.study.folder import claimed_folder
from bilateral_rl.study.lesioning import measured_metrics
from bilateral_rl.study.outcome import unsourced
from bilateral_rl.study.plan import side_by_side
from bilateral_rl.study.sweep import Sweep, parse_grid, point_name, read_sweep


def sweep(
    *,
    algo: str,
    grid: Sequence[str],
    seeds: str | None,
    overrides: Sequence[str],
    metrics: Sequence[str] | None,
    trials: int,
    n_jobs: int | None,
    ray: str | None,
    out: Path | None,
    console: Console,
) -> None:
    """Train at every point of a grid, and print what came out, a row a point.

    Args:
        algo: the algorithm of every training.
        grid: settings with their values, as ``--grid`` takes them.
        seeds: networks at each point, as ``--seeds`` takes them; None for one, or for what the settings say.
        overrides: settings of every training, as ``--set`` takes them.
        metrics: names of the metrics to print; None for each task's preferred one and the final error.
        trials: number of trials of each test.
        n_jobs: number of trainings at a time; None for one a CPU.
        ray: address of a Ray cluster; None for this machine.
        out: folder of the sweep; None for ``runs/sweep``.
        console: where to print.

    Raises:
        UserError: a sweep that cannot be made, or not there, or of which nothing is done.
        SystemExit: somebody stopped it.
    """
    check_trials(trials)
    requested_metrics = [find_metric(name) for name in metrics or []]
    points, fixed = parse_grid(grid), settings.parse_overrides(overrides)
    study = Sweep(algo, points, fixed | _seed_settings(seeds, {*points, *fixed}), trials)
    at_once, threads = side_by_side(n_jobs, len(study.points()), algo)
    jobs = study.jobs(threads)
    _check_measured(study, requested_metrics)
    folder = out or Path("runs") / "sweep"
    with claimed_folder(folder, study.to_values()):
        outcomes = run_jobs(jobs, folder, title="sweep", at_once=at_once, ray=ray, console=console)
    results = read_sweep(study, folder)
    if not results.empty:
        with replacing(folder / "sweep.csv") as temporary:
            results.to_csv(temporary, index=False)
    print_failures(outcomes, console)
    if results.empty:
        raise UserError(f"No training of the sweep is done; the logs are in {folder / 'logs'}.")
    console.print(_table(study, results, requested_metrics))
    print_unsourced(unsourced(folder / job.result for job in jobs), console)
    path = escape(shlex.quote(str(folder / "sweep.csv")))
    console.print(f"Every metric of every seed: [bold]{path}[/bold]", soft_wrap=True, highlight=False)


def _seed_settings(seeds: str | None, named: Collection[str]) -> settings.Values:
    """What ``--seeds`` comes to. Raises UserError for seeds that ``named``, the settings given, name too."""
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


def _table(study: Sweep, results: pd.DataFrame, metrics: Sequence[Metric]) -> Table:
    """Mean ± standard deviation over the seeds, a row a point."""
    metrics = list(metrics) or _preferred(study)
    table = Table(*(name.rpartition(".")[2] for name in study.grid), title="Sweep", title_justify="left")
    for metric in metrics:
        table.add_column(with_unit(metric), justify="right")
    table.add_column("seeds", justify="right")
    for point in study.points():
        rows = results[results["point"] == point_name(point)]
        if len(rows):
            cells = [mean_sd(rows.loc[rows["metric"] == metric.name, "value"]) for metric in metrics]
            table.add_row(*map(escape, point.values()), *cells, str(rows["seed"].nunique()))
    return table


def _preferred(study: Sweep) -> list[Metric]:
    names: dict[str, None] = {}
    for point in study.points():
        config = study.config(point)
        names[preferred_metric(config.task, config.trial.threshold)] = None
    return [find_metric(name) for name in [*names, "final_error"]]
