"""`bilateral-rl compare`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from bilateral_rl.analysis.comparison import Comparison, ModelComparison, compare, compare_lesions
from bilateral_rl.analysis.metrics import Metric, find_metric, measure, preferred_metric
from bilateral_rl.analysis.results import COLUMNS, INTACT
from bilateral_rl.commands.lesion import RESULTS, default_place
from bilateral_rl.commands.writing import write
from bilateral_rl.config import TrainConfig
from bilateral_rl.controllers import load_policies, parse_run
from bilateral_rl.errors import UserError
from bilateral_rl.evaluation import Evaluator
from bilateral_rl.run_folder import RunFolder

FEW_SEEDS = 5
"""Below, a test has hardly a chance."""


def compare_runs(
    runs: Sequence[str], metrics: Sequence[str] | None, trials: int, seed: int, csv: Path | None, console: Console
) -> None:
    """Compare several runs' models, or the lesions of one, seeds as the unit."""
    if trials < 1 or seed < 0:
        raise UserError(f"--trials must be at least 1 and --seed at least 0, got {trials} and {seed}.")
    chosen = [parse_run(run) for run in runs]
    configs = [folder.config() for folder, _ in chosen]
    tasks = {config.task for config in configs}
    if len(tasks) > 1:
        raise UserError(f"Runs of different tasks cannot be compared: {', '.join(sorted(tasks))}.")
    config = configs[0]
    names = list(metrics or [preferred_metric(config.task, config.trial.threshold)])
    wanted = [find_metric(name) for name in names]
    if len(chosen) == 1:
        comparisons: list[Comparison] = _of_lesions(chosen[0][0], chosen[0][1], wanted)
    else:
        comparisons = _of_models(chosen, configs, wanted, trials, seed)
    for comparison in comparisons:
        _print(comparison, console)
    if csv is not None:
        write(csv, pd.concat([c.pairs.assign(metric=c.metric) for c in comparisons]).to_csv(index=False))


def _of_models(
    chosen: Sequence[tuple[RunFolder, int | None]],
    configs: Sequence[TrainConfig],
    metrics: Sequence[Metric],
    trials: int,
    seed: int,
) -> list[Comparison]:
    """Runs of one model and algorithm are seeds of one group, unless they have a seed in common."""
    for metric in metrics:
        if configs[0].task not in metric.tasks:
            raise UserError(f"{metric.name} means nothing in {configs[0].task}; choose another --metric.")
    groups = _labels(chosen, configs)
    rows = []
    for (folder, only), config, label in zip(chosen, configs, groups, strict=True):
        evaluator = Evaluator(config.task, config.trial, trials, seed)
        for own, policy in load_policies(folder, seed=only).items():
            values = measure(evaluator.run(policy), metrics)
            rows += [(label, config.task, config.algo, own, INTACT, False, *pair) for pair in values.items()]
    results = pd.DataFrame(rows, columns=list(COLUMNS))
    return [compare(results, metric.name, configs[0].task) for metric in metrics]


def _labels(chosen: Sequence[tuple[RunFolder, int | None]], configs: Sequence[TrainConfig]) -> list[str]:
    several = len({config.algo for config in configs}) > 1
    labels = [f"{config.model} ({config.algo})" if several else config.model for config in configs]
    seeds: dict[str, list[int]] = {}
    for (folder, only), label in zip(chosen, labels, strict=True):
        seeds.setdefault(label, []).extend(load_policies(folder, seed=only))
    twice = {label for label, of_label in seeds.items() if len(set(of_label)) < len(of_label)}
    own = [folder.path.name if only is None else f"{folder.path.name}:{only}" for folder, only in chosen]
    labels = [name if label in twice else label for label, name in zip(labels, own, strict=True)]
    if len(set(labels)) < 2:
        raise UserError("These runs are seeds of one model: a comparison needs two models, or one run's lesions.")
    return labels


def _of_lesions(folder: RunFolder, only: int | None, metrics: Sequence[Metric]) -> list[Comparison]:
    path, config = default_place(folder, only) / RESULTS, folder.config()
    if not path.is_file():
        raise UserError(f"One run is compared by its lesions: call `bilateral-rl lesion {folder.path}` first.")
    results = pd.read_csv(path)
    states = [bool(retrained) for retrained in sorted(set(results["retrained"]))]
    return [compare_lesions(results, m.name, config.task, config.model, state) for m in metrics for state in states]


def _print(comparison: Comparison, console: Console) -> None:
    metric = find_metric(comparison.metric)
    title = escape(f"{comparison.task}: {metric.label}" + (f" ({metric.unit})" if metric.unit else ""))
    groups = Table("", "mean", "sd", "95 % interval", "seeds", title=title, title_justify="left")
    for name, row in comparison.groups.iterrows():
        interval = f"{_number(row['low'])} to {_number(row['high'])}"
        groups.add_row(escape(str(name)), _number(row["mean"]), _number(row["sd"]), interval, str(int(row["n"])))
    console.print(groups)
    if isinstance(comparison, ModelComparison):
        for test in (comparison.anova, comparison.welch):
            df = ", ".join(f"{value:.4g}" for value in test.df)
            console.print(f"{test.name}: F({df}) = {test.statistic:.2f}, {_p(test.p)} {test.note}", highlight=False)
    columns = {"p_tukey": "Tukey's HSD", "p_games_howell": "Games–Howell", "p_paired": "paired t", "p_holm": "Holm"}
    shown = [name for name in columns if name in comparison.pairs]
    pairs = Table("first − second", "difference", "95 % interval", "Hedges' g", *(columns[name] for name in shown))
    for pair in comparison.pairs.to_dict("records"):
        pairs.add_row(
            escape(f"{pair['first']} − {pair['second']}"),
            f"{pair['difference']:+.3g}",
            f"{_number(pair['low'])} to {_number(pair['high'])}",
            f"{pair['g']:+.2f}",
            *(_p(pair[name]) for name in shown),
        )
    console.print(pairs)
    fewest = int(comparison.groups["n"].min())
    if fewest < FEW_SEEDS:
        words = "no test is possible" if fewest < 2 else "tests have hardly a chance to find a difference"
        console.print(
            f"[yellow]Note:[/yellow] a group has {fewest} seed{'s' * (fewest > 1)}: {words}.", highlight=False
        )


def _number(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.4g}"


def _p(p: float) -> str:
    if math.isnan(p):
        return "–"
    return "p < 0.001" if p < 0.001 else f"p = {p:.3f}"
