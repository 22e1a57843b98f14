"""`bilateral-rl compare`."""

from __future__ import annotations

import dataclasses
import itertools
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
from rich.console import Console
from rich.markup import escape

from bilateral_rl.analysis.comparison import Comparison, compare, compare_lesions
from bilateral_rl.analysis.metrics import Metric, find_metric, measure, preferred_metric
from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.analysis.results import COLUMNS, State, protocol_words, protocols_in, treatment
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.commands.checks import check_trials
from bilateral_rl.commands.comparison_tables import print_comparison, print_methods
from bilateral_rl.commands.writing import apart_from, write
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import INTACT
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import load_policies, parse_run
from bilateral_rl.study.lesion_folder import LesionFolder

_NO_TREATMENT = ("seed", "seeds", "device", "threads", "init_from", "track", "evaluation")
"""Settings in which the seeds of one group may differ."""


@dataclass(frozen=True)
class _Chosen:
    """A run that is to be compared, or the network of one seed of it."""

    folder: RunFolder
    only: int | None
    config: TrainConfig

    @property
    def seeds(self) -> list[int]:
        return self.config.all_seeds if self.only is None else [self.only]

    def name(self, path: str) -> str:
        return path if self.only is None else f"{path}:{self.only}"


def compare_runs(
    *,
    runs: Sequence[str],
    metrics: Sequence[str] | None,
    protocols: Sequence[str] | None,
    trials: int,
    seed: int,
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
        csv: file for one row a pair; "-" for the terminal, None for no file.
        console: where to print.

    Raises:
        UserError: runs that cannot be compared, lesions that are missing or stale, or a file that cannot be written;
            the comparison is printed all the same.
    """
    check_trials(trials, seed)
    console = apart_from(console, csv)
    chosen = [_Chosen(folder, only, folder.config()) for folder, only in map(parse_run, runs)]
    tasks = {one.config.task for one in chosen}
    if len(tasks) > 1:
        raise UserError(f"Runs of different tasks cannot be compared: {', '.join(sorted(tasks))}.")
    found_metrics = _metrics(metrics, chosen[0].config)
    if len(chosen) == 1:
        _compare_lesions(chosen[0], found_metrics, protocols, csv, console)
    elif protocols:
        raise UserError("--retrain chooses among the lesions of one run; name one run, or leave it out.")
    else:
        _compare_models(chosen, found_metrics, trials, seed, csv, console)


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
        for number, policy in load_policies(one.folder, seed=one.only).items():
            rows += [
                (*head, number, INTACT, *treatment(Protocol("none")), *pair)
                for pair in measure(evaluator.run(policy), metrics).items()
            ]
    results = pd.DataFrame(rows, columns=list(COLUMNS))
    comparisons = [(compare(results, metric.name, chosen[0].config.task), "") for metric in metrics]
    tables = [comparison.pairs.assign(metric=comparison.metric) for comparison, _ in comparisons]
    trials_differ = len({dataclasses.replace(one.config.trial, threshold=1.0) for one in chosen}) > 1
    note = "these runs' trials differ (trial in config.yaml), and each was tested in its own."
    _report(comparisons, tables, [note] if trials_differ else [], csv, console)


def _labels(chosen: Sequence[_Chosen]) -> list[str]:
    """The labels of their groups: runs of one model are seeds of one group, unless they share a seed or differ in more.

    Raises:
        UserError: all are seeds of one model, or a network is there twice.
    """
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
    """Whether these are different seeds of one treatment."""
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


def _compare_lesions(
    one: _Chosen, metrics: Sequence[Metric], protocols: Sequence[str] | None, csv: Path | None, console: Console
) -> None:
    folder = LesionFolder.beside(one.folder, one.only)
    results, notes = folder.read(one.folder, one.name(str(one.folder.path)))
    measured, studied = list(dict.fromkeys(results["metric"])), protocols_in(results)
    comparisons, tables = [], []
    for metric in metrics:
        if metric.name not in measured:
            raise UserError(f"{folder.path} has no {metric.name}; choose a --metric from {', '.join(measured)}.")
    for name in protocols or ():
        if name not in studied:
            raise UserError(f"{folder.path} has no --retrain {name}; choose from {', '.join(studied)}.")
    for metric, protocol in itertools.product(metrics, dict.fromkeys(protocols or studied)):
        state = State(one.config.task, one.config.model, protocol=protocol)
        comparison = compare_lesions(results, metric.name, state)
        comparisons.append((comparison, f"{one.config.model}, {protocol_words(protocol)}"))
        tables.append(comparison.pairs.assign(metric=metric.name, protocol=protocol))
    _report(comparisons, tables, notes, csv, console)


def _report(
    comparisons: Sequence[tuple[Comparison, str]],
    tables: Sequence[pd.DataFrame],
    notes: Sequence[str],
    csv: Path | None,
    console: Console,
) -> None:
    """Write the tables of pairs, if that is requested, then print the comparisons with words about each, and notes."""
    try:
        if csv is not None:
            write(csv, pd.concat(tables).to_csv(index=False))
    finally:
        for comparison, words in comparisons:
            print_comparison(comparison, words, console)
        print_methods(comparisons[-1][0], console)
        for note in notes:
            console.print(f"[yellow]Note:[/yellow] {escape(note)}", highlight=False, soft_wrap=True)
