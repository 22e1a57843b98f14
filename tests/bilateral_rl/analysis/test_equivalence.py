"""Two one-sided tests: by hand, against intervals, and by how often they are wrong."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy import stats

from bilateral_rl.analysis.equivalence import EACH_SIDE, equivalence_test
from bilateral_rl.analysis.intervals import ratio_interval

positive = st.floats(0.5, 100).map(lambda x: round(x, 3))


def test_a_paired_test_by_hand():
    a, b = np.array([9.4, 11.1, 10.1, 12.0, 11.0]), np.array([10.0, 11.0, 10.0, 11.0, 10.0])
    test = equivalence_test(a, b, 0.9, 1.1, paired=True)
    low = [0.4, 1.2, 1.1, 2.1, 2.0]  # a − 0.9 b
    high = [1.6, 1.0, 0.9, 0.1, 0.0]  # 1.1 b − a
    for p, rest in ((test.p_low, low), (test.p_high, high)):
        t = np.mean(rest) / (np.std(rest, ddof=1) / math.sqrt(5))
        assert p == pytest.approx(stats.t.sf(t, 4))
    assert test.p == max(test.p_low, test.p_high)
    assert test.name == "two one-sided paired t tests"
    # A table of t has 2.776 for 2.5 % of 4 degrees of freedom; here t is 1.36 / 0.314 = 4.33 and 0.72 / 0.299 = 2.41.
    assert test.p_low < EACH_SIDE < test.p_high


def test_a_difference_within_a_share_of_a_mean_is_a_ratio_of_the_differences():
    # d = 1, −1, 2, 0 of w = 20, 20, 20, 20: d + 2 and 2 − d are tested against 0.
    d, w = [1.0, -1.0, 2.0, 0.0], [20.0] * 4
    test = equivalence_test(d, w, -0.1, 0.1, paired=True)
    error = np.std(d, ddof=1) / 2
    assert test.p_low == pytest.approx(stats.t.sf((0.5 + 2) / error, 3))
    assert test.p_high == pytest.approx(stats.t.sf((2 - 0.5) / error, 3))


def test_welchs_is_that_of_scipy():
    a, b = np.array([9.0, 11.0, 10.5, 10.0]), np.array([10.0, 10.4, 9.9, 10.2, 10.1, 9.7])
    test = equivalence_test(a, b, 0.8, 1.25)
    assert test.p_low == pytest.approx(stats.ttest_ind(a, 0.8 * b, equal_var=False, alternative="greater").pvalue)
    assert test.p_high == pytest.approx(stats.ttest_ind(a, 1.25 * b, equal_var=False, alternative="less").pvalue)
    assert test.name == "two one-sided Welch t tests"


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(positive, st.floats(-0.3, 0.3)), min_size=2, max_size=8), st.floats(0.02, 0.5))
def test_a_paired_test_is_significant_just_where_fiellers_interval_lies_between_the_bounds(pairs, share):
    whole = np.array([size for size, _ in pairs])
    difference = whole * [noise for _, noise in pairs]
    test = equivalence_test(difference, whole, -share, share, paired=True)
    interval = ratio_interval(difference, whole, paired=True)
    assume(not math.isnan(test.p) and abs(test.p - EACH_SIDE) > 1e-9 and interval.low < interval.high)
    assert (test.p < EACH_SIDE) == (-share <= interval.low and interval.high <= share)
    if interval.low > share or interval.high < -share:  # shown to differ
        assert test.p > 1 - EACH_SIDE


@pytest.mark.parametrize("paired", [True, False])
def test_a_difference_at_the_bound_is_called_equivalent_in_a_fortieth_of_studies(paired):
    # Far from the other bound, each of the two tests has its whole size. Sides of one network are correlated.
    rng = np.random.default_rng(0)
    n, studies, margin = 10, 4000, 0.1
    network = rng.normal(10, 1, (studies, n))
    other = network if paired else rng.normal(10, 1, (studies, n))
    first = network * (1 + margin) + rng.normal(0, 0.3, (studies, n))
    found = sum(
        equivalence_test(a, b, -2.0, 1 + margin, paired).p < EACH_SIDE for a, b in zip(first, other, strict=True)
    )
    assert found / studies == pytest.approx(EACH_SIDE, abs=3 * math.sqrt(EACH_SIDE / studies))


def test_where_nothing_can_be_tested_there_is_no_p():
    for a, b, note in (
        ([], [], "0 seeds: no test"),
        ([1.0], [1.0], "1 seed: no test"),
        ([1.0, 1.0], [1.0, 1.0], "only 2 seeds; all values are equal: no test"),
        ([1.0, math.nan], [1.0, 2.0], "1 seed: no test; 1 value is no number"),
    ):
        test = equivalence_test(a, b, 0.9, 1.1, paired=True)
        assert math.isnan(test.p)
        assert test.note == note
