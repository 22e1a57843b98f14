"""Verdicts follow the results: worlds that bear a claim out, that contradict it, and that leave it open."""

import warnings

import numpy as np
import pandas as pd
import pytest
from made_up_results import make_results
from scipy.stats import ttest_rel

from bilateral_rl.claims import Criteria, evaluate_claims
from bilateral_rl.claims.evaluation import CLAIMS
from bilateral_rl.claims.evidence import Evidence
from bilateral_rl.io.errors import UserError

RADII = {"random_reach": 0.05, "hold_position": 0.05}
CRITERIA = Criteria(radii=RADII)
NUMBERS = [f"C{i}" for i in range(1, 15)]
ON_LESIONS = ["C4", "C5", "C6", "C7", "C8"]
# Changes of single means (model, measure, lesion), and the components that they contradict.
CONTRADICTIONS = {
    "C1 size": ("C1", {("uni_dl", "completion", "intact"): 99.5}, ["uni_dl from 94.7"]),
    "C1 direction": (
        "C1",
        {("uni_dl", "completion", "intact"): 95.5, ("uni_ndl", "completion", "intact"): 96.0},
        ["uni_dl > uni_ndl"],
    ),
    "C1 no difference": (
        "C1",
        {("uni_dl", "completion", "intact"): 95.5, ("uni_ndl", "completion", "intact"): 95.5},
        ["uni_dl > uni_ndl"],
    ),
    "C2 too little": ("C2", {("uni_dl", "speed", "intact"): 2.1}, ["uni_dl / uni_ndl"]),
    "C2 too much": ("C2", {("uni_dl", "speed", "intact"): 2.6}, ["uni_dl / uni_ndl"]),
    "C3": ("C3", {("uni_ndl", "hold", "intact"): 20}, ["uni_ndl / uni_dl"]),
    "C4 reach swapped": (
        "C4",
        {("bi_s", "completion", "deep_non_dominant"): 60, ("bi_s", "completion", "deep_dominant"): 90},
        [
            "(random_reach): dominant hemisphere of bi_s > non-dominant hemisphere of bi_s",
            "(random_reach): dominant hemisphere of bi_s > dominant hemisphere of bi_ns",
            "(random_reach): dominant hemisphere of bi_s > non-dominant hemisphere of bi_ns",
            "(random_reach): dominant hemisphere of bi_ns > non-dominant hemisphere of bi_s",
            "(random_reach): non-dominant hemisphere of bi_ns > non-dominant hemisphere of bi_s",
        ],
    ),
    "C4 bi_ns too good": (
        "C4",
        {("bi_ns", "hold", "deep_dominant"): 26},
        ["(hold_position): non-dominant hemisphere of bi_s > non-dominant hemisphere of bi_ns"],
    ),
    "C5": ("C5", {("bi_ns", "hold", "deep_dominant"): 22}, ["(hold_position)"]),
    "C6": ("C6", {("cc_ns", "completion", "shallow_dominant"): 80}, ["cc_ns with shallow dominant"]),
    "C6 as good": ("C6", {("cc_s", "hold", "shallow_non_dominant"): 12}, ["cc_s with shallow non-dominant"]),
    "C7": ("C7", {("cc_s", "hold", "deep_non_dominant"): 30}, ["(hold_position)"]),
    "C8 reach stays bad": (
        "C8",
        {("cc_ns", "completion", "callosum"): 80},
        ["cc_ns with callosum lesion / cc_ns at le"],
    ),
    "C8 hold recovers": (
        "C8",
        {("cc_s", "hold", "callosum"): 34, ("cc_s", "hold", "shallow_dominant"): 34},
        ["cc_s with callosum lesion / cc_s at most"],
    ),
    "C8 hold unlike shallow": (
        "C8",
        {("cc_s", "hold", "callosum"): 20},
        ["cc_s with callosum lesion − cc_s with shallow dominant"],
    ),
    "C9": ("C9", {("bi_ns", "completion", "intact"): 90}, ["bi_ns at least 93"]),
    "C10 speed": ("C10", {("uni_b", "speed", "intact"): 2.9}, ["cc_ns > uni_b"]),
    "C10 specialized is faster": ("C10", {("bi_s", "speed", "intact"): 2.5}, ["bi_s > bi_ns, not conclusively"]),
    "C10 completion": ("C10", {("cc_ns", "completion", "intact"): 99.9}, ["bi_s > cc_ns"]),
    "C11 best": ("C11", {("uni_dl", "hold", "intact"): 37}, ["cc_s > uni_dl"]),
    "C11 specialized is worse": ("C11", {("bi_s", "hold", "intact"): 22}, ["bi_s / bi_ns"]),
    "C12": ("C12", {("bi_ns", "hold", "intact"): 21}, ["bi_ns > uni_b"]),
    "C13 worse than the specialist": ("C13", {("uni_dl", "speed", "intact"): 2.69}, ["cc_s / uni_dl"]),
    "C13 no better than the other": ("C13", {("uni_dl", "hold", "intact"): 36}, ["cc_s > uni_dl"]),
    "C14": ("C14", {("uni_dl", "speed", "intact"): 2.9}, ["cc_ns > uni_dl"]),
}


@pytest.fixture(autouse=True)
def _no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def evaluate(number, results, hold_radius=0.05, **criteria):
    radii = RADII | {"hold_position": hold_radius}
    return CLAIMS[number].evaluate(number, Evidence(results, Criteria(radii=radii, **criteria)))


@pytest.fixture(scope="module")
def papers_world():
    return {claim.number: claim for claim in evaluate_claims(make_results(), CRITERIA)}


def test_there_are_fourteen(papers_world):
    assert list(papers_world) == NUMBERS


def verdicts(results):
    return {claim.number: claim.verdict for claim in evaluate_claims(results, CRITERIA)}


def test_results_like_the_papers_support_every_claim(papers_world):
    components = [component for claim in papers_world.values() for component in claim.components]
    assert [component.text for component in components if component.verdict != "supported"] == []
    assert {claim.verdict for claim in papers_world.values()} == {"supported"}
    assert all(claim.statement for claim in papers_world.values())


def test_results_that_are_mostly_noise_decide_nothing():
    # The same means among seeds that differ as much as they can.
    assert verdicts(make_results(noise=1.0)) == dict.fromkeys(NUMBERS, "undecided")


@pytest.mark.parametrize("case", CONTRADICTIONS)
def test_a_single_change_contradicts_its_components_and_no_others(case):
    number, changes, contradicted = CONTRADICTIONS[case]
    claim = evaluate(number, make_results(changes))
    refused = [component.text for component in claim.components if component.verdict == "not supported"]
    assert claim.verdict == "not supported"
    assert len(refused) == len(contradicted)
    for text, part in zip(refused, contradicted, strict=True):
        assert part in text


def test_every_claim_is_contradicted_by_something():
    assert {number for number, _, _ in CONTRADICTIONS.values()} == set(NUMBERS)


def test_without_results_nothing_is_decided():
    for claim in evaluate_claims(make_results().iloc[:0], CRITERIA):
        assert claim.verdict == "undecided"
        assert "no results of " in claim.note
        assert "no results of " in claim.numbers


def test_what_is_missing_is_named_and_the_rest_computed():
    claim = evaluate("C9", make_results(without=("bi_s",)))
    assert claim.verdict == "undecided"
    assert claim.note == "no results of bi_s in random_reach"
    assert [component.verdict for component in claim.components].count("supported") == 6
    lesioned = evaluate("C4", make_results(without=("bi_ns",)))
    assert lesioned.verdict == "undecided"
    assert "no results of dominant hemisphere of bi_ns in random_reach" in lesioned.note
    assert [component.verdict for component in lesioned.components].count("supported") == 2


def test_the_best_of_models_is_unknown_while_one_is_missing():
    for number, model in (("C13", "bi_s"), ("C14", "uni_b")):
        claim = evaluate(number, make_results(without=(model,)))
        assert {component.verdict for component in claim.components} == {"undecided"}
        assert model in claim.note


def test_a_missing_model_does_not_save_a_claim_that_another_contradicts():
    results = make_results({("bi_ns", "hold", "intact"): 21}, without=("cc_s", "cc_ns"))
    assert evaluate("C12", results).verdict == "not supported"


def test_one_seed_decides_nothing():
    for claim in evaluate_claims(make_results(seeds=1), CRITERIA):
        assert claim.verdict == "undecided"
        assert "1 seed: no test" in claim.note


def test_few_seeds_are_said():
    for seeds in (2, 3):
        assert all(
            f"only {seeds} seeds" in claim.note for claim in evaluate_claims(make_results(seeds=seeds), CRITERIA)
        )


def test_few_seeds_need_more_certainty():
    few = evaluate("C2", make_results(noise=0.05, seeds=3)).components[0]
    many = evaluate("C2", make_results(noise=0.05, seeds=10)).components[0]
    assert few.verdict == "undecided"
    assert many.verdict == "supported"
    assert few.estimate.value == pytest.approx(many.estimate.value)


def test_a_failed_seed_is_left_out_and_said():
    results = make_results()
    results.loc[(results["model"] == "uni_dl") & (results["seed"] == 3), "value"] = np.nan
    claim = evaluate("C2", results)
    assert claim.verdict == "supported"
    assert claim.note == "1 value is no number"
    assert "uni_dl 2.3389 ± 0.0092" in claim.numbers
    assert "(n = 9)" in claim.numbers


def test_a_model_of_which_every_seed_failed_is_missing():
    results = make_results()
    results.loc[results["model"] == "uni_dl", "value"] = np.nan
    assert evaluate("C3", results).note == "no results of uni_dl in hold_position"


def test_models_that_all_complete_everything_are_not_better_than_each_other():
    results = make_results()
    results.loc[results["metric"] == "goal_completion_5cm", "value"] = 100.0
    assert evaluate("C9", results).verdict == "supported"
    last = evaluate("C10", results).components[-1]
    assert last.verdict == "not supported"
    assert "all values are equal: no test" in last.note


def test_lesions_without_retraining_stand_beside_and_decide_nothing():
    for number in ON_LESIONS:
        results = make_results()
        bare = (results["protocol"] == "none") & (results["lesion"] != "intact")
        rng = np.random.default_rng(0)
        results.loc[bare, "value"] = rng.permutation(results.loc[bare, "value"])
        claim = evaluate(number, results)
        assert claim.verdict == "supported"
        (without,) = claim.beside
        assert without.name == "without retraining"
        assert len(without.components) == len(claim.components)
        assert without.verdict != "supported"
        assert without.summary in claim.note
        assert evaluate(number, results[~bare]).verdict == "supported"


def test_networks_that_are_not_retrained_can_decide_and_then_nothing_stands_beside():
    results = make_results(protocol="everything")
    claim = evaluate("C4", results[results["protocol"] == "none"], protocol="none")
    assert claim.verdict == "supported"
    assert claim.beside == ()


def test_only_results_of_the_protocol_that_is_asked_for_decide():
    results = make_results(protocol="everything-3-epochs")
    for number in ON_LESIONS:
        assert evaluate(number, results, protocol="everything-3-epochs").verdict == "supported"
        assert evaluate(number, results, protocol="everything").verdict == "undecided"


# What hemispheres do alone, where the dominant one is faster in reach and completes fewer.
_SIDES = {("bi_s", "deep_non_dominant"): (60, 2.2, 30), ("bi_s", "deep_dominant"): (90, 1.6, 20)}
_SIDES |= {("bi_ns", lesion): (75, 1.9, 25) for lesion in ("deep_non_dominant", "deep_dominant")}
FAST_BUT_FEW = {
    (model, name, lesion): value
    for (model, lesion), values in _SIDES.items()
    for name, value in zip(("completion", "speed", "time"), values, strict=True)
}


def test_a_claim_holds_by_the_measure_of_a_reach_that_is_asked_for():
    results = make_results(FAST_BUT_FEW)
    verdicts = {
        measures: evaluate("C4", results, measures=measures).verdict
        for measures in (("completion",), ("speed",), ("completion", "speed"))
    }
    assert verdicts == {
        ("completion",): "not supported",
        ("speed",): "supported",
        ("completion", "speed"): "not supported",  # it must hold by both
    }


def test_beside_speed_stands_what_counts_reaches_that_fail():
    claim = evaluate("C4", make_results(FAST_BUT_FEW), measures=("speed",))
    without, by_time = claim.beside
    assert (without.name, by_time.name) == ("without retraining", "by mean time to goal")
    # Of a time, less is better: the dominant side takes 30 steps, the other 20, and those of bi_ns 25.
    assert [component.verdict for component in by_time.components] == ["not supported"] * 5
    assert by_time.components[0].text == (
        "Time to goal of 5 cm (random_reach): non-dominant hemisphere of bi_s > dominant hemisphere of bi_s"
    )
    assert "by mean time to goal not supported (5 not supported)" in claim.note
    faster = FAST_BUT_FEW | {("bi_s", "time", "deep_non_dominant"): 15, ("bi_s", "time", "deep_dominant"): 35}
    by_time = evaluate("C4", make_results(faster), measures=("speed",)).beside[1]
    assert by_time.verdict == "supported"
    assert evaluate("C4", make_results(faster)).beside[1:] == ()  # completion counts them already


def test_speed_is_said_to_be_of_reaches_that_succeed_and_of_how_many():
    claim = evaluate("C4", make_results(FAST_BUT_FEW), measures=("speed",))
    by_speed = [component for component in claim.components if "Speed" in component.text]
    assert len(by_speed) == 5
    for component in by_speed:
        assert "biased where few do" in component.note
    assert "dominant hemisphere of bi_s 60.00 ± 0.24 %, non-dominant hemisphere of bi_s 90.00 ± 0.36 %" in claim.note
    assert "biased" not in evaluate("C4", make_results(FAST_BUT_FEW)).note


def test_recovery_in_time_is_that_of_the_intact_network_over_the_lesioned_ones():
    times = {("cc_s", "time", "intact"): 19.5, ("cc_s", "time", "callosum"): 20}
    times |= {("cc_ns", "time", "intact"): 10, ("cc_ns", "time", "callosum"): 20}
    (_, by_time) = evaluate("C8", make_results(times), measures=("speed",)).beside
    assert [component.verdict for component in by_time.components] == ["supported", "not supported"]
    assert [component.estimate.value for component in by_time.components] == pytest.approx([0.975, 0.5], rel=1e-3)


def test_a_reach_may_end_at_the_third_step_within_the_goal():
    results = make_results()
    assert evaluate("C2", results, arrival="third").verdict == "undecided"
    results["metric"] = results["metric"].replace("speed_to_goal_5cm", "speed_to_third_step_5cm")
    assert evaluate("C2", results, arrival="third").verdict == "supported"


def test_a_hemisphere_may_be_alone_after_a_shallow_lesion_of_the_other():
    # As the deep ones, with the sides exchanged where only deep lesions are looked at.
    swapped = {"deep_dominant": "shallow_dominant", "deep_non_dominant": "shallow_non_dominant"}
    results = make_results()
    results = results[~results["lesion"].isin(swapped.values())].replace({"lesion": swapped})
    assert evaluate("C4", results).verdict == "undecided"
    for number in ("C4", "C5", "C7"):
        assert evaluate(number, results, alone="shallow").verdict == "supported"


def test_states_that_are_no_better_than_fresh_networks_are_named_and_decide_nothing():
    results = make_results()
    assert all(component.relearned == () for component in evaluate("C4", results).components)  # nobody knows
    control = results.assign(network="fresh")
    control["value"] *= 0.5
    side = (results["model"] == "bi_s") & (results["lesion"] == "deep_dominant")
    control.loc[side & (results["task"] == "random_reach"), "value"] *= 3
    both = pd.concat([results, control])
    claim = evaluate("C4", both)
    assert claim.verdict == "supported"
    assert {name for component in claim.components for name in component.relearned} == {
        "non-dominant hemisphere of bi_s in random_reach"
    }
    assert "no better than a fresh network: non-dominant hemisphere of bi_s in random_reach" in claim.note


def test_of_speed_the_time_to_the_goal_says_whether_a_state_is_better_than_a_fresh_network():
    # Fresh networks have a few lucky, fast reaches, and hardly any other.
    results = make_results(FAST_BUT_FEW)
    control = results.assign(network="fresh")
    control.loc[results["metric"] == "speed_to_goal_5cm", "value"] = 9.0
    control.loc[results["metric"] == "time_to_goal_5cm", "value"] = 49.0
    control.loc[results["task"] == "hold_position", "value"] = 1.0
    claim = evaluate("C4", pd.concat([results, control]), measures=("speed",))
    assert all(component.relearned == () for component in claim.components)


def test_states_of_a_network_are_paired_and_models_are_not():
    # Seeds differ by far more than hemispheres do, and both hemispheres of a seed alike.
    results = make_results()
    of_seed = np.linspace(0.5, 1.5, 10)[results["seed"].to_numpy()]
    sides = results["lesion"].isin(["deep_dominant", "deep_non_dominant"])
    results.loc[sides, "value"] *= of_seed[sides.to_numpy()]
    claim = evaluate("C4", results)
    within = [component for component in claim.components if component.test.startswith("paired")]
    between = [component for component in claim.components if component.test.startswith("Welch")]
    assert (len(within), len(between)) == (2, 8)
    assert {component.verdict for component in within} == {"supported"}
    assert "undecided" in {component.verdict for component in between}


def test_p_values_of_a_lesion_claim_are_one_family():
    claim = evaluate("C7", make_results(noise=0.5))
    results = make_results(noise=0.5)
    results = results[(results["model"] == "cc_s") & (results["protocol"] == "output")]

    def values(metric, lesion):
        return results[(results["metric"] == metric) & (results["lesion"] == lesion)]["value"]

    raw = [
        ttest_rel(values(metric, "deep_dominant"), values(metric, "deep_non_dominant")).pvalue
        for metric in ("goal_completion_5cm", "time_in_goal_5cm")
    ]
    low, high = np.argsort(raw)
    assert claim.components[low].p == pytest.approx(2 * raw[low])
    assert claim.components[high].p == pytest.approx(max(2 * raw[low], raw[high]))


def test_the_papers_test_stands_beside_the_sound_one(papers_world):
    component = papers_world["C12"].components[0]
    assert component.test == "Games–Howell"
    assert component.p < 0.05
    assert component.tukey_p < 0.05
    assert "Tukey's HSD, as in the paper: p < 0.001" in component.numbers


def test_numbers_are_given_with_their_intervals(papers_world):
    lines = papers_world["C1"].numbers.splitlines()
    assert lines[0] == (
        "Goal completion within 5 cm (random_reach): uni_dl from 94.7 to 98.7 %: uni_dl 96.70 ± 0.39 % (n = 10); "
        "95 % interval 96.4 to 97"
    )
    assert lines[2] == (
        "Goal completion within 5 cm (random_reach): uni_dl > uni_ndl: uni_dl 96.70 ± 0.39 % (n = 10), uni_ndl 94.60 ± "
        "0.38 % (n = 10); difference 2.1 points, 95 % interval 1.74 to 2.46; Welch's t test: p < 0.001"
    )
    assert papers_world["C1"].tests == "95 % interval; Welch's t test"
    assert "ratio 1.17" in papers_world["C2"].numbers


def test_little_difference_is_of_means_and_single_networks_are_noted(papers_world):
    assert "apart in random_reach" in papers_world["C5"].note


def test_equal_hemispheres_are_shown_by_two_one_sided_tests(papers_world):
    component = papers_world["C5"].components[0]
    assert component.test == "two one-sided paired t tests at 0.025 each"
    assert component.p < 0.025
    noisy = [c for noise in (0.02, 0.05, 0.1, 0.2) for c in evaluate("C5", make_results(noise=noise)).components]
    assert {c.verdict for c in noisy} == {"supported", "undecided"}
    for c in noisy:
        assert (c.p < 0.025) == (c.verdict == "supported")


def test_goals_may_have_other_radii():
    results = make_results()
    assert evaluate("C3", results, hold_radius=0.01).verdict == "undecided"
    results["metric"] = results["metric"].replace("time_in_goal_5cm", "time_in_goal_1cm")
    assert evaluate("C3", results, hold_radius=0.01).verdict == "supported"
    assert "within 1 cm" in evaluate("C3", results, hold_radius=0.01).numbers


def test_time_in_the_goal_of_reaches_is_no_hold():
    results = make_results()
    reaches = results[results["task"] == "hold_position"].assign(task="random_reach", value=1.0)
    assert evaluate("C3", pd.concat([results, reaches])).verdict == "supported"


def test_results_that_cannot_be_told_apart_are_refused():
    results = make_results()
    with pytest.raises(UserError, match="one algorithm, not of bptt and ppo"):
        evaluate_claims(pd.concat([results, results.assign(algo="ppo")]), CRITERIA)
    with pytest.raises(UserError, match="several values of goal_completion_5cm"):
        evaluate("C1", pd.concat([results, results]))
