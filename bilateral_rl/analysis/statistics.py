"""Tests of group means over seeds: the paper's, which assume equal variances, and those that do not.

The paper's way is the one-way analysis of variance with Tukey's HSD (paper section 7), the sound way Welch's analysis
with Games and Howell's procedure. SciPy computes the tests; but its distributions are used directly where its own
functions would warn of values without spread, or evaluate every pair of groups twice: its post-hoc tests of seven
groups take 0.4 to 0.5 s, these half of that, for the same p-values. Values that are not finite are left out, groups of
fewer than two seeds take no part, and a test that cannot be made has p = NaN and a note that says why.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from bilateral_rl.analysis.intervals import squared_error, welch_df
from bilateral_rl.analysis.samples import (
    Float64,
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
PairP = Callable[[Float64, Float64], float]
"""Computes the p-value of two samples of at least two numbers each; NaN where nothing spreads."""
_NAN = float("nan")


@dataclass(frozen=True)
class OmnibusTest:
    """A test whether any of several group means differs."""

    name: str
    statistic: float
    """The statistic F."""
    df: tuple[float, float]
    """Degrees of freedom between and within the groups."""
    p: float
    note: str = ""


@dataclass(frozen=True)
class PairTest:
    """A test whether two means differ; in a family of comparisons, ``p`` is adjusted for all of them."""

    name: str
    difference: float
    """Mean of the first minus mean of the second."""
    p: float
    note: str = ""


def anova(groups: Sequence[ArrayLike]) -> OmnibusTest:
    """One-way analysis of variance; it assumes equal variances.

    Args:
        groups: the values of each group, (n,) of any n.
    """
    name, samples, note = "one-way ANOVA", *_groups(groups)
    if len(samples) < 2 or not any(has_spread(sample) for sample in samples):
        return OmnibusTest(name, _NAN, (_NAN, _NAN), _NAN, note)
    df = len(samples) - 1, sum(map(len, samples)) - len(samples)
    # Where all means are equal, rounding can bring SciPy's F below 0, and its p would be NaN.
    statistic = max(float(stats.f_oneway(*samples).statistic), 0.0)
    return OmnibusTest(name, statistic, df, float(stats.f.sf(statistic, *df)), note)


def welch_anova(groups: Sequence[ArrayLike]) -> OmnibusTest:
    """Welch's one-way analysis of variance, which does not assume equal variances; every group needs some spread.

    Source: Welch 1951, doi:10.1093/biomet/38.3-4.330.

    Args:
        groups: the values of each group, (n,) of any n.
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
    """Tukey's HSD (Tukey–Kramer where groups differ in size); it assumes equal variances.

    Sources: Tukey 1949, doi:10.2307/3001913; Kramer 1956, doi:10.2307/3001469.

    Args:
        groups: the values of each group, (n,) of any n.
        pairs: which groups to compare, by their indices; None for every i < j. In either case the p-values are
            adjusted for all comparisons of the groups; each takes 10 ms.
    """
    tested = [sample for sample in map(finite, groups) if len(sample) > 1]
    df = sum(len(sample) - 1 for sample in tested)
    within = sum(len(sample) * float(sample.var()) for sample in tested) / max(df, 1)
    if not any(has_spread(sample) for sample in tested):
        within = 0.0
    return _post_hoc("Tukey's HSD", groups, pairs, partial(_tukey_p, within=within, k=len(tested), df=df))


def games_howell(groups: Sequence[ArrayLike], pairs: Iterable[Pair] | None = None) -> dict[Pair, PairTest]:
    """Games and Howell's procedure, which does not assume equal variances; the arguments are :func:`tukey_hsd`'s.

    Source: Games & Howell 1976, doi:10.3102/10769986001002113.
    """
    k = sum(len(finite(group)) > 1 for group in groups)
    return _post_hoc("Games–Howell", groups, pairs, partial(_games_howell_p, k=k))


def welch_test(first: ArrayLike, second: ArrayLike) -> PairTest:
    """Welch's t test of two independent samples, (n,) of any n."""
    return _pair_test("Welch's t test", first, second, _welch_p)


def paired_test(first: ArrayLike, second: ArrayLike) -> PairTest:
    """Student's t test of pairs, (n,) each.

    Raises:
        ValueError: samples of different length.
    """
    return _pair_test("paired t test", first, second, _paired_p, paired=True)


def holm(p_values: ArrayLike) -> Float64:
    """Adjust p-values for their number by Holm's step-down procedure, (m,); NaN stays NaN and does not count.

    Source: Holm 1979, Scandinavian Journal of Statistics 6.

    Args:
        p_values: (m,), those of one family.
    """
    raw = np.asarray(p_values, dtype=np.float64)
    adjusted = np.full(raw.shape, np.nan)
    order = np.argsort(raw)[: np.count_nonzero(~np.isnan(raw))]
    factors = np.arange(len(order), 0, -1)
    adjusted[order] = np.minimum(np.maximum.accumulate(factors * raw[order]), 1.0)
    return adjusted


def _tukey_p(a: Float64, b: Float64, within: float, k: int, df: int) -> float:
    """p-value from the pooled variance ``within`` the ``k`` groups, which has ``df`` degrees of freedom."""
    return _studentized_range_p(a, b, within * (1 / len(a) + 1 / len(b)), k, df) if within else _NAN


def _games_howell_p(a: Float64, b: Float64, k: int) -> float:
    if not pair_has_spread(a, b, paired=False):
        return _NAN
    return _studentized_range_p(a, b, squared_error(a) + squared_error(b), k, welch_df(a, b))


def _welch_p(a: Float64, b: Float64) -> float:
    if not pair_has_spread(a, b, paired=False):
        return _NAN
    first, second = ((x.mean(), x.std(ddof=1), len(x)) for x in (a, b))
    return float(stats.ttest_ind_from_stats(*first, *second, equal_var=False).pvalue)


def _paired_p(a: Float64, b: Float64) -> float:
    return float(stats.ttest_rel(a, b).pvalue) if pair_has_spread(a, b, paired=True) else _NAN


def _post_hoc(
    name: str, groups: Sequence[ArrayLike], pairs: Iterable[Pair] | None, pair_p: PairP
) -> dict[Pair, PairTest]:
    pairs = combinations(range(len(groups)), 2) if pairs is None else pairs
    return {(i, j): _pair_test(name, groups[i], groups[j], pair_p) for i, j in pairs}


def _pair_test(name: str, first: ArrayLike, second: ArrayLike, pair_p: PairP, paired: bool = False) -> PairTest:
    a, b = usable(first, second, paired)
    n = min(len(a), len(b))
    difference = float(a.mean() - b.mean()) if n else _NAN
    p = pair_p(a, b) if n > 1 else _NAN
    note = caveats(n, count_left_out(first, second, paired), varied=not np.isnan(p))
    return PairTest(name, difference, p, note)


def _studentized_range_p(a: Float64, b: Float64, squared_error_of_difference: float, k: int, df: float) -> float:
    q = abs(a.mean() - b.mean()) / np.sqrt(squared_error_of_difference / 2)
    return float(np.clip(stats.studentized_range.sf(q, k, df), 0.0, 1.0))


def _groups(groups: Sequence[ArrayLike]) -> tuple[list[Float64], str]:
    """Return the samples that can be tested, and what must be said about them all."""
    numbers = [finite(group) for group in groups]
    samples = [sample for sample in numbers if len(sample) > 1]
    left_out = sum(np.size(group) for group in groups) - sum(map(len, numbers))
    smallest = min(map(len, samples), default=0)
    note = caveats(smallest, left_out, any(has_spread(sample) for sample in samples)) if len(samples) > 1 else ""
    without = len(groups) - len(samples)
    if without:
        note = join_notes(note, f"{without} of {len(groups)} groups with fewer than 2 seeds take no part")
    return samples, note
