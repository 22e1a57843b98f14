"""Models compared with each other, and the lesions of one model, as tables that commands print and figures draw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pandas as pd

from bilateral_rl.analysis.bootstrap import bootstrap_difference, bootstrap_mean, bootstrap_ratio
from bilateral_rl.analysis.intervals import Interval, difference_interval, hedges_g, mean_interval
from bilateral_rl.analysis.results import State, by_seed, protocol_words
from bilateral_rl.analysis.samples import Float64, align, finite, join_notes
from bilateral_rl.analysis.statistics import (
    OmnibusTest,
    anova,
    games_howell,
    holm,
    paired_test,
    tukey_hsd,
    welch_anova,
)
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import INTACT


@dataclass(frozen=True)
class Comparison:
    """Groups of seeds side by side."""

    metric: str
    """Name of the metric."""
    task: str
    """Id of the task."""
    groups: pd.DataFrame
    """A row a group, indexed by its name; columns mean, sd, n, low and high (95 % bootstrap interval of the mean),
    note; of lesions also fresh, see
    :func:`compare_lesions`."""
    pairs: pd.DataFrame
    """A row a pair of groups, ``first`` and ``second`` in the order of ``groups``; the other columns are those of
    :func:`compare` or :func:`compare_lesions`."""


@dataclass(frozen=True)
class ModelComparison(Comparison):
    """Independent groups, and two tests whether any of them differs."""

    anova: OmnibusTest
    """The paper's test, which assumes equal variances."""
    welch: OmnibusTest
    """The test that does not."""


def compare(results: pd.DataFrame, metric: str, task: str, models: Sequence[str] | None = None) -> ModelComparison:
    """Compare intact models by one metric, with seeds as the unit.

    The columns of ``pairs``: ``difference`` of the means (first − second) with its bootstrap interval ``low`` to
    ``high``; ``ratio`` of the means (first / second) with its bootstrap interval ``ratio_low`` to ``ratio_high``;
    Hedges' ``g`` with its exact interval ``g_low`` to ``g_high``; ``p_tukey`` (Tukey's HSD, the paper's way);
    ``p_games_howell``; ``note``.

    Args:
        results: long table (:mod:`bilateral_rl.analysis.results`), of one algorithm or with a ``model`` for each.
        metric: name of the metric.
        task: id of the task.
        models: labels in the ``model`` column, in the order of the groups; None for all, in the table's order.

    Raises:
        UserError: fewer than two groups, a group without values, or two values of one seed.
    """
    if models is None:
        rows = results[(results["metric"] == metric) & (results["task"] == task) & (results["lesion"] == INTACT)]
        models = list(dict.fromkeys(rows["model"]))
    if len(set(models)) < 2:
        raise UserError(f"A comparison of {metric} in {task} needs results of two models or more, got {len(models)}.")
    samples = {model: by_seed(results, metric, State(task, model)) for model in dict.fromkeys(models)}
    for model, values in samples.items():
        _check_not_empty(values, model, metric, task)
    arrays = [values.to_numpy(dtype=np.float64) for values in samples.values()]
    pairs = _model_pairs(list(samples), arrays)
    return ModelComparison(metric, task, _groups(samples), pairs, anova(arrays), welch_anova(arrays))


def compare_lesions(results: pd.DataFrame, metric: str, intact: State) -> Comparison:
    """Compare the intact networks and their lesions, each with each, paired by seed.

    The groups are the lesions, "intact" first; their column ``fresh`` is the mean of fresh networks that were treated
    alike, NaN if there are none. The columns of ``pairs``: ``n`` seeds that both have; the mean
    ``difference`` (first − second) with its interval ``low`` to ``high`` by Student's t; Hedges' ``g`` of the pairs
    with its exact interval ``g_low`` to ``g_high``; ``p_paired`` of the paired t test alone; ``p_holm``, the same
    adjusted for all pairs of the table; ``note``.

    Args:
        results: long table (:mod:`bilateral_rl.analysis.results`), of one algorithm.
        metric: name of the metric.
        intact: the intact networks, retrained or not; their lesions are those that were treated alike, so that a
            lesion is all that sets the states apart.

    Raises:
        UserError: no intact or no lesioned network in the table, or two values of one seed.
    """
    rows = results[
        (results["metric"] == metric)
        & (results["task"] == intact.task)
        & (results["model"] == intact.model)
        & (results["protocol"] == intact.protocol)
        & (results["network"] == intact.network)
    ]
    present = list(dict.fromkeys(rows["lesion"]))
    if INTACT not in present or len(present) < 2:
        raise UserError(
            f"A comparison of lesions needs {metric} in {intact.task} of {intact.model}, "
            f"{protocol_words(intact.protocol)}, intact and with a lesion; there is {', '.join(present) or 'nothing'}: "
            "run `bilateral-rl lesion` first."
        )
    lesions = [INTACT, *(name for name in present if name != INTACT)]
    samples = {lesion: by_seed(results, metric, intact.after(lesion)) for lesion in lesions}
    fresh = [mean_interval(by_seed(results, metric, intact.after(lesion).control)).value for lesion in lesions]
    return Comparison(metric, intact.task, _groups(samples).assign(fresh=fresh), _lesion_pairs(samples))


def _check_not_empty(values: pd.Series, model: str, metric: str, task: str) -> None:
    if values.empty:
        raise UserError(f"There are no results of {metric} in {task} for {model}; evaluate it first, or leave it out.")


def _groups(samples: dict[str, pd.Series]) -> pd.DataFrame:
    rows = {}
    for name, values in samples.items():
        mean, numbers = bootstrap_mean(values), finite(values)
        sd = float(numbers.std(ddof=1)) if mean.n > 1 else float("nan")
        rows[name] = {"mean": mean.value, "sd": sd, "n": mean.n, "low": mean.low, "high": mean.high, "note": mean.note}
    return pd.DataFrame.from_dict(rows, orient="index")


def _model_pairs(names: Sequence[str], samples: Sequence[Float64]) -> pd.DataFrame:
    tukey, howell = tukey_hsd(samples), games_howell(samples)
    rows = []
    for (i, j), test in howell.items():
        a, b = samples[i], samples[j]
        difference, ratio, g = bootstrap_difference(a, b), bootstrap_ratio(a, b), hedges_g(a, b)
        row = {"first": names[i], "second": names[j], **_columns("difference", "", difference)}
        row |= _columns("ratio", "ratio_", ratio) | _columns("g", "g_", g)
        row |= {"p_tukey": tukey[i, j].p, "p_games_howell": test.p, "note": join_notes(test.note, ratio.note)}
        rows.append(row)
    return pd.DataFrame(rows)


def _lesion_pairs(samples: dict[str, pd.Series]) -> pd.DataFrame:
    rows = []
    for first, second in combinations(samples, 2):
        a, b = align(samples[first], samples[second])
        difference, test = difference_interval(a, b, paired=True), paired_test(a, b)
        row = {"first": first, "second": second, "n": difference.n, **_columns("difference", "", difference)}
        row |= _columns("g", "g_", hedges_g(a, b, paired=True)) | {"p_paired": test.p, "note": test.note}
        rows.append(row)
    table = pd.DataFrame(rows)
    table.insert(list(table).index("p_paired") + 1, "p_holm", holm(table["p_paired"]))
    return table


def _columns(name: str, prefix: str, interval: Interval) -> dict[str, object]:
    return {name: interval.value, f"{prefix}low": interval.low, f"{prefix}high": interval.high}
