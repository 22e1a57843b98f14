"""The tables of a study's report: models, tests and lesions in numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import pandas as pd

from bilateral_rl.analysis.comparison import compare
from bilateral_rl.analysis.formats import f_statistic, fixed, mean_sd, number, p_value
from bilateral_rl.analysis.goals import STUDY_RADII
from bilateral_rl.analysis.metrics import find_metric, metrics_of, preferred_metric
from bilateral_rl.analysis.results import State, by_seed
from bilateral_rl.analysis.statistics import OmnibusTest, anova, welch_anova
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.figures.labels import model_label, task_label, with_unit
from bilateral_rl.study.lesion_tables import lesion_tables
from bilateral_rl.study.report_table import ReportTable

_SPREAD_NOTE = "Mean ± standard deviation over the seeds."
_PAIRS_NOTE = (
    "Intervals by bootstrap (BCa), not adjusted and too narrow where seeds are few: of ten they cover nine times in "
    "ten. The tests are adjusted for all pairs. The claims above use Welch's and Student's intervals."
)


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
    metrics = {task: find_metric(preferred_metric(task, radius)) for task, radius in radii.items()}
    bilateral = [model for model, description in MODELS.items() if description.architecture != "unilateral"]
    yield from lesion_tables(results, metrics, bilateral)


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
