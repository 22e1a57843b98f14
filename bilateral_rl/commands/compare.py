"""`bilateral-rl compare`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from bilateral_rl.api.comparison import compare
from bilateral_rl.commands.comparison_tables import print_comparison, print_methods
from bilateral_rl.commands.writing import apart_from, write


def compare_runs(
    *,
    runs: Sequence[str],
    metrics: Sequence[str] | None,
    protocols: Sequence[str] | None,
    trials: int,
    seed: int,
    task: str | None,
    csv: Path | None,
    console: Console,
) -> None:
    """Compare several runs' models, or the lesions of one, with seeds as the unit.

    Args:
        runs: each RUN or RUN:SEED; one alone is compared by its lesions.
        metrics: names of the metrics; None for the task's preferred one.
        protocols: names of what followed the lesions of one run; None for all that there are.
        trials: number of trials of each test of a model.
        seed: seed of the first trial.
        task: the class that the runs learned, whose code may be run; None for nothing.
        csv: file for one row a pair; "-" for the terminal, None for no file.
        console: where to print.

    Raises:
        UserError: runs that cannot be compared, lesions that are missing or stale, or a file that cannot be written;
            the comparison is printed all the same.
    """
    console = apart_from(console, csv)
    comparison = compare(*runs, metrics=metrics, retrain=protocols, trials=trials, seed=seed, task=task)
    try:
        if csv is not None:
            pairs = comparison.pairs
            keys = list(comparison.parts[0].keys)
            write(csv, pairs[[*(name for name in pairs if name not in keys), *keys]].to_csv(index=False))
    finally:
        for part in comparison.parts:
            print_comparison(part.comparison, part.words, console)
        print_methods(comparison.parts[-1].comparison, console)
        for note in comparison.notes:
            console.print(f"[yellow]Note:[/yellow] {escape(note)}", highlight=False, soft_wrap=True)
