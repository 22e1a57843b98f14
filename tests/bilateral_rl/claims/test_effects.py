"""Effects of components: one scale, on which the line of every claim is 0 and its side positive."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from made_up_results import make_results

from bilateral_rl.analysis.intervals import Interval
from bilateral_rl.claims import Criteria, evaluate_claims
from bilateral_rl.claims.effects import from_line, inside
from bilateral_rl.claims.rules import is_within

RADII = {"random_reach": 0.05, "hold_position": 0.05}
numbers = st.floats(-10, 10).map(lambda x: round(x, 3))


def bounds(interval):
    return interval.low, interval.value, interval.high


def test_a_direction_by_hand():
    difference = Interval(4.0, 1.0, 7.0, 10, "note")
    assert bounds(from_line(difference, 20.0)) == (0.05, 0.2, 0.35)
    assert bounds(from_line(difference, 20.0, -1)) == (-0.35, -0.2, -0.05)
    assert from_line(difference, 20.0).note == "note"
    assert all(map(math.isnan, bounds(from_line(difference, 0.0))))


def test_a_range_by_hand():
    assert bounds(inside(Interval(1.2, 1.1, 1.5, 9), 1.0, 1.4)) == pytest.approx((-0.1, 0.2, 0.2))
    assert bounds(inside(Interval(1.1, 1.05, 1.15, 9), 1.0, 1.4)) == pytest.approx((0.05, 0.1, 0.15))
    assert bounds(inside(Interval(1.5, 1.45, 1.6, 9), 1.0, 1.4)) == pytest.approx((-0.2, -0.1, -0.05))
    assert bounds(inside(Interval(96.0, 95.0, 97.0, 9), 93.0, math.inf, 96.0)) == pytest.approx(
        (2 / 96, 3 / 96, 4 / 96)
    )
    assert bounds(inside(Interval(0.7, -math.inf, math.inf, 9), -math.inf, 0.8)) == pytest.approx(
        (-math.inf, 0.1, math.inf)
    )
    assert all(map(math.isnan, bounds(inside(Interval(math.nan, math.nan, math.nan, 0), -math.inf, 0.8))))


@given(st.tuples(numbers, numbers, numbers).map(sorted), st.tuples(numbers, numbers).map(sorted))
def test_an_effect_is_above_zero_just_where_its_range_is_supported(estimate, line):
    low, value, high = estimate
    effect = inside(Interval(value, low, high, 10), *line)
    assume(min(abs(end - bound) for end in (low, high) for bound in line) > 1e-9)
    expected = "supported" if effect.low > 0 else "not supported" if effect.high < 0 else "undecided"
    assert is_within(Interval(value, low, high, 10), *line) == expected
    assert effect.low <= effect.value <= effect.high


def test_every_component_of_a_claim_that_holds_has_its_effect_on_the_claims_side():
    for claim in evaluate_claims(make_results(), Criteria(radii=RADII)):
        for component in claim.components:
            assert component.effect.value > (-0.02 if "not conclusively" in component.text else 0), component.text
            assert component.effect.n == component.estimate.n


def test_effects_are_shares_of_the_mean():
    claims = {claim.number: claim for claim in evaluate_claims(make_results(), Criteria(radii=RADII))}
    # 96.7 against 94.6 %; 22 for the dominant loss, and 30 for the other one, so 1.5 between 1.25 and 1.75.
    assert claims["C1"].components[2].effect.value == pytest.approx(2.1 / 95.65)
    assert claims["C3"].components[0].effect.value == pytest.approx(0.25)
    # Both sides of Bi-NS complete 75 %: all of the tenth is left.
    assert claims["C5"].components[0].effect.value == pytest.approx(0.1, abs=1e-9)
