"""`bilateral-rl compare`."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
from rich.console import Console

from bilateral_rl.analysis.comparison import compare, compare_lesions
from bilateral_rl.analysis.metrics import Metric, find_metric, measure, preferred_metric
from bilateral_rl.analysis.results import COLUMNS, RETRAINING, State, read_results
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.commands.checks import check_trials
from bilateral_rl.commands.comparison_tables import print_comparison, print_methods
from bilateral_rl.commands.lesion import RESULTS, default_place
from bilateral_rl.commands.writing import apart_from, write
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import INTACT
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import load_policies, parse_run

_NO_TREATMENT = ("seed", "seeds", "device", "threads", "init_from", "track", "evaluation")
"""Settings in which the seeds of one group may differ."""


@dataclass(frozen=True)
class _Chosen:
    """A run, or one seed of it."""

    folder: RunFolder
    only: int | None
    config: TrainConfig

    @property
    def seeds(self) -> list[int]:
        return self.config.all_seeds if self.only is None else [self.only]

    def name(self, path: str) -> str:
        return path if self.only is None else f"{path}:{self.only}"


def compare_runs(
    *, runs: Sequence[str], metrics: Sequence[str] | None, trials: int, seed: int, csv: Path | None, console: Console
) -> None:
    """Compare several runs' models, or the lesions of one, seeds as the unit."""
    check_trials(trials, seed)
    console = apart_from(console, csv)
    chosen = [_Chosen(folder, only, folder.config()) for folder, only in map(parse_run, runs)]
    tasks = {one.config.task for one in chosen}
    if len(tasks) > 1:
        raise UserError(f"Runs of different tasks cannot be compared: {', '.join(sorted(tasks))}.")
    wanted = _metrics(metrics, chosen[0].config)
    if len(chosen) == 1:
        _compare_lesions(chosen[0], wanted, csv, console)
    else:
        _compare_models(chosen, wanted, trials, seed, csv, console)


def _metrics(names: Sequence[str] | None, config: TrainConfig) -> list[Metric]:
    metrics = [find_metric(name) for name in names or [preferred_metric(config.task, config.trial.threshold)]]
    for metric in metrics:
        if config.task not in metric.tasks:
            raise UserError(f"{metric.name} means nothing in {config.task}; choose another --metric.")
    return metrics


def _compare_models(
    chosen: Sequence[_Chosen], metrics: Sequence[Metric], trials: int, seed: int, csv: Path | None, console: Console
) -> None:
    labels, rows = _labels(chosen), []
    for one, label in zip(chosen, labels, strict=True):
        evaluator = Evaluator(one.config.task, one.config.trial, trials, seed)
        head = (label, one.config.task, one.config.algo)
        for own, policy in load_policies(one.folder, seed=one.only).items():
            rows += [(*head, own, INTACT, False, *pair) for pair in measure(evaluator.run(policy), metrics).items()]
    results = pd.DataFrame(rows, columns=list(COLUMNS))
    tables = []
    for metric in metrics:
        comparison = compare(results, metric.name, chosen[0].config.task)
        print_comparison(comparison, "", console)
        tables.append(comparison.pairs.assign(metric=metric.name))
    print_methods(comparison, console)
    if len({dataclasses.replace(one.config.trial, threshold=1.0) for one in chosen}) > 1:
        note = "these runs' trials differ (trial in config.yaml), and each was tested in its own."
        console.print(f"[yellow]Note:[/yellow] {note}", highlight=False)
    _write(tables, csv)


def _labels(chosen: Sequence[_Chosen]) -> list[str]:
    """The group of each: runs of one model are seeds of one group, unless they share a seed or differ in more."""
    _check_each_seed_is_there_once(chosen)
    several = len({one.config.algo for one in chosen}) > 1
    models = [f"{one.config.model} ({one.config.algo})" if several else one.config.model for one in chosen]
    labels = list(models)
    for model in set(models):
        members = [i for i, of_model in enumerate(models) if of_model == model]
        if not _are_one_group([chosen[i] for i in members]):
            for i in members:
                labels[i] = chosen[i].name(chosen[i].folder.path.name)
    taken = Counter(labels)
    labels = [
        one.name(str(one.folder.path)) if taken[label] > 1 and label not in models else label
        for one, label in zip(chosen, labels, strict=True)
    ]
    if len(set(labels)) < 2:
        raise UserError("These runs are seeds of one model: a comparison needs two models, or one run's lesions.")
    return labels


def _are_one_group(members: Sequence[_Chosen]) -> bool:
    seeds = [seed for one in members for seed in one.seeds]
    treatments = [
        {name: value for name, value in one.config.to_values().items() if name not in _NO_TREATMENT}
        | {"fresh": one.config.init_from is None}
        for one in members
    ]
    return len(set(seeds)) == len(seeds) and all(treatment == treatments[0] for treatment in treatments)


def _check_each_seed_is_there_once(chosen: Sequence[_Chosen]) -> None:
    """Raise a UserError where a network would be compared with itself."""
    counts = Counter((one.folder.path.resolve(), seed) for one in chosen for seed in one.seeds)
    for (path, seed), n in counts.items():
        if n > 1:
            raise UserError(f"Seed {seed} of {path} is there {n} times; name every run, or seed of it, once.")


def _compare_lesions(one: _Chosen, metrics: Sequence[Metric], csv: Path | None, console: Console) -> None:
    path = default_place(one.folder, one.only) / RESULTS
    if not path.is_file():
        command = f"bilateral-rl lesion {one.name(str(one.folder.path))}"
        raise UserError(f"One run is compared by its lesions: call `{command}` first.")
    results = read_results(path)
    there = list(dict.fromkeys(results["metric"]))
    tables = []
    for metric in metrics:
        if metric.name not in there:
            raise UserError(f"{path} has no {metric.name}; choose a --metric from {', '.join(there)}.")
        for retrained, words in RETRAINING.items():
            if (results["retrained"] == retrained).any():
                state = State(one.config.task, one.config.model, retrained=retrained)
                comparison = compare_lesions(results, metric.name, state)
                print_comparison(comparison, f"{one.config.model}, {words}", console)
                tables.append(comparison.pairs.assign(metric=metric.name, retrained=retrained))
    print_methods(comparison, console)
    _write(tables, csv)


def _write(tables: Sequence[pd.DataFrame], csv: Path | None) -> None:
    if csv is not None:
        write(csv, pd.concat(tables).to_csv(index=False))
