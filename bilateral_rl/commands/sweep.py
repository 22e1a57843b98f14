"""`bilateral-rl sweep`."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from bilateral_rl.analysis.formats import mean_sd
from bilateral_rl.analysis.metric import Metric
from bilateral_rl.analysis.metrics import find_metric, preferred_by_hand, preferred_metric
from bilateral_rl.api.sweeping import RESULTS, nothing_done, run_sweep
from bilateral_rl.commands.jobs import ending_if_stopped, print_failures, print_unsourced
from bilateral_rl.config.parse import parse_overrides
from bilateral_rl.figures.labels import with_unit
from bilateral_rl.study.sweep import Sweep, parse_grid, point_name


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
    chosen = [find_metric(name) for name in metrics or []]
    folder = out or Path("runs") / "sweep"
    with ending_if_stopped(console):
        swept = run_sweep(
            algo, parse_grid(grid), seeds, parse_overrides(overrides), chosen, trials, n_jobs, ray, folder, console
        )
    print_failures(swept.outcomes, console)
    if swept.results.empty:
        raise nothing_done(folder)
    console.print(_table(swept.study, swept.results, chosen))
    print_unsourced(swept.unsourced, console)
    path = escape(shlex.quote(str(folder / RESULTS)))
    console.print(f"Every metric of every seed: [bold]{path}[/bold]", soft_wrap=True, highlight=False)


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
        task, radius = config.make_task(), config.trial.threshold
        names |= dict.fromkeys([preferred_metric(task, radius), *preferred_by_hand(task, radius)])
    return [find_metric(name) for name in [*names, "final_error"]]
