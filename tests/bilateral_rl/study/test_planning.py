"""Seeds of a confirmation: a claim needs what its most demanding component needs."""

import math
from dataclasses import replace

import pytest
from made_up_answers import S, component, judgement, missing

from bilateral_rl.analysis.power import Design, Spread
from bilateral_rl.claims import Claim
from bilateral_rl.study.answer import Answer
from bilateral_rl.study.planning import demand_in_words, seeds_of, seeds_of_components, seeds_table


def planned(sd, text="a > b", n=10**6, **values):
    """A component with a difference of 1 to be found, paired, among this spread."""
    return component(S, text=text, design=Design("direction", 1.0, (Spread(sd, n),), **values))


EASY, HARD, HOPELESS = planned(1.0, "easy"), planned(2.0, "hard"), planned(4.0, "hopeless")
UNKNOWN = planned(math.nan, "unknown", n=1)


def claim(*components):
    return Claim("C1", "A claim.", components)


def test_a_claim_needs_the_largest_number_of_its_components():
    # A paired test of d_z 1 and ½ takes 10 and 34 pairs (G*Power 3.1).
    assert seeds_of(claim(EASY)) == 10
    assert seeds_of(claim(EASY, HARD)) == 34
    assert seeds_of(claim(EASY, HOPELESS)) is None
    assert seeds_of(claim(EASY, missing())) is None


@pytest.fixture
def answer():
    return Answer(
        [
            judgement("text", [[EASY, HARD], [HARD, HOPELESS], [EASY, missing()], [UNKNOWN]]),
            judgement("text-goal", [[EASY], [EASY], [EASY], [EASY]], "text"),
            judgement("everything", [[EASY], [EASY], [EASY], [EASY]]),
        ]
    )


def test_every_component_of_every_reading_has_its_row(answer):
    table = seeds_of_components(answer)
    assert len(table) == 7 + 4 + 4
    hard = table[(table["reading"] == "text") & (table["component"] == "hard")].iloc[0]
    assert (hard["claim"], hard["kind"], hard["to_find"], hard["seeds"]) == ("C1", "direction", 1.0, 34)
    assert hard["sd_limit"] == pytest.approx(2.0, rel=2e-3)
    hopeless, unknown, gone = (table[table["component"] == name].iloc[0] for name in ("hopeless", "unknown", "c > d"))
    assert table["seeds"].isna().sum() == 3
    assert 0.3 < hopeless["power"] < 0.8
    assert math.isnan(unknown["power"])
    assert math.isnan(gone["power"])


def test_the_table_says_for_each_anchor_what_a_claim_takes_and_what_takes_it(answer):
    table = seeds_table(answer)
    assert table.columns[1::2] == ["seeds under “text”", "seeds under “everything”"]
    assert [row[:3] for row in table.rows] == [
        ["C1", "34", "hard"],
        ["C2", "more than 50", "hopeless (50 seeds have a power of 41 %)"],
        ["C3", "–", "c > d: too few seeds were explored to say"],
        ["C4", "–", "unknown: too few seeds were explored to say"],
    ]
    assert [row[3:] for row in table.rows] == [["10", "easy"]] * 4
    assert table.note.splitlines()[-1] == (
        "Under “text”, 34 seeds do for 1 of 4 claims; not for C2, C3, C4. "
        "Under “everything”, 10 seeds do for all 4 claims."
    )


def test_what_is_undecided_says_what_it_takes():
    assert demand_in_words(EASY) == ""
    assert demand_in_words(replace(HARD, verdict="undecided")) == "It takes 34 seeds to decide."
    hopeless = demand_in_words(replace(HOPELESS, verdict="undecided"))
    assert hopeless == "Undecidable at this cost: it takes more than 50 seeds."
    assert demand_in_words(replace(UNKNOWN, verdict="undecided")) == demand_in_words(missing()) == ""


def test_comparisons_that_are_tested_together_are_counted():
    two = Answer([judgement("text", [[planned(1.0, comparisons=8), planned(1.0, groups=7)]])])
    assert list(seeds_of_components(two)["comparisons"]) == [8, 21]
