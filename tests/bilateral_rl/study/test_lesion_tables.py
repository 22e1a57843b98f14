"""Protocols side by side with their controls, in cells that are computed by hand or by SciPy alone."""

import math

import pandas as pd
import pytest
from scipy import stats
from treatments import treated

from bilateral_rl.analysis.metrics import find_metric
from bilateral_rl.analysis.results import COLUMNS
from bilateral_rl.study.lesion_tables import lesion_tables

METRICS = {"random_reach": find_metric("goal_completion_5cm"), "hold_position": find_metric("time_in_goal_1cm")}
# What networks complete with each lesion, by seed: trained ones by two protocols, and fresh ones.
OUTPUT = {
    "intact": [96.0, 98.0, 99.0],
    "deep_dominant": [20.0, 10.0, 40.0],
    "deep_non_dominant": [80.0, 90.0, 60.0],
    "shallow_dominant": [10.0, 20.0, 15.0],
}
EVERYTHING = {
    "intact": [97.0, 98.0, 99.0],
    "deep_dominant": [50.0, 52.0, 55.0],
    "deep_non_dominant": [30.0, 31.0, 29.0],
    "shallow_dominant": [40.0, 41.0, 43.0],
}
FRESH = {name: [12.0, 8.0, 14.0] for name in OUTPUT}


def rows(values, protocol, network="trained", model="cc_s", task="random_reach"):
    return [
        (model, task, "bptt", seed, lesion, *treated(protocol, network), METRICS[task].name, value)
        for lesion, by_seed in values.items()
        for seed, value in enumerate(by_seed)
    ]


def tables_of(*groups, models=("bi_s", "cc_s")):
    results = pd.DataFrame([row for group in groups for row in group], columns=list(COLUMNS))
    return {table.name: table for table in lesion_tables(results, METRICS, models)}


@pytest.fixture(scope="module")
def tables():
    return tables_of(
        rows(OUTPUT, "output"),
        rows(FRESH, "output", "fresh"),
        rows(EVERYTHING, "everything"),
        rows(FRESH, "everything", "fresh"),
    )


def holm(p_values):
    order = sorted(p_values)
    m = len(order)
    return [min(max((m - j) * order[j] for j in range(order.index(p) + 1)), 1.0) for p in p_values]


def test_every_table_has_as_many_cells_in_each_row_as_columns(tables):
    assert list(tables) == ["lesions_random_reach", "specialization_random_reach", "deep_minus_shallow"]
    for table in tables.values():
        assert {len(row) for row in table.rows} == {len(table.columns)}
        assert table.frame().shape == (len(table.rows), len(table.columns))


def test_protocols_stand_side_by_side_each_with_its_control_and_test(tables):
    table = tables["lesions_random_reach"]
    output, everything = "output layer retrained", "everything retrained"
    assert table.columns == ["", output, f"fresh, {output}", "p", everything, f"fresh, {everything}", "p"]
    cells = {row[0]: row[1:] for row in table.rows}
    assert list(cells) == [
        "CC-S, intact", "CC-S, shallow dominant", "CC-S, deep dominant", "CC-S, deep non-dominant",
    ]  # fmt: skip
    names = list(OUTPUT)
    pairs = [(a, b) for i, a in enumerate(names) for b in names[i + 1 :]]
    adjusted = dict(zip(pairs, holm([stats.ttest_rel(OUTPUT[a], OUTPUT[b]).pvalue for a, b in pairs]), strict=True))
    p = f"{adjusted['intact', 'deep_dominant']:.3f}"
    assert cells["CC-S, intact"][:3] == ["97.7 ± 1.5", "11.3 ± 3.1", "–"]
    assert cells["CC-S, deep dominant"][:3] == ["23 ± 15 †", "11.3 ± 3.1", p]
    assert cells["CC-S, deep dominant"][3] == "52.3 ± 2.5"


def test_states_that_are_not_above_their_control_are_named_in_a_sentence(tables):
    # Trained − fresh: 8, 2, 26 after the deep dominant lesion and −2, 12, 1 after the shallow one hold 0.
    lines = tables["lesions_random_reach"].note.splitlines()
    assert lines[1:] == [
        "Lost, or relearned and not kept, by CC-S: output layer retrained (shallow dominant; deep dominant)."
    ]
    floored = tables_of(rows(FRESH, "none"), rows(FRESH, "none", "fresh"))["lesions_random_reach"].note
    assert "Lost, or relearned and not kept, by CC-S: without retraining (every lesion)." in floored


def test_without_a_control_nothing_is_said_to_be_relearned():
    table = tables_of(rows(OUTPUT, "output"))["lesions_random_reach"]
    assert "Lost, or relearned and not kept" not in table.note
    assert [row[2] for row in table.rows] == ["–"] * 4
    assert not any("†" in row[1] for row in table.rows)


def test_deep_lesions_are_compared_with_shallow_ones_of_the_same_side(tables):
    # Deep − shallow of the dominant side: 10, −10, 25 by the output layer; 10, 11, 12 by everything.
    table = tables["deep_minus_shallow"]
    assert table.columns == ["", "output layer retrained", "p", "everything retrained", "p"]
    dominant, non_dominant = table.rows
    assert dominant[0] == "Random reach, CC-S, dominant (%)"
    p = [stats.ttest_rel(v["deep_dominant"], v["shallow_dominant"]).pvalue for v in (OUTPUT, EVERYTHING)]
    assert [dominant[2], dominant[4]] == [f"{p[0]:.3f}", f"{p[1]:.3f}"]
    reach = stats.t.isf(0.025, 2) / math.sqrt(3)
    assert dominant[3] == f"+11 ({11 - reach:.3g} to {11 + reach:.3g})"
    assert non_dominant[1:] == ["–", "–", "–", "–"]  # no shallow lesion


def test_p_values_of_a_protocol_in_a_task_are_one_family_over_models_and_sides():
    states = ("deep_dominant", "shallow_dominant")
    output, everything = ({name: values[name] for name in states} for values in (OUTPUT, EVERYTHING))
    hold = {"deep_dominant": [5.0, 6.0, 8.0], "shallow_dominant": [4.0, 4.5, 5.0]}
    groups = [rows(output, "output"), rows(everything, "output", model="bi_s")]
    table = tables_of(*groups, rows(hold, "output", task="hold_position"))["deep_minus_shallow"]
    cells = {row[0]: row[2] for row in table.rows}
    raw = [stats.ttest_rel(v["deep_dominant"], v["shallow_dominant"]).pvalue for v in (output, everything, hold)]
    names = ("Random reach, CC-S", "Random reach, Bi-S", "Hold position, CC-S")
    adjusted = [*holm(raw[:2]), raw[2]]
    units = ("%", "%", "steps")
    assert [cells[f"{n}, dominant ({u})"] for n, u in zip(names, units, strict=True)] == [f"{p:.3f}" for p in adjusted]


def test_the_specialization_index_is_of_what_each_hemisphere_does_alone(tables):
    # The dominant one works alone after a lesion of the other: 0.6, 0.8, 0.2 by seed; mean 0.5333, sd 0.30551.
    (row,) = tables["specialization_random_reach"].rows
    reach, mean = stats.t.isf(0.025, 2) * 0.3055050463 / math.sqrt(3), 1.6 / 3
    assert row[:2] == ["CC-S", f"{mean:+.3f} ({mean - reach:.3g} to {mean + reach:.3g})"]


def test_an_index_of_networks_at_the_floor_is_not_shown():
    table = tables_of(rows(FRESH, "output"), rows(FRESH, "output", "fresh"))["specialization_random_reach"]
    assert table.rows == [["CC-S", "at the floor"]]
    missing = tables_of(rows({"intact": [97.0, 98.0]}, "output"))["specialization_random_reach"]
    assert missing.rows == [["CC-S", "–"]]
