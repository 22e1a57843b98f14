"""B1 to B6 follow the results: effects that are planted are found, absent ones are not, and stuck seeds are told."""

import warnings
from dataclasses import replace

import pandas as pd
import pytest
from made_up_hands import STRAIGHT, World

from bilateral_rl.claims.two_arms.criteria import HandCriteria
from bilateral_rl.claims.two_arms.evaluation import CLAIMS, evaluate_hand_claims
from bilateral_rl.claims.two_arms.evidence import HandEvidence
from bilateral_rl.claims.two_arms.hands import in_roles
from bilateral_rl.io.errors import UserError

NUMBERS = [f"B{i}" for i in range(1, 7)]
DEFAULT = HandCriteria()
SUPPORTED, NOT, OPEN = "supported", "not supported", "undecided"


@pytest.fixture(autouse=True)
def _no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def world(**changes):
    made = World()
    for name, value in changes.items():
        assert hasattr(made, name)
        setattr(made, name, value)
    return made


def judged(*numbers, criteria=DEFAULT, beside=False, **changes):
    """The claims in such a world; with what stands beside them only if asked for, which takes longer."""
    evidence = HandEvidence(world(**changes).results(), criteria)
    claims = [CLAIMS[number] if beside else replace(CLAIMS[number], beside=lambda _: []) for number in numbers]
    return [claim.evaluate(number, evidence) for number, claim in zip(numbers, claims, strict=True)]


@pytest.fixture(scope="module")
def as_claimed():
    return {claim.number: claim for claim in evaluate_hand_claims(HandEvidence(World().results(), DEFAULT))}


def test_a_world_as_claimed_supports_every_claim(as_claimed):
    assert {number: claim.verdict for number, claim in as_claimed.items()} == dict.fromkeys(NUMBERS, SUPPORTED)
    texts = [component.text for claim in as_claimed.values() for component in claim.components]
    assert len(set(texts)) == len(texts) == 2 + 2 + 2 + 2 + 2 + (4 + 4)


def test_effects_have_the_size_that_was_planted(as_claimed):
    effects = {number: [component.effect.value for component in as_claimed[number].components] for number in NUMBERS}
    for number in ("B1", "B2", "B3"):
        assert effects[number] == pytest.approx([0.2, 0.2], abs=1e-3)
    assert effects["B4"] == pytest.approx([0.1, 0.1], abs=1e-3)  # the distance to the margin
    assert [c.estimate.value for c in as_claimed["B5"].components] == pytest.approx([30, 30], abs=0.5)
    assert effects["B6"][:4] == pytest.approx([0.3 / 1.15] * 4, abs=2e-3)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"straighter": {}}, {"B1": NOT, "B2": SUPPORTED, "B3": SUPPORTED}),
        ({"steadier": {}}, {"B1": SUPPORTED, "B2": NOT, "B3": SUPPORTED}),
        ({"straighter": {}, "steadier": {}}, {"B1": NOT, "B2": NOT, "B3": NOT}),
        ({"straighter": {"bi_s": 0.2, "cc_s": -0.2}}, {"B1": NOT, "B3": NOT}),  # in one of both the other way
    ],
)
def test_hands_that_do_not_differ_or_the_other_way_support_nothing(changes, expected):
    claims = judged(*expected, **changes)
    assert {claim.number: claim.verdict for claim in claims} == expected


def test_a_hand_that_is_better_at_both_makes_no_interaction():
    global_advantage = {"bi_s": -0.2, "cc_s": -0.2}  # of the non-dominant hand, which also reaches straighter
    straight, steady, crossed = judged("B1", "B2", "B3", straighter=global_advantage)
    assert (straight.verdict, steady.verdict, crossed.verdict) == (NOT, SUPPORTED, NOT)
    assert "non-dominant hand's advantage in hold +20.0 ± " in crossed.components[0].note
    assert "dominant hand's advantage in reach -20.0 ± " in crossed.components[0].note


def test_a_hand_that_is_better_at_both_to_an_unequal_degree_makes_none_either():
    unequal = {"straighter": dict.fromkeys(("bi_s", "cc_s"), 0.6), "steadier": dict.fromkeys(("bi_s", "cc_s"), -0.2)}
    (crossed,) = judged("B3", **unequal)
    assert crossed.verdict == NOT
    assert all(component.estimate.low > 0 for component in crossed.components)
    assert "the dominant hand is better in both roles, which is a global advantage" in crossed.note


def test_absence_of_an_interaction_is_shown_and_not_concluded_from_noise():
    none = {"straighter": {}, "steadier": {}}
    assert judged("B4", **none)[0].verdict == SUPPORTED
    assert judged("B4", **none, noise=0.3)[0].verdict == OPEN
    large = {"straighter": {"cc_ns": 0.3}, "steadier": {"cc_ns": 0.3}}
    (claim,) = judged("B4", **large)
    assert [component.verdict for component in claim.components] == [SUPPORTED, NOT]  # bi_ns, cc_ns
    assert "two one-sided" in claim.components[1].test


def test_noise_decides_nothing():
    assert {claim.verdict for claim in judged(*NUMBERS, noise=1.0)} == {OPEN}


@pytest.mark.parametrize(("harm", "verdict"), [((1.2, 1.5), NOT), ((1.5, 1.5), NOT), ((1.5, 1.2), SUPPORTED)])
def test_the_callosum_is_judged_by_what_its_cut_costs_relative_to_intact(harm, verdict):
    assert judged("B5", harm=dict(zip((50.0, 0.0), harm, strict=True)))[0].verdict == verdict


def test_a_cut_that_is_no_better_than_fresh_networks_is_told():
    results = World().results()
    for spring, table in results.items():
        fresh = table[table["metric"].str.startswith("return") & (table["lesion"] == "callosum")].assign(
            network="fresh"
        )
        fresh["value"] *= 0.9 if spring else 2.0
        results[spring] = pd.concat([table, fresh], ignore_index=True)
    components = CLAIMS["B5"].components(HandEvidence(results, DEFAULT))
    assert {component.relearned for component in components} == {
        ("cc_s without callosum at 50 N/m",),
        ("cc_ns without callosum at 50 N/m",),
    }


def test_either_deficit_alone_does_not_do():
    for side, names in (("dominant", STRAIGHT), ("non_dominant", ("final_error",))):
        made = World()
        for name in names:
            made.deficits[("cc_s", side, name)] = 1.0
        (claim,) = judged("B6", deficits=made.deficits)
        assert [component.verdict for component in claim.components[:4]].count(NOT) == 1
        assert claim.verdict == NOT


def test_damage_of_any_kind_is_not_the_lost_sides_deficit():
    deficits = {
        (model, side, name): 1.3
        for model in ("bi_s", "cc_s")
        for side in ("dominant", "non_dominant")
        for name in (*STRAIGHT, "final_error")
    }
    (claim,) = judged("B6", deficits=deficits, beside=True)
    beside = {aside.name: aside.verdict for aside in claim.beside}
    assert claim.verdict == NOT
    assert beside["as deficits alone, of whatever cause"] == SUPPORTED
    assert beside["of the contralesional arm, a sanity check"] == SUPPORTED


def test_without_a_path_only_a_callosum_lets_a_side_act_on_both_arms():
    (claim,) = judged("B6", criteria=HandCriteria(has_path=False))
    assert all("cc_s" in component.text for component in claim.components)
    assert len(claim.components) == 2 + 2


def test_networks_that_never_learned_are_left_out_and_named():
    (clean,) = judged("B1")
    (claim,) = judged("B1", stuck={"cc_s": (3, 7)})
    bilateral, callosal = claim.components
    assert callosal.estimate.n == 8
    assert "never learned and left out, by seed: cc_s 3, 7" in callosal.note
    assert "never learned" not in bilateral.note
    assert callosal.estimate.value == pytest.approx(clean.components[1].estimate.value, rel=0.01)


def test_a_network_that_cannot_hold_has_not_learned_a_task_without_reaches():
    results = world(tasks=("two_holds",)).results()
    for table in results.values():
        rows = table["metric"].str.startswith("hold_rms_error") & (table["seed"] == 4) & (table["model"] == "bi_s")
        table.loc[rows, "value"] = 40.0
    evidence = HandEvidence(results, DEFAULT).in_task("two_holds")
    assert (evidence.not_learned("bi_s"), evidence.not_learned("cc_s")) == ([4], [])


def test_if_no_network_learned_nothing_is_decided():
    claims = judged(*NUMBERS, stuck={model: range(10) for model in ("bi_ns", "bi_s", "cc_ns", "cc_s")})
    assert {claim.verdict for claim in claims} == {OPEN}
    notes = {note for claim in claims for component in claim.components for note in component.note.split("; ")}
    assert notes == {
        f"never learned and left out, by seed: {model} 0, 1, 2, 3, 4, 5, 6, 7, 8, 9"
        for model in ("bi_ns", "bi_s", "cc_ns", "cc_s")
    }


def test_models_that_are_missing_leave_their_claims_undecided():
    claims = judged(*NUMBERS, without=("cc_s",))
    assert {claim.number: claim.verdict for claim in claims} == dict.fromkeys(NUMBERS, OPEN) | {"B4": SUPPORTED}


def test_what_decides_can_be_read_otherwise():
    results = World().results()
    for table in results.values():
        rows = table["metric"].str.startswith("path_length_ratio_of_non_dominant_reach") & (table["model"] == "bi_s")
        table.loc[rows, "value"] = 1.0
    for criteria, verdict in (
        (HandCriteria(), SUPPORTED),
        (HandCriteria(straightness="path_length_ratio"), SUPPORTED),  # until within 2 cm, which did not change
        (HandCriteria(straightness="path_length_ratio", judged="whole"), NOT),
        (HandCriteria(straightness="initial_direction_error", judged="whole"), SUPPORTED),
    ):
        claim = CLAIMS["B1"].evaluate("B1", HandEvidence(results, criteria))
        assert claim.verdict == verdict
        assert len(claim.beside) == 5  # the other measures, over both parts of the trial


@pytest.mark.parametrize(
    "steadiness", ["hold_rms_error", "hold_drift", "time_in_goal_1cm", "time_in_goal_2cm", "time_in_goal_5cm"]
)
def test_steadiness_is_the_same_whichever_way_it_counts(steadiness):
    for claim in judged("B2", "B3", criteria=HandCriteria(steadiness=steadiness)):
        assert claim.verdict == SUPPORTED


def test_errors_in_both_arrangements_of_roles_have_the_mean_of_both_hands():
    own, swapped = in_roles(HandEvidence(World().results(), DEFAULT), "cc_s")
    assert own.mean == pytest.approx(90, abs=0.1)
    assert (own.values + swapped.values).to_numpy() == pytest.approx(200)


def test_control_tasks_stand_beside_where_there_are_results():
    claims = judged("B1", "B2", tasks=("reach_and_hold", "two_reaches", "two_holds"), beside=True)
    names = [[aside.name for aside in claim.beside] for claim in claims]
    assert "in two_reaches" in names[0]
    assert "in two_holds" in names[1]


def test_results_of_two_algorithms_are_refused():
    results = World().results()
    results[0.0]["algo"] = "ppo"
    with pytest.raises(UserError, match="one algorithm"):
        HandEvidence(results, DEFAULT)
