"""Tests of group means over seeds: the paper's, which assume equal variances, and those that do not.

The paper's way is the one-way analysis of variance with Tukey's HSD (paper section 7), the sound way Welch's analysis
with Games and Howell's procedure. SciPy computes the tests; where its own functions would warn of values without
spread, or evaluate every pair of groups twice, which takes a second for seven groups, its distributions are asked
directly. Values that are no numbers are left out, groups of fewer than two seeds take no part, and a test that cannot
be made has p = nan: its note says why.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from bilateral_rl.analysis.intervals import squared_error, welch_df
from bilateral_rl.analysis.samples import (
    Float,
    caveats,
    count_left_out,
    finite,
    has_spread,
    join_notes,
    pair_has_spread,
    usable,
)

ALPHA = 0.05
Pair = tuple[int, int]
"""Indices of two groups."""
PairP = Callable[[Float, Float], float]
"""p of two samples of at least two numbers each; nan where nothing spreads."""
_NAN = float("nan")


@dataclass(frozen=True)
class OmnibusTest:
    """Whether any of several group means differs."""

    name: str
    statistic: float
    """F."""
    df: tuple[float, float]
    p: float
    note: str = ""


@dataclass(frozen=True)
class PairTest:
    """Whether two means differ; of a family of comparisons, ``p`` is adjusted for all of them."""

    name: str
    difference: float
    """First − second."""
    p: float
    note: str = ""


def anova(groups: Sequence[ArrayLike]) -> OmnibusTest:
    """One-way analysis of variance, equal variances assumed.

    Args:
        groups: the values of each, (n,) of any n.
    """
    name, samples, note = "one-way ANOVA", *_groups(groups)
    if len(samples) < 2 or not any(has_spread(sample) for sample in samples):
        return OmnibusTest(name, _NAN, (_NAN, _NAN), _NAN, note)
    df = len(samples) - 1, sum(map(len, samples)) - len(samples)
    # Of equal means SciPy's F may be less than 0 by rounding, and its p then nan.
    statistic = max(float(stats.f_oneway(*samples).statistic), 0.0)
    return OmnibusTest(name, statistic, df, float(stats.f.sf(statistic, *df)), note)


def welch_anova(groups: Sequence[ArrayLike]) -> OmnibusTest:
    """Welch's one-way analysis of variance, equal variances not assumed; every group needs some spread.

    Source: Welch 1951, doi:10.1093/biomet/38.3-4.330.

    Args:
        groups: the values of each, (n,) of any n.
    """
    name, samples, note = "Welch's ANOVA", *_groups(groups)
    if len(samples) < 2 or not all(has_spread(sample) for sample in samples):
        mixed = len({has_spread(sample) for sample in samples}) > 1
        note = join_notes(note, "all values of a group are equal: no test" if mixed else "")
        return OmnibusTest(name, _NAN, (_NAN, _NAN), _NAN, note)
    result = stats.f_oneway(*samples, equal_var=False)
    weights = 1 / np.array([squared_error(sample) for sample in samples])
    rest = np.array([len(sample) - 1 for sample in samples])
    k = len(samples)
    df_within = (k**2 - 1) / (3 * float(np.sum((1 - weights / weights.sum()) ** 2 / rest)))
    return OmnibusTest(name, float(result.statistic), (k - 1, df_within), float(result.pvalue), note)


def tukey_hsd(groups: Sequence[ArrayLike], pairs: Iterable[Pair] | None = None) -> dict[Pair, PairTest]:
    """Tukey's HSD, of groups of unequal size Tukey–Kramer; equal variances are assumed.

    Sources: Tukey 1949, doi:10.2307/3001913; Kramer 1956, doi:10.2307/3001469.

    Args:
        groups: the values of each, (n,) of any n.
        pairs: the comparisons wanted, by the groups' indices; None for every i < j. The p-values are adjusted for all
            comparisons of the groups in either case, and each takes its time (10 ms).
    """
    tested = [sample for sample in map(finite, groups) if len(sample) > 1]
    df = sum(len(sample) - 1 for sample in tested)
    within = sum(len(sample) * float(sample.var()) for sample in tested) / max(df, 1)
    spread = any(has_spread(sample) for sample in tested)

    def p(a: Float, b: Float) -> float:
        error = within * (1 / len(a) + 1 / len(b))
        return _studentized_range_p(a, b, error, len(tested), df) if spread else _NAN

    return _post_hoc("Tukey's HSD", groups, pairs, p)


def games_howell(groups: Sequence[ArrayLike], pairs: Iterable[Pair] | None = None) -> dict[Pair, PairTest]:
    """Games and Howell's procedure, which does not assume equal variances; arguments as of :func:`tukey_hsd`.

    Source: Games & Howell 1976, doi:10.3102/10769986001002113.
    """
    k = sum(len(finite(group)) > 1 for group in groups)

    def p(a: Float, b: Float) -> float:
        if not pair_has_spread(a, b, paired=False):
            return _NAN
        return _studentized_range_p(a, b, squared_error(a) + squared_error(b), k, welch_df(a, b))

    return _post_hoc("Games–Howell", groups, pairs, p)


def welch_test(first: ArrayLike, second: ArrayLike) -> PairTest:
    """Welch's t test of two independent samples."""

    def p(a: Float, b: Float) -> float:
        if not pair_has_spread(a, b, paired=False):
            return _NAN
        first, second = ((x.mean(), x.std(ddof=1), len(x)) for x in (a, b))
        return float(stats.ttest_ind_from_stats(*first, *second, equal_var=False).pvalue)

    return _pair_test("Welch's t test", first, second, p)


def paired_test(first: ArrayLike, second: ArrayLike) -> PairTest:
    """Student's t test of pairs, (n,) each.

    Raises:
        ValueError: samples of different length.
    """

    def p(a: Float, b: Float) -> float:
        return float(stats.ttest_rel(a, b).pvalue) if pair_has_spread(a, b, paired=True) else _NAN

    return _pair_test("paired t test", first, second, p, paired=True)


def holm(p: ArrayLike) -> Float:
    """(m,): p-values adjusted for their number, step by step; nan stays nan and does not count.

    Source: Holm 1979, Scandinavian Journal of Statistics 6.

    Args:
        p: (m,) of one family.
    """
    raw = np.asarray(p, dtype=np.float64)
    adjusted = np.full(raw.shape, np.nan)
    order = np.argsort(raw)[: np.count_nonzero(~np.isnan(raw))]
    factors = np.arange(len(order), 0, -1)
    adjusted[order] = np.minimum(np.maximum.accumulate(factors * raw[order]), 1.0)
    return adjusted


def _post_hoc(name: str, groups: Sequence[ArrayLike], pairs: Iterable[Pair] | None, p: PairP) -> dict[Pair, PairTest]:
    wanted = combinations(range(len(groups)), 2) if pairs is None else pairs
    return {(i, j): _pair_test(name, groups[i], groups[j], p) for i, j in wanted}


def _pair_test(name: str, first: ArrayLike, second: ArrayLike, p: PairP, paired: bool = False) -> PairTest:
    a, b = usable(first, second, paired)
    n = min(len(a), len(b))
    difference = float(a.mean() - b.mean()) if n else _NAN
    value = p(a, b) if n > 1 else _NAN
    note = caveats(n, count_left_out(first, second, paired), spread=not np.isnan(value))
    return PairTest(name, difference, value, note)


def _studentized_range_p(a: Float, b: Float, squared_error_of_difference: float, k: int, df: float) -> float:
    q = abs(a.mean() - b.mean()) / np.sqrt(squared_error_of_difference / 2)
    return float(np.clip(stats.studentized_range.sf(q, k, df), 0.0, 1.0))


def _groups(groups: Sequence[ArrayLike]) -> tuple[list[Float], str]:
    """The samples that can be tested, and what must be said of them all."""
    numbers = [finite(group) for group in groups]
    samples = [sample for sample in numbers if len(sample) > 1]
    left_out = sum(np.size(group) for group in groups) - sum(map(len, numbers))
    smallest = min(map(len, samples), default=0)
    note = caveats(smallest, left_out, any(has_spread(sample) for sample in samples)) if len(samples) > 1 else ""
    without = len(groups) - len(samples)
    if without:
        note = join_notes(note, f"{without} of {len(groups)} groups with fewer than 2 seeds take no part")
    return samples, note
