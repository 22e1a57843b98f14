"""Intervals of means, differences, ratios and effects: against statsmodels, quadrature, and what defines them."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, stats

from bilateral_rl.analysis.bootstrap import bootstrap_difference, bootstrap_mean, bootstrap_ratio
from bilateral_rl.analysis.intervals import (
    difference_interval,
    hedges_g,
    mean_interval,
    ratio_interval,
    small_sample_correction,
    welch_df,
)

A, B = [4.1, 5.2, 6.3, 5.0, 4.4], [9.0, 4.0, 7.5, 11.2, 8.1, 6.3]
OF_TWO = [difference_interval, ratio_interval, hedges_g, bootstrap_difference, bootstrap_ratio]

values = st.floats(-100, 100).map(lambda x: round(x, 3))
samples = st.lists(values, min_size=3, max_size=8)
anything = st.lists(st.one_of(values, st.sampled_from([np.nan, np.inf, 0.0])), max_size=6)

each_of_two = pytest.mark.parametrize("interval", OF_TWO, ids=lambda f: f.__name__)


@pytest.fixture(autouse=True)
def _no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def bounds(interval):
    return interval.low, interval.high


def test_interval_of_a_mean_by_hand():
    # Mean 3, variance 2.5, t of 4 degrees of freedom 2.7764451.
    interval = mean_interval([1, 2, 3, 4, 5])
    assert interval.value == 3
    assert bounds(interval) == pytest.approx((3 - 2.7764451 * np.sqrt(0.5), 3 + 2.7764451 * np.sqrt(0.5)))
    assert (interval.n, interval.note) == (5, "")


def test_intervals_of_differences_are_those_of_statsmodels():
    # CompareMeans.tconfint_diff(usevar="unequal") and DescrStatsW(differences).tconfint_mean() of statsmodels 0.15.
    assert bounds(difference_interval(A, B)) == pytest.approx((-5.254846987416099, -0.11181967925056657))
    paired = difference_interval(B[:5], A, paired=True)
    assert bounds(paired) == pytest.approx((-0.7239984597559816, 6.643998459755982))


def test_hedges_g_against_quadrature():
    # Noncentral t integrated over the scaled chi, inverted by bisection.
    g, paired = hedges_g(A, B), hedges_g(B[:5], A, paired=True)
    assert (g.value, *bounds(g)) == pytest.approx((-1.2867264750580278, -2.492214313250439, -0.02703135319977568))
    expected = (0.7960061472050667, -0.11099763219755034, 1.6462605054286994)
    assert (paired.value, *bounds(paired)) == pytest.approx(expected)


@pytest.mark.parametrize("size", [0.0, 3.0, 1e2, 1e4])
def test_the_interval_of_an_effect_leaves_a_fortieth_on_either_side(size):
    a, b = np.array([0.0, 1.0, 2.0, 3.0]) + size, np.array([0.0, 1.0, 2.0, 3.0])
    g, df, scale = hedges_g(a, b), 6, np.sqrt(1 / 2)
    t = size / np.std(b, ddof=1) / scale
    for bound, probability in ((g.low, 0.975), (g.high, 0.025)):
        noncentrality = bound / small_sample_correction(df) / scale

        def below(x, nc=noncentrality):
            return stats.norm.cdf(t * x - nc) * stats.chi.pdf(x * np.sqrt(df), df) * np.sqrt(df)

        inside = [noncentrality / t] if t else None
        total, _ = integrate.quad(below, 0, 6, points=inside, limit=200)
        assert total == pytest.approx(probability, abs=2e-4)


def test_small_sample_correction_by_hand():
    # Γ(4) / (√4 Γ(7/2)) = 6 / (2 · 15/8 √π)
    assert small_sample_correction(8) == pytest.approx(6 / (2 * 15 / 8 * np.sqrt(np.pi)))
    assert small_sample_correction(2) == pytest.approx(1 / np.sqrt(np.pi))


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(1, 100), st.floats(-0.2, 0.2)), min_size=3, max_size=8))
def test_at_the_bounds_of_a_paired_ratio_the_t_test_is_at_its_limit(pairs):
    b = np.array([size for size, _ in pairs]).round(3)
    a = (1.2 * b + [noise for _, noise in pairs]).round(3)
    ratio = ratio_interval(a, b, paired=True)
    assert ratio.value == pytest.approx(a.mean() / b.mean())
    for bound in bounds(ratio):
        rest = a - bound * b
        if np.isfinite(bound) and np.ptp(rest) > 1e-3:
            assert stats.ttest_1samp(rest, 0.0).pvalue == pytest.approx(0.05, rel=1e-4)


def test_at_the_bounds_of_an_unpaired_ratio_welchs_t_is_at_its_limit():
    a, b = np.array(B), np.array(A)
    ratio = ratio_interval(a, b)
    limit = stats.t.isf(0.025, welch_df(a, ratio.value * b))
    for bound in bounds(ratio):
        error = np.sqrt(a.var(ddof=1) / len(a) + bound**2 * b.var(ddof=1) / len(b))
        assert abs(a.mean() - bound * b.mean()) / error == pytest.approx(limit)


def test_a_ratio_with_a_divisor_near_zero_is_unbounded():
    ratio = ratio_interval([1.0, 2.0, 3.0, 4.0, 5.0], [-1.0, 2.0, -2.0, 3.0, 0.5])
    assert bounds(ratio) == (-np.inf, np.inf)
    assert ratio.note == "the divisor is not clearly different from 0"
    zero = ratio_interval([1.0, 2.0], [0.0, 0.0])
    assert np.isnan(zero.value)
    assert bounds(zero) == (-np.inf, np.inf)


def test_a_paired_ratio_does_not_mind_what_both_have_in_common():
    b = np.array([50.0, 80.0, 65.0, 95.0, 71.0])
    a = b * np.array([0.99, 1.01, 1.0, 0.98, 1.02])
    paired, unpaired = ratio_interval(a, b, paired=True), ratio_interval(a, b)
    assert paired.high - paired.low < 0.2 * (unpaired.high - unpaired.low)


@settings(max_examples=50, deadline=None)
@given(samples, samples, st.floats(0.1, 10))
def test_differences_and_effects_are_antisymmetric_and_know_their_unit(a, b, scale):
    difference, back = difference_interval(a, b), difference_interval(b, a)
    assert (back.value, *bounds(back)) == pytest.approx((-difference.value, -difference.high, -difference.low))
    effect, opposite = hedges_g(a, b), hedges_g(b, a)
    expected = (-effect.value, -effect.high, -effect.low)
    assert (opposite.value, *bounds(opposite)) == pytest.approx(expected, rel=1e-6, abs=1e-9, nan_ok=True)
    scaled = hedges_g(scale * np.array(a), scale * np.array(b))
    assert scaled.value == pytest.approx(effect.value, rel=1e-6, abs=1e-9, nan_ok=True)
    wide = difference_interval(scale * np.array(a), scale * np.array(b))
    assert wide.high - wide.low == pytest.approx(scale * (difference.high - difference.low), abs=1e-9)


@settings(max_examples=50, deadline=None)
@given(samples, samples)
def test_intervals_and_tests_agree(a, b):
    p = stats.ttest_ind_from_stats(np.mean(a), np.std(a, ddof=1), len(a), np.mean(b), np.std(b, ddof=1), len(b), False)
    difference = difference_interval(a, b)
    if difference.low < difference.high and abs(p.pvalue - 0.05) > 1e-9:
        assert (p.pvalue < 0.05) == (difference.low > 0 or difference.high < 0)


@each_of_two
@pytest.mark.parametrize("paired", [False, True])
def test_no_seed_and_one_seed_have_no_interval(interval, paired):
    for a, b in (([], []), ([1.0], [2.0])):
        result = interval(a, b, paired)
        assert np.isnan(result.low)
        assert np.isnan(result.high)
        assert "no test" in result.note
    assert interval([1.0], [2.0], paired).n == 1


@each_of_two
@pytest.mark.parametrize("paired", [False, True])
@settings(max_examples=10, deadline=None)
@given(anything, anything)
def test_any_input_has_a_defined_result(interval, paired, a, b):
    n = min(len(a), len(b))
    result = interval(a[:n], b[:n], paired)
    assert np.isnan(result.low) == np.isnan(result.high)
    assert np.isnan(result.low) or result.low <= result.high
    assert result.note or result.n >= 5


def test_a_ratio_that_no_resample_changes_has_no_bootstrap_interval():
    for a, paired in (([0.0, 0.0], False), ([2.0, 4.0], True)):
        result = bootstrap_ratio(a, [1.0, 2.0], paired)
        assert result.value == a[1] / 2
        assert all(np.isnan(bounds(result)))
        assert "no interval" in result.note


def test_where_all_values_are_equal_the_interval_is_the_estimate():
    for paired in (False, True):
        for interval, value in ((difference_interval, 50.0), (ratio_interval, 2.0), (bootstrap_difference, 50.0)):
            result = interval([100.0] * 6, [50.0] * 6, paired)
            assert (result.value, *bounds(result)) == (value, value, value)
            assert result.note == "all values are equal: no test"
        assert bounds(mean_interval([0.1] * 6)) == (pytest.approx(0.1), pytest.approx(0.1))
        assert np.isnan(hedges_g([100.0] * 6, [50.0] * 6, paired).value)


def test_a_bootstrap_repeats_itself_and_is_that_of_scipy():
    first = bootstrap_mean(B)
    assert first == bootstrap_mean(B)
    scipys = stats.bootstrap((B,), np.mean, n_resamples=9_999, rng=np.random.default_rng(1)).confidence_interval
    assert bounds(first) == pytest.approx((scipys.low, scipys.high), rel=0.02)


def test_a_bootstrap_of_many_normal_values_is_students_interval():
    a = stats.norm.ppf((np.arange(200) + 0.5) / 200) + 10
    student = mean_interval(a)
    assert bounds(bootstrap_mean(a)) == pytest.approx(bounds(student), abs=0.01)
    doubled = difference_interval(2 * a, a)
    assert bounds(bootstrap_difference(2 * a, a)) == pytest.approx(bounds(doubled), abs=0.03)
    ratio = ratio_interval(2 * a, a)
    assert bounds(bootstrap_ratio(2 * a, a)) == pytest.approx(bounds(ratio), abs=0.005)


def test_a_bootstrap_of_pairs_resamples_pairs():
    b = np.array([50.0, 80.0, 65.0, 95.0, 71.0, 60.0])
    a = b + np.array([1.0, 2.0, 1.5, 2.5, 2.0, 1.2])
    for bootstrap in (bootstrap_difference, bootstrap_ratio):
        paired, unpaired = bootstrap(a, b, paired=True), bootstrap(a, b)
        assert paired.high - paired.low < 0.2 * (unpaired.high - unpaired.low)
        assert paired.value == unpaired.value


def test_a_bootstrapped_ratio_needs_a_divisor_of_one_sign():
    result = bootstrap_ratio([1.0] * 5, [1.0, 2.0, 0.0, 1.0, 3.0])
    assert np.isnan(result.value)
    assert result.note == "the divisor may be 0"
