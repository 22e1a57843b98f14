"""Tables of comparisons: of models, and of the lesions of one model."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from treatments import treated

from bilateral_rl.analysis.comparison import compare, compare_lesions
from bilateral_rl.analysis.results import COLUMNS, State
from bilateral_rl.io.errors import UserError

METRIC, TASK = "time_in_goal_5cm", "hold_position"
RETRAINED = State(TASK, "cc_s", protocol="output")
MODELS = {
    "uni_b": [20.1, 22.0, 19.5, 21.2, 20.4, 23.0],
    "bi_s": [25.0, 24.1, 26.3, 25.5, 23.9, 24.8],
    "cc_s": [30.2, 35.1, 28.7, 33.3, 31.9, 29.4],
}
LESIONS = {
    "shallow_dominant": [10.1, 12.0, 11.2, 9.9, 12.4, 10.7],
    "intact": [30.2, 35.1, 28.7, 33.3, 31.9, 29.4],
    "callosum": [11.0, 12.9, 11.5, 10.4, 13.3, 11.1],
}


def rows(values, model="cc_s", lesion="intact", protocol="none", algo="bptt", first_seed=0):
    return [(model, TASK, algo, first_seed + i, lesion, *treated(protocol), METRIC, v) for i, v in enumerate(values)]


def table(*parts):
    return pd.DataFrame([row for part in parts for row in part], columns=list(COLUMNS))


@pytest.fixture
def models():
    return table(*(rows(values, model) for model, values in MODELS.items()))


@pytest.fixture
def lesions():
    return table(*(rows(values, lesion=lesion, protocol="output") for lesion, values in LESIONS.items()))


def test_groups_are_the_models_with_mean_spread_and_interval(models):
    groups = compare(models, METRIC, TASK).groups
    assert list(groups.index) == ["uni_b", "bi_s", "cc_s"]
    assert list(groups["mean"]) == pytest.approx([np.mean(v) for v in MODELS.values()])
    assert list(groups["sd"]) == pytest.approx([np.std(v, ddof=1) for v in MODELS.values()])
    assert list(groups["n"]) == [6, 6, 6]
    assert all((groups["low"] < groups["mean"]) & (groups["mean"] < groups["high"]))


def test_models_are_compared_both_ways(models):
    comparison = compare(models, METRIC, TASK)
    groups = list(MODELS.values())
    assert comparison.anova.p == pytest.approx(stats.f_oneway(*groups).pvalue)
    assert comparison.welch.p == pytest.approx(stats.f_oneway(*groups, equal_var=False).pvalue)
    pairs = comparison.pairs.set_index(["first", "second"])
    assert list(pairs.index) == [("uni_b", "bi_s"), ("uni_b", "cc_s"), ("bi_s", "cc_s")]
    assert pairs["p_tukey"].iloc[2] == pytest.approx(stats.tukey_hsd(*groups).pvalue[1, 2], rel=1e-6)
    howell = stats.tukey_hsd(*groups, equal_var=False).pvalue
    assert pairs["p_games_howell"].iloc[1] == pytest.approx(howell[0, 2], rel=1e-6)
    row = pairs.loc[("bi_s", "cc_s")]
    assert row["difference"] == pytest.approx(np.mean(groups[1]) - np.mean(groups[2]))
    assert row["ratio"] == pytest.approx(np.mean(groups[1]) / np.mean(groups[2]))
    for low, value, high in (
        ("low", "difference", "high"),
        ("ratio_low", "ratio", "ratio_high"),
        ("g_low", "g", "g_high"),
    ):
        assert row[low] < row[value] < row[high]


def test_models_are_shown_in_the_order_wanted_and_others_left_out(models):
    comparison = compare(models, METRIC, TASK, ["cc_s", "uni_b"])
    assert list(comparison.groups.index) == ["cc_s", "uni_b"]
    assert comparison.pairs["difference"].iloc[0] > 0


def test_only_intact_networks_are_compared(models, lesions):
    both = pd.concat([models, lesions[lesions["lesion"] != "intact"]])
    pd.testing.assert_frame_equal(compare(both, METRIC, TASK).pairs, compare(models, METRIC, TASK).pairs)


def test_a_model_of_one_seed_is_shown_but_not_tested(models):
    one = pd.concat([models, table(rows([27.0], "cc_ns"))])
    comparison = compare(one, METRIC, TASK)
    assert comparison.groups.loc["cc_ns", "mean"] == 27.0
    assert comparison.groups.loc["cc_ns", "note"] == "1 seed: no test"
    with_one = (comparison.pairs[["first", "second"]] == "cc_ns").any(axis=1)
    assert comparison.pairs.loc[with_one, "p_games_howell"].isna().all()
    others = compare(models, METRIC, TASK).pairs["p_games_howell"]
    assert list(comparison.pairs.loc[~with_one, "p_games_howell"]) == list(others)


def test_comparisons_that_cannot_be_made_are_refused(models):
    with pytest.raises(UserError, match="two models or more, got 1"):
        compare(models, METRIC, TASK, ["cc_s"])
    with pytest.raises(UserError, match="no results of time_in_goal_5cm in hold_position for cc_ns"):
        compare(models, METRIC, TASK, ["cc_s", "cc_ns"])
    with pytest.raises(UserError, match="two models or more, got 0"):
        compare(models, "no_metric", TASK)
    twice = pd.concat([models, table(rows([1.0], "bi_s", algo="ppo", first_seed=3))])
    with pytest.raises(UserError, match="for seed 3 of bi_s"):
        compare(twice, METRIC, TASK)


def test_lesions_are_paired_by_seed_and_adjusted(lesions):
    comparison = compare_lesions(lesions, METRIC, RETRAINED)
    assert list(comparison.groups.index) == ["intact", "shallow_dominant", "callosum"]
    pairs = comparison.pairs
    assert list(zip(pairs["first"], pairs["second"], strict=True)) == [
        ("intact", "shallow_dominant"),
        ("intact", "callosum"),
        ("shallow_dominant", "callosum"),
    ]
    p = [stats.ttest_rel(LESIONS[a], LESIONS[b]).pvalue for a, b in zip(pairs["first"], pairs["second"], strict=True)]
    assert list(pairs["p_paired"]) == pytest.approx(p)
    # From the smallest on: times 3, 2 and 1, and never less than the one before.
    order = np.argsort(p)
    adjusted = np.maximum.accumulate(np.array(p)[order] * [3, 2, 1])
    assert list(pairs["p_holm"].iloc[order]) == pytest.approx(list(adjusted))
    assert pairs["p_holm"].iloc[2] < 0.05 < stats.ttest_ind(LESIONS["shallow_dominant"], LESIONS["callosum"]).pvalue


def test_seeds_that_one_state_lacks_do_not_count(lesions):
    without = lesions[~((lesions["lesion"] == "callosum") & (lesions["seed"] == 2))].sample(frac=1, random_state=0)
    pairs = compare_lesions(without, METRIC, RETRAINED).pairs.set_index(["first", "second"])
    assert pairs.loc[("intact", "callosum"), "n"] == 5
    intact, callosum = (np.delete(LESIONS[state], 2) for state in ("intact", "callosum"))
    assert pairs.loc[("intact", "callosum"), "p_paired"] == pytest.approx(stats.ttest_rel(intact, callosum).pvalue)
    assert pairs.loc[("intact", "shallow_dominant"), "n"] == 6


def test_lesions_before_and_after_retraining_are_different_tables(lesions):
    before = [rows([v / 2 for v in values], lesion=lesion) for lesion, values in LESIONS.items()]
    both = pd.concat([lesions, table(*before)])
    assert compare_lesions(both, METRIC, State(TASK, "cc_s")).groups.loc["intact", "mean"] == pytest.approx(
        np.mean(LESIONS["intact"]) / 2
    )
    assert compare_lesions(both, METRIC, RETRAINED).groups.loc["intact", "mean"] == pytest.approx(
        np.mean(LESIONS["intact"])
    )


def test_lesions_without_their_intact_network_are_refused(lesions):
    with pytest.raises(UserError, match="there is shallow_dominant, callosum: run `bilateral-rl lesion` first"):
        compare_lesions(lesions[lesions["lesion"] != "intact"], METRIC, RETRAINED)
    with pytest.raises(UserError, match="cc_s, without retraining, intact and with a lesion; there is nothing"):
        compare_lesions(lesions, METRIC, State(TASK, "cc_s"))


def test_a_seed_that_failed_is_left_out_and_said(lesions):
    lesions.loc[lesions["seed"] == 4, "value"] = np.nan
    comparison = compare_lesions(lesions, METRIC, RETRAINED)
    assert list(comparison.pairs["n"]) == [5, 5, 5]
    assert set(comparison.pairs["note"]) == {"1 value is no number"}
    assert list(comparison.groups["n"]) == [5, 5, 5]
