"""Tests of group means: against hand-computed numbers, SciPy's own post-hoc tests and statsmodels' results."""

import warnings
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from bilateral_rl.analysis.statistics import (
    anova,
    games_howell,
    holm,
    paired_test,
    tukey_hsd,
    welch_anova,
    welch_test,
)

UNEQUAL = [[4.1, 5.2, 6.3, 5.0, 4.4], [6.0, 6.1, 6.4, 5.9], [9.0, 4.0, 7.5, 11.2, 8.1, 6.3]]

values = st.floats(-100, 100).map(lambda x: round(x, 3))
samples = st.lists(values, min_size=2, max_size=8)
anything = st.lists(st.one_of(values, st.sampled_from([np.nan, np.inf, -np.inf, 7.0])), max_size=6)
probabilities = st.lists(st.one_of(st.floats(0, 1), st.just(np.nan)), max_size=12)


@pytest.fixture(autouse=True)
def _no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def test_analysis_of_variance_by_hand():
    # Means 2, 3 and 6 around 11/3: between 26 with 2 degrees of freedom, within 6 with 6. With two degrees of freedom
    # above, p = (1 + 2 F / df)^(−df / 2).
    test = anova([[1, 2, 3], [2, 3, 4], [5, 6, 7]])
    assert test.statistic == pytest.approx(13)
    assert test.df == (2, 6)
    assert test.p == pytest.approx((1 + 26 / 6) ** -3)
    assert test.note == "only 3 seeds"


def test_equal_means_do_not_differ():
    # SciPy's F of these is less than 0, by rounding.
    test = anova([[0.0, 0.0, 1.562, 22.188], [0.0, 2.188, 4.562, 17.0]])
    assert (test.statistic, test.p) == (0.0, 1.0)


def test_welchs_analysis_of_variance_is_that_of_statsmodels():
    # anova_oneway(use_var="unequal") of statsmodels 0.15.
    test = welch_anova(UNEQUAL)
    assert test.statistic == pytest.approx(4.752785866578271)
    assert test.df == pytest.approx((2, 6.462779692789505))
    assert test.p == pytest.approx(0.05377475659316484)


def test_post_hoc_tests_are_those_of_statsmodels():
    # pairwise_tukeyhsd of statsmodels 0.15, use_var "equal" and "unequal".
    tukey, howell = tukey_hsd(UNEQUAL), games_howell(UNEQUAL)
    assert [test.p for test in tukey.values()] == pytest.approx([0.59587939, 0.04901301, 0.33288417], abs=1e-7)
    assert [test.p for test in howell.values()] == pytest.approx([0.09034231, 0.09579532, 0.33392724], abs=1e-7)
    assert [-test.difference for test in howell.values()] == pytest.approx([1.1, 2.68333333, 1.58333333])


def test_post_hoc_tests_are_those_of_scipy():
    rng = np.random.default_rng(0)
    groups = [rng.normal(i / 2, 1 + i, 10 - i) for i in range(4)]
    for own, equal_var in ((tukey_hsd, True), (games_howell, False)):
        reference = stats.tukey_hsd(*groups, equal_var=equal_var).pvalue
        assert list(own(groups)) == list(combinations(range(4), 2))
        assert own(groups, [(3, 1)])[3, 1].p == own(groups)[1, 3].p
        for pair, test in own(groups).items():
            assert test.p == pytest.approx(reference[pair], rel=1e-6)


def test_t_tests_are_those_of_statsmodels():
    # CompareMeans.ttest_ind(usevar="unequal") and DescrStatsW(differences).ttest_mean() of statsmodels 0.15.
    a, b = UNEQUAL[0], UNEQUAL[2]
    assert welch_test(a, b).p == pytest.approx(0.04316713500207592)
    assert paired_test(b[:5], a).p == pytest.approx(0.08953097191971159)


def test_holm_by_hand():
    # Sorted .005 .01 .03 .04 .2, times 5 4 3 2 1: .025 .04 .09 .08 .2, none below the one before.
    assert holm([0.01, 0.04, 0.03, 0.005, 0.2]) == pytest.approx([0.04, 0.09, 0.09, 0.025, 0.2])
    assert holm([0.6, np.nan, 0.02]) == pytest.approx([0.6, np.nan, 0.04], nan_ok=True)


@given(probabilities)
def test_holm_adjusts_upward_keeps_the_order_and_leaves_nan_alone(p):
    raw, adjusted = np.array(p, dtype=float), holm(p)
    there = ~np.isnan(raw)
    assert np.array_equal(np.isnan(adjusted), ~there)
    assert np.all(adjusted[there] >= raw[there])
    assert np.all(adjusted[there] <= np.minimum(1, there.sum() * raw[there]) + 1e-15)
    order = np.argsort(raw[there])
    assert np.all(np.diff(adjusted[there][order]) >= 0)
    assert np.array_equal(holm(raw[there]), adjusted[there])


@settings(max_examples=12, deadline=None)
@given(st.lists(samples, min_size=2, max_size=3), st.floats(0.01, 100), st.floats(-50, 50))
def test_tests_do_not_depend_on_unit_origin_or_order(groups, scale, shift):
    moved = [scale * np.array(group) + shift for group in groups]
    swapped = groups[::-1]
    for test in (anova, welch_anova):
        for other in (moved, swapped):
            assert test(other).p == pytest.approx(test(groups).p, rel=1e-4, abs=1e-8, nan_ok=True)
    for family in (tukey_hsd, games_howell):
        last = len(groups) - 1
        first = family(groups)
        for (i, j), test in family(swapped).items():
            there = first[last - j, last - i]
            assert test.p == pytest.approx(there.p, rel=1e-6, abs=1e-9, nan_ok=True)
            assert test.difference == pytest.approx(-there.difference)


@settings(max_examples=25, deadline=None)
@given(samples, samples)
def test_two_groups_are_a_t_test(a, b):
    # Of two groups Games–Howell and Welch's analysis are Welch's t test, Tukey's HSD and the analysis Student's.
    welch = welch_test(a, b).p
    assert games_howell([a, b])[0, 1].p == pytest.approx(welch, abs=1e-6, nan_ok=True)
    if not np.isnan(welch_anova([a, b]).p):
        assert welch_anova([a, b]).p == pytest.approx(welch, abs=1e-8)
    assert tukey_hsd([a, b])[0, 1].p == pytest.approx(anova([a, b]).p, abs=1e-6, nan_ok=True)
    assert welch_test(b, a).p == pytest.approx(welch, nan_ok=True)


@settings(max_examples=50, deadline=None)
@given(st.lists(anything, max_size=3))
def test_any_input_has_a_defined_result(groups):
    for test in (anova(groups), welch_anova(groups), *tukey_hsd(groups).values(), *games_howell(groups).values()):
        assert 0 <= test.p <= 1 or (np.isnan(test.p) and (test.note or len(groups) < 2))
    if len(groups) > 1:
        n = min(len(groups[0]), len(groups[1]))
        for test in (welch_test(*groups[:2]), paired_test(groups[0][:n], groups[1][:n])):
            assert 0 <= test.p <= 1 or (np.isnan(test.p) and test.note)


def test_what_cannot_be_tested_says_why():
    assert welch_test([1.0], [1.0, 2.0]).note == "1 seed: no test"
    assert welch_test([], [1.0, 2.0]).note == "0 seeds: no test"
    assert paired_test([1.0, 2.0, 3.0], [2.0, 3.0, 4.0]).note == "only 3 seeds; all values are equal: no test"
    assert anova([[1.0, 1.0], [2.0, 2.0]]).note == "only 2 seeds; all values are equal: no test"
    assert welch_anova([[1.0, 2.0], [2.0, 2.0]]).note == "only 2 seeds; all values of a group are equal: no test"
    assert games_howell([[1.0, 1.0], [1.0, 1.0]])[0, 1].note == "only 2 seeds; all values are equal: no test"
    for test in (welch_test([1.0], [1.0, 2.0]), paired_test([1.0, 2.0], [2.0, 3.0]), anova([[1.0, 1.0], [2.0, 2.0]])):
        assert np.isnan(test.p)


def test_values_that_are_no_numbers_are_left_out_and_counted():
    a, b = [1.0, 2.0, np.nan, 4.0, 5.0, 6.0], [3.0, np.inf, 5.0, 6.0, 9.0, 7.0]
    assert welch_test(a, b).p == welch_test([1, 2, 4, 5, 6], [3, 5, 6, 9, 7]).p
    assert welch_test(a, b).note == "2 values are no numbers"
    assert paired_test(a, b).p == paired_test([1, 4, 5, 6], [3, 6, 9, 7]).p
    assert paired_test(a, b).note == "only 4 seeds; 2 values are no numbers"


def test_groups_too_small_take_no_part():
    groups = [[1.0, 2.0, 3.0, 2.5, 2.2], [5.0], [4.0, 5.0, 7.0, 4.4, 5.1]]
    assert anova(groups).p == anova([groups[0], groups[2]]).p
    assert anova(groups).note == "1 of 3 groups with fewer than 2 seeds take no part"
    assert tukey_hsd(groups)[0, 2].p == tukey_hsd([groups[0], groups[2]])[0, 1].p
    assert np.isnan(games_howell(groups)[0, 1].p)


def test_a_group_without_spread_can_be_compared_with_one_that_has_some():
    constant, other = [100.0] * 10, list(np.linspace(90, 99, 10))
    assert games_howell([constant, other])[0, 1].p < 0.001
    # Then the other's mean is tested against a constant.
    assert welch_test(constant, other).p == pytest.approx(float(stats.ttest_1samp(other, 100.0).pvalue))


def test_pairs_must_be_pairs():
    with pytest.raises(ValueError, match="equal length"):
        paired_test([1, 2, 3], [1, 2])
