"""Lesions in numbers: every protocol beside its control, deep against shallow lesions, and specialization."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product

import pandas as pd

from bilateral_rl.analysis.comparison import compare_lesions
from bilateral_rl.analysis.depth import deep_minus_shallow
from bilateral_rl.analysis.floor import AT_FLOOR, above_control, at_floor
from bilateral_rl.analysis.formats import fixed, mean_sd, number, p_value
from bilateral_rl.analysis.intervals import Interval, mean_interval
from bilateral_rl.analysis.metric import Metric
from bilateral_rl.analysis.results import State, by_seed, protocol_words, protocols_in
from bilateral_rl.analysis.specialization import specialization_by_seed
from bilateral_rl.figures.labels import model_label, task_label, with_unit
from bilateral_rl.policies.lesions import INTACT, LESIONS, lesion_words
from bilateral_rl.study.report_table import ReportTable
from bilateral_rl.vocabulary import SIDES

_MARK = "†"
_LESIONS_NOTE = (
    "Mean ± standard deviation over the seeds. Fresh: the same done to a freshly initialized network, the control. "
    "p: against the intact network that was treated alike, paired t test, Holm over all pairs of a model's lesions. "
    f"{_MARK}: not shown to be better than the control: lost, or relearned and not kept."
)
_DEPTH_NOTE = (
    "What a deep lesion leaves more than a shallow one of the same side, with its 95 % interval, paired by seed; p of "
    "the paired t test after Holm over a task's rows of a column. C6 says that shallow lesions hurt more: above 0."
)
_INDEX_NOTE = (
    "(dominant − non-dominant) / (dominant + non-dominant) of what each hemisphere does alone, after a deep lesion of "
    "the other one, 95 % interval. At the floor: neither does better alone than in a fresh network that was treated "
    "alike, and the index means nothing."
)


def lesion_tables(results: pd.DataFrame, metrics: Mapping[str, Metric], models: Sequence[str]) -> Iterator[ReportTable]:
    """Make the tables on lesions.

    Args:
        results: the long table (:mod:`bilateral_rl.analysis.results`).
        metrics: the metric by which each task is judged, by the task; of each, more is better.
        models: models with two hemispheres, of any of the tasks.
    """
    results = results[results["metric"].isin([metric.name for metric in metrics.values()])]
    present = {task: _present(results, task, models) for task in metrics}
    for task, metric in metrics.items():
        if present[task]:
            yield _lesions_table(results, task, metric, present[task])
            yield _specialization_table(results, task, metric, present[task])
    if any(present.values()):
        yield _depth_table(results, metrics, present)


def _present(results: pd.DataFrame, task: str, models: Sequence[str]) -> list[str]:
    there = set(results.loc[results["task"] == task, "model"])
    return [model for model in models if model in there]


def _lesions_table(results: pd.DataFrame, task: str, metric: Metric, models: Sequence[str]) -> ReportTable:
    protocols, results = protocols_in(results), results[results["task"] == task]
    columns = [""]
    for protocol in protocols:
        columns += [protocol_words(protocol), f"fresh, {protocol_words(protocol)}", "p"]
    rows, relearned = [], []
    for model in models:
        lesions = set(results.loc[results["model"] == model, "lesion"])
        states = {protocol: State(task, model, protocol=protocol) for protocol in protocols}
        p_values = {protocol: _against_intact(results, metric, state) for protocol, state in states.items()}
        for lesion in (name for name in (INTACT, *LESIONS) if name in lesions):
            row = [f"{model_label(model)}, {lesion_words(lesion)}"]
            for protocol, state in states.items():
                row += _cells(results, metric, state.after(lesion))
                row.append(p_value(p_values[protocol].get(lesion, math.nan)))
            rows.append(row)
        relearned.append(_relearned(results, metric, model, states.values()))
    note = "\n".join([_LESIONS_NOTE, *filter(None, relearned)])
    return ReportTable(f"lesions_{task}", f"{task_label(task)}: lesions, {with_unit(metric)}", columns, rows, note)


def _cells(results: pd.DataFrame, metric: Metric, state: State) -> list[str]:
    """What networks do in a state, marked where that is no more than the control does, and the control."""
    own, control = (mean_sd(by_seed(results, metric.name, each)) for each in (state, state.control))
    return [f"{own} {_MARK}" if above_control(results, metric.name, state) is False else own, control]


def _relearned(results: pd.DataFrame, metric: Metric, model: str, states: Iterable[State]) -> str:
    """Say after which lesions a model does no better than its control; "" if after none."""
    parts = []
    for state in states:
        told = {name: above_control(results, metric.name, state.after(name)) for name in LESIONS}
        floored = [name for name, above in told.items() if above is False]
        if floored:
            everywhere = len(floored) == sum(above is not None for above in told.values())
            words = "every lesion" if everywhere else "; ".join(map(lesion_words, floored))
            parts.append(f"{protocol_words(state.protocol)} ({words})")
    return f"Lost, or relearned and not kept, by {model_label(model)}: {', '.join(parts)}." if parts else ""


def _against_intact(results: pd.DataFrame, metric: Metric, intact: State) -> dict[str, float]:
    """p-value of each lesion against the intact network."""
    rows = results
    for column in ("metric", "model", "task", "protocol", "network"):
        wanted = metric.name if column == "metric" else getattr(intact, column)
        rows = rows[rows[column] == wanted]
    if INTACT not in set(rows["lesion"]) or rows["lesion"].nunique() < 2:
        return {}
    pairs = compare_lesions(results, metric.name, intact).pairs
    pairs = pairs[pairs["first"] == INTACT]
    return dict(zip(pairs["second"], pairs["p_holm"], strict=True))


def _depth_table(
    results: pd.DataFrame, metrics: Mapping[str, Metric], present: Mapping[str, Sequence[str]]
) -> ReportTable:
    protocols = protocols_in(results)
    columns, rows = [""], []
    for protocol in protocols:
        columns += [protocol_words(protocol), "p"]
    for task, metric in metrics.items():
        found: dict[tuple[str, str, str], list[str]] = {}
        states = [State(task, model, protocol=protocol) for model in present[task] for protocol in protocols]
        for row in deep_minus_shallow(results, metric.name, states).to_dict("records"):
            cells = [_interval(Interval(row["difference"], row["low"], row["high"], row["n"]), "+")]
            found[row["model"], row["side"], row["protocol"]] = [*cells, p_value(row["p_holm"])]
        for model, side in product(present[task], SIDES):
            cells = [cell for protocol in protocols for cell in found.get((model, side, protocol), ["–", "–"])]
            where = f"{task_label(task)}, {model_label(model)}, {side.replace('_', '-')} ({metric.unit})"
            rows.append([where, *cells])
    return ReportTable("deep_minus_shallow", "Deep minus shallow lesions", columns, rows, _DEPTH_NOTE)


def _specialization_table(results: pd.DataFrame, task: str, metric: Metric, models: Sequence[str]) -> ReportTable:
    protocols = protocols_in(results)
    rows = [
        [model_label(model), *(_index(results, metric, State(task, model, protocol=name)) for name in protocols)]
        for model in models
    ]
    title = f"{task_label(task)}: specialization index, {with_unit(metric)}"
    return ReportTable(f"specialization_{task}", title, ["", *map(protocol_words, protocols)], rows, _INDEX_NOTE)


def _index(results: pd.DataFrame, metric: Metric, state: State) -> str:
    if at_floor(results, metric.name, state):
        return AT_FLOOR
    return _interval(mean_interval(specialization_by_seed(results, metric.name, state)), "+", 3)


def _interval(interval: Interval, sign: str = "", decimals: int | None = None) -> str:
    """An estimate and its bounds; a dash where there is none."""
    if math.isnan(interval.value):
        return "–"
    value = number(interval.value, sign) if decimals is None else fixed(interval.value, decimals, sign)
    return value if math.isnan(interval.low) else f"{value} ({number(interval.low)} to {number(interval.high)})"
