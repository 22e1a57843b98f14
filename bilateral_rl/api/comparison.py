"""Models compared with each other, and the lesions of one, with seeds as the unit."""

from __future__ import annotations

import dataclasses
import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import pandas as pd

from bilateral_rl.analysis import comparison as statistics
from bilateral_rl.analysis.metric import Metric
from bilateral_rl.analysis.metrics import (
    find_metric,
    means_something,
    measure,
    preferred_among,
    preferred_by_hand,
    preferred_metric,
)
from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.analysis.results import COLUMNS, State, protocol_words, protocols_in, treatment
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.api.checks import Names, check_tests, names
from bilateral_rl.api.run import Run, find_run
from bilateral_rl.api.wording import in_python
from bilateral_rl.config.code_tasks import confirm_code
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.envs.tasks import Task
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import INTACT
from bilateral_rl.runs.policies import load_policies
from bilateral_rl.study.lesion_folder import LesionFolder
from bilateral_rl.vocabulary import TEST_SEED, TEST_TRIALS

_NO_TREATMENT = ("seed", "seeds", "device", "threads", "init_from", "track", "evaluation")
"""Settings in which the seeds of one group may differ."""
_USUAL_RADIUS = 0.05
"""Radius of the goal (m) at which lesions are compared whose run is not known."""


@dataclass(frozen=True)
class Part:
    """A comparison by one metric, of lesions after one protocol."""

    comparison: statistics.Comparison
    """Groups, pairs and, of models, the tests of all."""
    keys: Mapping[str, str]
    """What tells its rows apart from those of other parts: ``metric``, and ``protocol`` of lesions."""
    words: str = ""
    """Words about it for a title; may be empty."""


@dataclass(frozen=True)
class Comparison:
    """What :func:`compare` returns: three tables, and remarks.

    Every table begins with the column ``metric`` and, where lesions are compared, ``protocol``.
    """

    parts: tuple[Part, ...]
    """The comparisons, one a metric and protocol."""
    notes: tuple[str, ...] = ()
    """Sentences that a person should read."""

    @property
    def table(self) -> pd.DataFrame:
        """A row a group of seeds: ``group`` (models, or lesions with "intact" first), in the metric's unit ``mean``,
        ``sd``, ``low`` and ``high`` (95 % interval of the mean, by bootstrap over the seeds), ``n`` seeds, ``note``; of
        lesions also ``fresh``, the mean of freshly initialized networks that were treated alike.
        """
        return self._joined([part.comparison.groups.rename_axis("group").reset_index() for part in self.parts])

    @property
    def omnibus(self) -> pd.DataFrame:
        """A row a test whether any of the models differs: ``test``, ``f``, its degrees of freedom ``df_between``
        and ``df_within``, ``p``, ``note``.

        It is empty where lesions are compared.
        """
        return self._joined([_omnibus(part.comparison) for part in self.parts])

    @property
    def pairs(self) -> pd.DataFrame:
        """A row a pair of groups, ``first`` and ``second``.

        The other columns are those of :func:`bilateral_rl.analysis.comparison.compare`, or ``compare_lesions`` there:
        ``difference`` (first − second, in the metric's unit) with ``low`` and ``high``, ``g`` (Hedges') with ``g_low``
        and ``g_high``, p values, ``note``.
        """
        return self._joined([part.comparison.pairs for part in self.parts])

    def _joined(self, tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
        joined = pd.concat(
            [table.assign(**part.keys) for part, table in zip(self.parts, tables, strict=True)], ignore_index=True
        )
        keys = list(self.parts[0].keys)
        return joined[[*keys, *(name for name in joined if name not in keys)]]

    def _repr_html_(self) -> str:
        """Show the tables in a notebook."""
        named = {name: getattr(self, name) for name in ("table", "omnibus", "pairs")}
        tables = [f"<b>{name}</b>{table.to_html(index=False)}" for name, table in named.items() if len(table)]
        return "".join([*tables, *(f"<p>{escape(note)}</p>" for note in self.notes)])

    def __repr__(self) -> str:
        return "\n\n".join(
            f"Comparison.{name}:\n{table.to_string(index=False)}"
            for name in ("table", "omnibus", "pairs")
            if len(table := getattr(self, name))
        )


@in_python
def compare(
    *runs: Run | str | Path | pd.DataFrame,
    metrics: Names = None,
    retrain: Names = None,
    trials: int = TEST_TRIALS,
    seed: int = TEST_SEED,
    task: str | None = None,
) -> Comparison:
    """Compare trained models, or the lesions of one: analysis of variance, pairwise tests, effect sizes.

    Runs of one model that differ in nothing but seeds are one group. One run alone is compared by its lesions, which
    ``run.lesion(out=run.lesions_folder)`` or ``bilateral-rl lesion`` has left beside it.

    Args:
        runs: two or more, or one, loaded or as :func:`load` takes them; or the table that :meth:`Run.lesion` returned.
        metrics: one name or several, such as "effort"; None for the one that the task is judged by, of the field's
            trials where an experiment mixes trials with and without a field: "final_error_in_null" is of the others;
            between models of two arms also what each hand is judged by: "final_error_of_dominant_hold" is of one.
        retrain: what followed the lesions (of one run), as "everything", one or several; None for all that was tested.
        trials: number of trials of each test (of models).
        seed: seed of the first trial (of models).
        task: of runs that learned a class of yours, that class, as "module:Class", whose code is then run.

    Raises:
        UserError: runs that cannot be compared, or lesions that are missing or of other weights.
    """
    trials, seed = check_tests(trials, seed)
    if not runs:
        raise UserError("There is nothing to compare: name two runs or more, or one, to compare its lesions.")
    if len(runs) == 1 and isinstance(runs[0], pd.DataFrame):
        return _compare_table(runs[0], names("--metric", metrics), names("--retrain", retrain))
    chosen = [find_run(run) for run in runs if not isinstance(run, pd.DataFrame)]
    if len(chosen) < len(runs):
        raise UserError("Lesions are compared within one run: give one table, or the runs themselves.")
    configs = [run.config for run in chosen]
    confirm_code(configs[0].task, task, chosen[0])
    tasks = {config.task for config in configs}
    if len(tasks) > 1:
        raise UserError(f"Runs of different tasks cannot be compared: {', '.join(sorted(tasks))}.")
    if any(config.experiment != configs[0].experiment for config in configs):
        raise UserError(f"Runs of {configs[0].task} cannot be compared where that is not the same experiment in each.")
    learned, radius = configs[0].make_task(), configs[0].trial.threshold
    usual = [preferred_metric(learned, radius), *(preferred_by_hand(learned, radius) if len(chosen) > 1 else [])]
    found_metrics = _metrics(names("--metric", metrics) or usual, learned)
    protocols = names("--retrain", retrain)
    if len(chosen) == 1:
        folder = LesionFolder(chosen[0].lesions_folder)
        results, notes = folder.read(chosen[0].folder, chosen[0].name)
        return _compare_lesions(results, str(folder.path), configs[0].model, found_metrics, protocols, notes)
    if protocols:
        raise UserError("--retrain chooses among the lesions of one run; name one run, or leave it out.")
    return _compare_models(chosen, configs, found_metrics, trials, seed)


def _metrics(requested: Sequence[str], task: Task) -> list[Metric]:
    metrics = [find_metric(name) for name in requested]
    for metric in metrics:
        if not means_something(metric, task):
            raise UserError(f"{metric.name} means nothing in {task.id}; leave it out of --metric.")
    return metrics


def _compare_models(
    runs: Sequence[Run], configs: Sequence[TrainConfig], metrics: Sequence[Metric], trials: int, seed: int
) -> Comparison:
    labels, rows = _labels(runs, configs), []
    for run, config, label in zip(runs, configs, labels, strict=True):
        evaluator = Evaluator(config.make_task(), config.trial, trials, seed)
        head = (label, config.task, config.algo)
        for number, policy in load_policies(run.folder, seed=run.only).items():
            rows += [
                (*head, number, INTACT, *treatment(Protocol("none")), *pair)
                for pair in measure(evaluator.run(policy), metrics).items()
            ]
    results = pd.DataFrame(rows, columns=list(COLUMNS))
    parts = [
        Part(statistics.compare(results, metric.name, configs[0].task), {"metric": metric.name}) for metric in metrics
    ]
    trials_differ = len({dataclasses.replace(config.trial, threshold=1.0) for config in configs}) > 1
    note = "these runs' trials differ (trial in config.yaml), and each was tested in its own."
    return Comparison(tuple(parts), (note,) if trials_differ else ())


def _labels(runs: Sequence[Run], configs: Sequence[TrainConfig]) -> list[str]:
    """Label the runs by their groups: those of one model are one, unless they share a seed or differ in more.

    Raises:
        UserError: all are seeds of one model, or a network is there twice.
    """
    _check_each_seed_is_there_once(runs)
    several = len({config.algo for config in configs}) > 1
    models = [f"{config.model} ({config.algo})" if several else config.model for config in configs]
    labels = list(models)
    for model in set(models):
        members = [i for i, of_model in enumerate(models) if of_model == model]
        if not _are_one_group([runs[i] for i in members], [configs[i] for i in members]):
            for i in members:
                labels[i] = _name(runs[i], runs[i].path.name)
    taken = Counter(labels)
    labels = [
        _name(run, str(run.path)) if taken[label] > 1 and label not in models else label
        for run, label in zip(runs, labels, strict=True)
    ]
    if len(set(labels)) < 2:
        raise UserError("These runs are seeds of one model: a comparison needs two models, or one run's lesions.")
    return labels


def _name(run: Run, folder: str) -> str:
    return folder if run.only is None else f"{folder}:{run.only}"


def _are_one_group(members: Sequence[Run], configs: Sequence[TrainConfig]) -> bool:
    """Whether these are different seeds of one treatment."""
    seeds = [seed for run in members for seed in run.seeds]
    treatments = [
        {name: value for name, value in config.to_values().items() if name not in _NO_TREATMENT}
        | {"fresh": config.init_from is None}
        for config in configs
    ]
    return len(set(seeds)) == len(seeds) and all(treatment == treatments[0] for treatment in treatments)


def _check_each_seed_is_there_once(runs: Sequence[Run]) -> None:
    """Raise a UserError where a network would be compared with itself."""
    counts = Counter((run.path.resolve(), seed) for run in runs for seed in run.seeds)
    for (path, seed), n in counts.items():
        if n > 1:
            raise UserError(f"Seed {seed} of {path} is there {n} times; name every run, or seed of it, once.")


def _compare_table(results: pd.DataFrame, metrics: Sequence[str] | None, protocols: Sequence[str] | None) -> Comparison:
    if not {*COLUMNS} <= {*results.columns}:
        raise UserError("This is no table of lesions, as `run.lesion()` returns it: it lacks some of its columns.")
    models, tasks = results["model"].unique(), results["task"].unique()
    if len(models) != 1 or len(tasks) != 1:
        raise UserError("A table of lesions that are compared is of one model and one task.")
    chosen = metrics or [preferred_among(results["metric"].unique(), _USUAL_RADIUS)]
    found = [find_metric(name) for name in chosen]
    return _compare_lesions(results, "This table", models[0], found, protocols)


def _compare_lesions(
    results: pd.DataFrame,
    source: str,
    model: str,
    metrics: Sequence[Metric],
    protocols: Sequence[str] | None,
    notes: Sequence[str] = (),
) -> Comparison:
    measured, studied = list(dict.fromkeys(results["metric"])), protocols_in(results)
    for metric in metrics:
        if metric.name not in measured:
            raise UserError(f"{source} has no {metric.name}; choose --metric from {', '.join(measured)}.")
    for name in protocols or ():
        if name not in studied:
            raise UserError(f"{source} has no --retrain {name}; choose from {', '.join(studied)}.")
    task = str(results["task"].iloc[0])
    parts = [
        Part(
            statistics.compare_lesions(results, metric.name, State(task, model, protocol=protocol)),
            {"metric": metric.name, "protocol": protocol},
            f"{model}, {protocol_words(protocol)}",
        )
        for metric, protocol in itertools.product(metrics, dict.fromkeys(protocols or studied))
    ]
    return Comparison(tuple(parts), tuple(notes))


def _omnibus(comparison: statistics.Comparison) -> pd.DataFrame:
    columns = ["test", "f", "df_between", "df_within", "p", "note"]
    if not isinstance(comparison, statistics.ModelComparison):
        return pd.DataFrame(columns=columns)
    tests = (comparison.anova, comparison.welch)
    return pd.DataFrame([(test.name, test.statistic, *test.df, test.p, test.note) for test in tests], columns=columns)
