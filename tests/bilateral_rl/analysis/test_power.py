"""The seeds that a test needs: against tables, SciPy, and simulated studies."""

import math

import numpy as np
import pytest
from scipy import stats

from bilateral_rl.analysis.equivalence import EACH_SIDE, equivalence_test
from bilateral_rl.analysis.power import MOST_SEEDS, POWER, Design, Spread, _games_howell_critical
from bilateral_rl.analysis.statistics import games_howell, holm, paired_test, welch_test

KNOWN = 10**6
"""Seeds of an exploration after which the standard deviation is as good as known."""
STUDIES = 2000


def near(power, studies=STUDIES):
    return pytest.approx(power, abs=3.5 * math.sqrt(power * (1 - power) / studies) + 0.002)


def test_the_limit_of_a_standard_deviation_by_a_table():
    # χ² of 4 degrees of freedom is above 1.649 with 80 %.
    assert Spread(1.0, 5).upper == pytest.approx(math.sqrt(4 / 1.6488), rel=1e-4)
    assert math.isnan(Spread(1.0, 1).upper)


def test_the_limit_covers_the_true_standard_deviation_in_four_of_five_explorations():
    rng = np.random.default_rng(0)
    sds = rng.normal(0, 2.0, (STUDIES, 5)).std(axis=1, ddof=1)
    assert np.mean([Spread(sd, 5).upper > 2.0 for sd in sds]) == near(0.8)


@pytest.mark.parametrize(("effect", "n"), [(0.5, 34), (0.8, 15), (1.0, 10), (2.0, 5)])
def test_seeds_of_a_paired_test_are_those_of_the_tables(effect, n):
    # Cohen's d_z, two-sided 5 %, power 80 %: G*Power 3.1 gives these numbers of pairs.
    assert Design("direction", effect, (Spread(1.0, KNOWN),)).seeds() == n


@pytest.mark.parametrize(("effect", "n"), [(0.8, 26), (1.0, 17), (2.0, 6)])
def test_seeds_of_two_groups_are_those_of_the_tables(effect, n):
    # Cohen's d, two-sided 5 %, power 80 %: G*Power 3.1 gives these numbers a group.
    assert Design("direction", effect, (Spread(1.0, KNOWN),) * 2).seeds() == n


@pytest.mark.parametrize("n", [2, 5, 30])
@pytest.mark.parametrize("effect", [0.2, 1.0, 3.0])
def test_the_power_of_a_direction_is_that_of_the_noncentral_t(n, effect):
    limit = stats.t.isf(0.025, n - 1)
    expected = stats.nct.sf(limit, n - 1, effect * math.sqrt(n))
    assert Design("direction", effect, (Spread(1.0, KNOWN),)).power(n) == pytest.approx(expected, abs=2e-3)


def test_an_uncertain_spread_takes_more_seeds():
    explored = [Design("direction", 1.0, (Spread(1.0, n),)).seeds() for n in (3, 5, 10, KNOWN)]
    assert explored == sorted(explored, reverse=True)
    assert explored[0] > 2 * explored[-1]


def test_power_of_a_paired_test_by_simulation():
    rng = np.random.default_rng(1)
    design = Design("direction", 0.9, (Spread(1.0, KNOWN),))
    n = 9
    found = [paired_test(x, np.zeros(n)).p < 0.05 and x.mean() > 0 for x in rng.normal(0.9, 1, (STUDIES, n))]
    assert np.mean(found) == near(design.power(n))


def test_power_of_welchs_test_by_simulation():
    rng = np.random.default_rng(2)
    design = Design("direction", 3.0, (Spread(1.0, KNOWN), Spread(3.0, KNOWN)))
    n = 9
    pairs = zip(rng.normal(3, 1, (STUDIES, n)), rng.normal(0, 3, (STUDIES, n)), strict=True)
    assert np.mean([welch_test(a, b).p < 0.05 and a.mean() > b.mean() for a, b in pairs]) == near(design.power(n))


def test_power_of_holms_strictest_step_by_simulation():
    # Only one of four differs, so its p-value is the smallest of the family wherever it counts.
    rng = np.random.default_rng(3)
    n, studies, design = 12, 800, Design("direction", 1.0, (Spread(1.0, KNOWN),), comparisons=4)
    found = 0
    for x in rng.normal(0, 1, (studies, 4, n)):
        x[0] += 1.0
        p = [paired_test(values, np.zeros(n)).p for values in x]
        found += holm(p)[0] < 0.05 and p[0] == min(p)
    assert found / studies == near(design.power(n), studies)


def test_power_of_games_and_howell_by_simulation():
    rng = np.random.default_rng(4)
    n, studies = 10, 300  # each takes 10 ms
    design = Design("direction", 1.8, (Spread(1.0, KNOWN),) * 2, groups=7)
    found = 0
    for x in rng.normal(0, 1, (studies, 7, n)):
        x[0] += 1.8
        found += games_howell(x, [(0, 1)])[0, 1].p < 0.05
    assert found / studies == near(design.power(n), studies)


@pytest.mark.parametrize("df", [1.1, 2.3, 5.5, 9.0, 17.3, 47.0, 98.0])
def test_the_limit_of_games_and_howell_is_that_of_the_studentized_range(df):
    exact = stats.studentized_range.isf(0.05, 7, df) / math.sqrt(2)
    assert _games_howell_critical(7, df) == pytest.approx(exact, rel=0.002)


@pytest.mark.parametrize("paired", [True, False])
def test_power_of_two_one_sided_tests_by_simulation(paired):
    # The mean of what they are a share of is known here, 10 ± 0, so that the bound is 1 to either side.
    rng = np.random.default_rng(5)
    n, sd = 8, 0.6
    design = Design("equivalence", 1.0, (Spread(sd, KNOWN),) * (1 if paired else 2))
    tens = np.full(n, 10.0)
    found = 0
    for a, b in rng.normal(10, sd, (STUDIES, 2, n)):
        other = tens if paired else b
        found += equivalence_test(a, other, 0.9, 1.1, paired).p < EACH_SIDE
    assert found / STUDIES == near(design.power(n))


def test_two_one_sided_tests_need_room_between_the_bounds():
    assert Design("equivalence", 0.01, (Spread(1.0, KNOWN),)).power(5) < 0.01
    assert Design("equivalence", 5.0, (Spread(1.0, KNOWN),)).seeds() == 3


def test_what_needs_more_than_the_most_seeds_has_no_number():
    hopeless, just = (Design("direction", d, (Spread(1.0, KNOWN),)) for d in (0.39, 0.41))
    assert hopeless.seeds() is None
    assert hopeless.power(MOST_SEEDS) < POWER
    assert just.seeds() <= MOST_SEEDS
    assert just.power(just.seeds()) >= POWER > just.power(just.seeds() - 1)


def test_what_cannot_be_said_has_no_number():
    unknown = Design("direction", 1.0, (Spread(math.nan, 1),))
    assert math.isnan(unknown.power(10))
    assert unknown.seeds() is None
    assert Design("direction", 0.0, (Spread(0.0, 5),)).seeds() is None  # a mean of 0 leaves no effect


def test_without_any_spread_two_seeds_do_unless_the_rule_asks_for_more():
    assert Design("direction", 1.0, (Spread(0.0, 5),)).seeds() == 2
    assert Design("direction", 1.0, (Spread(0.0, 5),), at_least=10).seeds() == 10
