"""The tables of a study's report: models, tests and lesions in numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import pandas as pd

from bilateral_rl.analysis.comparison import compare, compare_lesions
from bilateral_rl.analysis.formats import f_statistic, fixed, mean_sd, number, p_value
from bilateral_rl.analysis.goals import STUDY_RADII
from bilateral_rl.analysis.intervals import mean_interval
from bilateral_rl.analysis.metrics import Metric, find_metric, metrics_of, preferred_metric
from bilateral_rl.analysis.results import State, by_seed, protocol_words, protocols_in
from bilateral_rl.analysis.specialization import specialization_by_seed
from bilateral_rl.analysis.statistics import OmnibusTest, anova, welch_anova
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.figures.labels import model_label, task_label, with_unit
from bilateral_rl.policies.lesions import INTACT, LESIONS, lesion_words

_SPREAD_NOTE = "Mean ± standard deviation over the seeds."
_PAIRS_NOTE = (
    "Intervals by bootstrap (BCa), not adjusted and too narrow where seeds are few: of ten they cover nine times in "
    "ten. The tests are adjusted for all pairs. The claims above use Welch's and Student's intervals."
)
_INDEX_NOTE = "(dominant − non-dominant) / (dominant + non-dominant) of what each hemisphere does alone, 95 % interval."


@dataclass(frozen=True)
class ReportTable:
    """Text in rows and columns."""

    name: str
    """Name of its file, without the suffix."""
    title: str
    columns: list[str]
    rows: list[list[str]]
    note: str = ""

    def frame(self) -> pd.DataFrame:
        """Return the same as a data frame."""
        return pd.DataFrame(self.rows, columns=self.columns)


def study_tables(results: pd.DataFrame, radii: Mapping[str, float]) -> Iterator[ReportTable]:
    """Make every table of a report.

    Args:
        results: the long table (:mod:`bilateral_rl.analysis.results`).
        radii: radius of the goal by task (m).
    """
    for task, radius in radii.items():
        models = _models(results, task)
        if models:
            yield _models_table(results, task, models)
        if len(models) > 1:
            yield _tests_table(results, task, models)
            yield _pairs_table(results, task, radius, models)
    for task, radius in radii.items():
        metric = find_metric(preferred_metric(task, radius))
        models = [model for model in _models(results, task) if MODELS[model].architecture != "unilateral"]
        if models:
            yield _lesions_table(results, task, metric, models)
            yield _specialization_table(results, task, metric, models)


def _models(results: pd.DataFrame, task: str) -> list[str]:
    present = set(results.loc[results["task"] == task, "model"])
    return [model for model in MODELS if model in present]


def _models_table(results: pd.DataFrame, task: str, models: list[str]) -> ReportTable:
    present = set(results["metric"])
    metrics = [metric for metric in metrics_of(task, STUDY_RADII) if metric.name in present]
    rows = [
        [with_unit(metric), *(mean_sd(by_seed(results, metric.name, State(task, model))) for model in models)]
        for metric in metrics
    ]
    columns = ["", *(model_label(model) for model in models)]
    return ReportTable(f"models_{task}", f"{task_label(task)}: the intact models", columns, rows, _SPREAD_NOTE)


def _tests_table(results: pd.DataFrame, task: str, models: list[str]) -> ReportTable:
    present = set(results["metric"])
    rows = []
    for metric in metrics_of(task, STUDY_RADII):
        if metric.name in present:
            groups = [by_seed(results, metric.name, State(task, model)) for model in models]
            rows.append([with_unit(metric), *_omnibus(anova(groups)), *_omnibus(welch_anova(groups))])
    columns = ["", "one-way ANOVA", "p", "Welch's ANOVA", "p"]
    return ReportTable(f"tests_{task}", f"{task_label(task)}: do the models differ at all?", columns, rows)


def _omnibus(test: OmnibusTest) -> list[str]:
    return [test.note or "–" if math.isnan(test.p) else f_statistic(test), p_value(test.p)]


def _pairs_table(results: pd.DataFrame, task: str, radius: float, models: list[str]) -> ReportTable:
    metric = find_metric(preferred_metric(task, radius))
    pairs = compare(results, metric.name, task, models).pairs
    rows = [
        [
            f"{model_label(pair['first'])} − {model_label(pair['second'])}",
            number(pair["difference"], "+"),
            f"{number(pair['low'])} to {number(pair['high'])}",
            fixed(pair["g"], 2, "+"),
            p_value(pair["p_games_howell"]),
            p_value(pair["p_tukey"]),
        ]
        for pair in pairs.to_dict("records")
    ]
    columns = ["", "difference", "95 % interval", "Hedges' g", "Games–Howell", "Tukey's HSD"]
    title = f"{task_label(task)}: pairs of models by {with_unit(metric)}"
    return ReportTable(f"pairs_{task}", title, columns, rows, _PAIRS_NOTE)


def _lesions_table(results: pd.DataFrame, task: str, metric: Metric, models: list[str]) -> ReportTable:
    protocols = protocols_in(results)
    columns, rows = [""], [[lesion_words(lesion)] for lesion in (INTACT, *LESIONS)]
    for model in models:
        for protocol in protocols:
            retrained = protocol != "none"
            columns += [protocol_words(protocol), "p"] if retrained else [model_label(model)]
            p_values = _against_intact(results, metric, State(task, model, protocol=protocol)) if retrained else {}
            for row, lesion in zip(rows, (INTACT, *LESIONS), strict=True):
                row.append(mean_sd(by_seed(results, metric.name, State(task, model, lesion, protocol))))
                row += [p_value(p_values.get(lesion, math.nan))] if retrained else []
    note = f"{_SPREAD_NOTE} p: against the intact network, both retrained, paired t test, Holm over all pairs."
    return ReportTable(f"lesions_{task}", f"{task_label(task)}: lesions, {with_unit(metric)}", columns, rows, note)


def _against_intact(results: pd.DataFrame, metric: Metric, intact: State) -> dict[str, float]:
    rows = results[
        (results["model"] == intact.model)
        & (results["task"] == intact.task)
        & (results["protocol"] == intact.protocol)
        & (results["network"] == intact.network)
    ]
    if INTACT not in set(rows["lesion"]) or rows["lesion"].nunique() < 2:
        return {}
    pairs = compare_lesions(results, metric.name, intact).pairs
    pairs = pairs[pairs["first"] == INTACT]
    return dict(zip(pairs["second"], pairs["p_holm"], strict=True))


def _specialization_table(results: pd.DataFrame, task: str, metric: Metric, models: list[str]) -> ReportTable:
    rows, protocols = [], protocols_in(results)
    for model in models:
        row = [model_label(model)]
        for protocol in protocols:
            state = State(task, model, protocol=protocol)
            interval = mean_interval(specialization_by_seed(results, metric.name, state))
            row.append(f"{fixed(interval.value, 3, '+')} ({number(interval.low)} to {number(interval.high)})")
        rows.append(row)
    title = f"{task_label(task)}: specialization index, {with_unit(metric)}"
    columns = ["", *map(protocol_words, protocols)]
    return ReportTable(f"specialization_{task}", title, columns, rows, _INDEX_NOTE)
