"""What a confirmation is planned for, component by component."""

import math

import numpy as np
import pytest
from made_up_results import make_results

from bilateral_rl.analysis.power import Spread
from bilateral_rl.claims import Criteria, designs, evaluate_claims

RADII = {"random_reach": 0.05, "hold_position": 0.05}


@pytest.fixture(scope="module")
def planned():
    claims = evaluate_claims(make_results(noise=0.1), Criteria(radii=RADII))
    return {claim.number: [component.design for component in claim.components] for claim in claims}


def test_a_direction_is_planned_for_a_tenth_of_the_mean_at_its_familys_strictest_step(planned):
    # CC-S: the dominant side completes 80 %, the other one 60 %; the family has two tests.
    reach, _ = planned["C7"]
    assert (reach.kind, reach.effect, reach.comparisons) == ("direction", pytest.approx(7.0), 2)
    assert len(reach.spreads) == 1  # pairs
    assert reach.spreads[0].n == 10
    assert {design.comparisons for design in planned["C4"]} == {10}
    assert [len(design.spreads) for design in planned["C4"]] == [1, 1, *[2] * 8]
    assert planned["C1"][2].comparisons == 1


def test_models_are_compared_in_their_family_of_seven(planned):
    assert {design.groups for design in planned["C12"]} == {7}
    first = planned["C12"][0]
    assert [spread.sd for spread in first.spreads] == pytest.approx([2.6, 2.2])
    assert first.effect == pytest.approx(2.4)


def test_that_nothing_is_conclusive_takes_as_many_seeds_as_the_papers(planned):
    assert [design.at_least for design in planned["C10"]] == [*[2] * 6, *[10] * 3, *[2] * 6]


def test_ranges_are_planned_for_their_middle_and_bounds_for_equality(planned):
    assert [design.kind for design in planned["C1"]] == ["equivalence", "equivalence", "direction"]
    assert planned["C1"][0].effect == pytest.approx(2.0)
    assert planned["C3"][0].effect == pytest.approx(0.25 * 20)  # steps of Uni-DL
    assert planned["C5"][0].effect == pytest.approx(0.1 * 75)
    recovered, dropped, as_shallow = planned["C8"][:3]
    assert recovered.effect == pytest.approx(0.05 * 96.3)
    assert dropped.effect == pytest.approx(0.1 * 36)
    assert as_shallow.effect == pytest.approx(0.1 * 36)
    assert planned["C9"][0].effect == pytest.approx(3.5)  # between 93 and 100 %


def test_the_spread_of_a_ratio_is_that_of_what_is_tested():
    first, second = np.array([9.0, 11.0, 10.0, 12.0]), np.array([10.0, 10.0, 12.0, 11.0])
    design = designs.of_ratio(first, second, 0.9, 1.2, paired=True)
    sds = [np.std(first - bound * second, ddof=1) for bound in (0.9, 1.2)]
    assert design.spreads == (Spread(pytest.approx(max(sds)), 4),)
    apart = designs.of_ratio(first, second, 0.95, math.inf, paired=False)
    assert [spread.sd for spread in apart.spreads] == pytest.approx(
        [np.std(first, ddof=1), 0.95 * np.std(second, ddof=1)]
    )


def test_one_seed_plans_nothing():
    for claim in evaluate_claims(make_results(seeds=1), Criteria(radii=RADII)):
        assert all(component.design.seeds() is None for component in claim.components)


def test_what_is_missing_plans_nothing():
    for claim in evaluate_claims(make_results().iloc[:0], Criteria(radii=RADII)):
        assert all(component.design is None for component in claim.components)
