"""What readings say together: what holds in all, in none, and on which choice the rest turns."""

import math

import pandas as pd
from made_up_answers import (
    EVERYTHING,
    EVERYTHING_EPOCHS,
    EVERYTHING_GOAL,
    FIVE,
    TEXT,
    TEXT_GOAL,
    N,
    S,
    U,
    component,
    five,
    judgement,
    missing,
)

from bilateral_rl.claims import Claim
from bilateral_rl.study.answer import Answer, chosen_otherwise, tally
from bilateral_rl.study.answer_drawing import draw_answer
from bilateral_rl.study.answer_in_words import held_in_words, opening, turns_in_words


def test_the_component_that_decides_is_the_weakest_of_those_with_the_claims_verdict():
    def deciding(*components):
        return Claim("C1", "A claim.", components).deciding

    weak, strong = component(S, 0.05, "weak"), component(S, 0.5, "strong")
    assert deciding(strong, weak) == weak
    refused, worse = component(N, -0.1, "refused"), component(N, -0.3, "worse")
    assert deciding(weak, refused, worse) == worse
    unsure = component(U, 0.9, "unsure")
    assert deciding(weak, unsure) == unsure
    assert deciding(missing(), unsure) == unsure  # what was measured comes first
    assert deciding(missing(), weak) == missing()


def test_claims_that_hold_in_all_in_none_and_in_some():
    answer = five()
    assert (answer.in_all, answer.in_none, answer.turning) == (["C1"], ["C2"], ["C3", "C4"])
    assert answer.count("C2") == {N: 4, U: 1}
    assert [tally(judgement)[S] for judgement in FIVE] == [2, 3, 2, 2, 1]


def test_anchors_stand_first_in_their_groups():
    answer = five()
    assert answer.anchors == [TEXT, EVERYTHING]
    assert answer.groups() == [[TEXT, TEXT_GOAL], [EVERYTHING, EVERYTHING_EPOCHS, EVERYTHING_GOAL]]


def test_a_reading_whose_anchor_was_not_judged_is_one_itself():
    answer = Answer([TEXT_GOAL, EVERYTHING])
    assert answer.anchors == [TEXT_GOAL, EVERYTHING]
    assert answer.source(TEXT_GOAL) is None


def test_a_deviation_from_a_deviation_stands_in_its_anchors_group():
    deeper = judgement("deeper", [S, N, S, N], "text-goal", goal_of_a_reach="1 cm", epochs="3")
    answer = Answer([TEXT, TEXT_GOAL, deeper])
    assert answer.groups() == [[TEXT, TEXT_GOAL, deeper]]
    (turn,) = answer.turns("C3")
    assert (turn.source, turn.target, turn.choice) == (TEXT_GOAL, deeper, "epochs: 3")


def test_each_deviation_is_held_against_its_own_anchor_and_anchors_against_each_other():
    turns = {number: five().turns(number) for number in ("C1", "C2", "C3", "C4")}
    told = {
        number: [(t.source.reading, t.choice, t.before, t.after) for t in of_claim]
        for number, of_claim in turns.items()
    }
    assert told == {
        "C1": [],
        "C2": [("text", "goal of a reach: 1 cm", N, U)],
        "C3": [("text", "what adapts: everything", U, S), ("everything", "epochs: 3", S, U)],
        "C4": [("text", "goal of a reach: 1 cm", S, N), ("everything", "goal of a reach: 1 cm", S, N)],
    }


def test_what_is_chosen_otherwise_is_named_by_the_gap():
    assert chosen_otherwise(TEXT, EVERYTHING_GOAL) == "what adapts: everything, goal of a reach: 1 cm"
    assert chosen_otherwise(TEXT, TEXT) == "text"


def test_the_table_has_a_row_a_reading_and_claim(tmp_path):
    path = tmp_path / "answer.csv"
    five().table().to_csv(path, index=False)
    table = pd.read_csv(path, keep_default_na=False)
    assert len(table) == 5 * 4
    row = table[(table["reading"] == "everything-goal") & (table["claim"] == "C4")].iloc[0]
    assert (row["anchor"], row["verdict"], row["deciding_component"]) == ("everything", N, "a > b")
    assert (row["effect"], row["effect_low"], row["effect_high"]) == (0.4, 0.30000000000000004, 0.5)
    assert (row["quantity"], row["estimate"], row["low"], row["high"]) == ("difference", 20, 15, 25)
    assert (row["n"], row["test"], row["p"]) == (5, "Welch's t test", 0.03)
    assert (row["components"], row["components_supported"]) == (1, 0)


def test_readings_that_give_a_claim_the_same_numbers_stand_once():
    # A claim's effect is its number's tenth in all readings, so that only verdicts tell them apart.
    answer = five()
    assert answer.distinct("C1") == [TEXT]
    assert answer.distinct("C3") == [TEXT, EVERYTHING]
    unknown = Answer([judgement("a", [[missing()]]), judgement("b", [[missing()]])])
    assert len(unknown.distinct("C1")) == 1
    assert math.isnan(unknown.claim(unknown.judgements[0], "C1").deciding.effect.value)


def test_curves_are_drawn_of_claims_to_which_readings_give_different_numbers():
    drawings = list(draw_answer(five()))
    assert [drawing.name for drawing in drawings] == ["curve_C2", "curve_C3", "curve_C4"]
    assert drawings[1].caption == "C3 under 2 readings that give it different numbers. Statement 3."
    labels = [label.get_text() for label in drawings[1].figure.axes[1].get_yticklabels()]
    assert labels == ["what adapts:  output", "everything"]


def test_the_opening_says_what_holds_where():
    assert opening(five()) == (
        "The paper leaves open how parts of it were done; each way to fill these gaps is a reading. Its 4 claims were "
        "judged under 5 readings. C1 holds under every one. C2 holds under none. C3 and C4 hold under some and not "
        "under others. Most hold under “everything”: 3. Of the readings from which the others deviate: 2 under “text” "
        "and 3 under “everything”."
    )


def test_claims_that_are_contradicted_everywhere_are_named():
    words = opening(Answer([judgement("a", [N, U, N, S]), judgement("b", [N, N, N, U])]))
    assert "No claim holds under every one." in words
    assert "C1, C2 and C3 hold under none; contradicted under every one are C1 and C3. C4 holds under some" in words
    assert "Most hold under “a”: 1." in words


def test_where_nothing_holds_it_is_said_once():
    words = opening(Answer([judgement("a", [N, U]), judgement("b", [N, N])]))
    assert words.endswith("under 2 readings. No claim holds under any of them; contradicted under every one is C1.")


def test_one_reading_alone_is_said_to_be_one():
    assert opening(Answer([TEXT])) == (
        "Under the reading “text”, 2 of the paper's 4 claims hold, 1 do not, and 1 stay undecided. Why text."
    )
    assert held_in_words(Answer([TEXT]), "C1") == ""
    assert turns_in_words(Answer([TEXT]), "C1") == ""


def test_turns_in_words():
    answer = five()
    assert turns_in_words(answer, "C1") == "no single choice"
    assert turns_in_words(answer, "C2") == "no single choice makes it hold"
    assert turns_in_words(answer, "C3") == (
        "From “text” (undecided): supported with what adapts everything. "
        "From “everything” (supported): undecided with epochs 3."
    )
    assert turns_in_words(answer, "C4") == (
        "From “text” and “everything” (supported): not supported with goal of a reach 1 cm."
    )


def test_choices_for_one_gap_are_gathered():
    goals = [judgement(f"text-{cm}", [N], "text", goal_of_a_reach=f"{cm} cm") for cm in (1, 2)]
    more = judgement("text-epochs", [U], "text", epochs="3")
    words = turns_in_words(Answer([judgement("text", [S]), *goals, more]), "C1")
    assert words == "From “text” (supported): not supported with goal of a reach 1 cm or 2 cm; undecided with epochs 3."


def test_how_often_a_claim_holds():
    assert held_in_words(five(), "C1") == "under all 5"
    assert held_in_words(five(), "C2") == "supported under 0 of 5 (1 undecided, 4 not supported)"
