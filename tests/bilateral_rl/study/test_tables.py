"""Cells that are computed by hand, or by SciPy alone."""

import math

import pandas as pd
import pytest
from scipy import stats
from treatments import treated

from bilateral_rl.analysis.results import COLUMNS
from bilateral_rl.study.tables import study_tables

RADII = {"random_reach": 0.05, "hold_position": 0.01}
COMPLETION, TIME = "goal_completion_5cm", "time_in_goal_1cm"
UNI, BI = [90.0, 92.0, 94.0], [96.0, 97.0, 98.0]
# What the lesioned networks complete after their epoch, by seed.
RETRAINED = {"intact": [96.0, 98.0, 99.0], "deep_dominant": [20.0, 10.0, 40.0], "deep_non_dominant": [80.0, 90.0, 60.0]}


def rows(metric, model, values, lesion="intact", protocol="none", task="random_reach"):
    return [(model, task, "bptt", seed, lesion, *treated(protocol), metric, value) for seed, value in enumerate(values)]


def long_table(*groups):
    return pd.DataFrame([row for group in groups for row in group], columns=list(COLUMNS))


def lesioned(model="bi_s", metric=COMPLETION, task="random_reach"):
    return [row for name, v in RETRAINED.items() for row in rows(metric, model, v, name, "output", task)]


def tables_of(results):
    return {table.name: table for table in study_tables(results, RADII)}


@pytest.fixture(scope="module")
def tables():
    return tables_of(
        long_table(
            rows(COMPLETION, "bi_s", BI),
            rows(COMPLETION, "uni_b", UNI),
            rows("effort", "uni_b", [1.0, 1.5, 2.0]),
            rows("effort", "bi_s", [1.0, math.nan, 2.0]),
            lesioned(),
        )
    )


def test_every_table_has_as_many_cells_in_each_row_as_columns(tables):
    names = ["models", "tests", "pairs", "lesions", "specialization"]
    assert list(tables) == [*(f"{name}_random_reach" for name in names), "deep_minus_shallow"]
    for table in tables.values():
        assert {len(row) for row in table.rows} == {len(table.columns)}
        assert list(table.frame().columns) == table.columns


def test_models_stand_side_by_side_in_the_papers_order(tables):
    table = tables["models_random_reach"]
    assert table.title == "Random reach: the intact models"
    assert table.columns == ["", "Uni-B", "Bi-S"]
    assert table.rows == [
        ["Goal completion within 5 cm (%)", "92.0 ± 2.0", "97.0 ± 1.0"],
        ["Effort (s)", "1.50 ± 0.50", "1.50 ± 0.71 (2 of 3 seeds)"],
    ]


def test_models_are_tested_for_any_difference(tables):
    # Means 92 and 97; squares between 3·2·2.5² = 37.5, within 8 + 2 on 4 degrees of freedom: F = 37.5 / 2.5.
    # Of two groups Welch's F is the square of his t: 25 / (4/3 + 1/3) = 15, on (5/3)² / (16/18 + 1/18) = 2.941.
    row = tables["tests_random_reach"].rows[0]
    p_welch = stats.ttest_ind(UNI, BI, equal_var=False).pvalue
    assert row == [
        "Goal completion within 5 cm (%)",
        "F(1, 4) = 15.00",
        f"{stats.f_oneway(UNI, BI).pvalue:.3f}",
        "F(1, 2.941) = 15.00",
        f"{p_welch:.3f}",
    ]


def test_models_are_compared_pair_by_pair(tables):
    # g = −5 / √2.5 · J(4), J(4) = Γ(2) / (√2 Γ(1.5)) = 0.7979; of two groups both tests are t tests.
    table = tables["pairs_random_reach"]
    ((name, difference, interval, g, howell, tukey),) = table.rows
    assert (name, difference, g) == ("Uni-B − Bi-S", "-5", "-2.52")
    assert howell == f"{stats.ttest_ind(UNI, BI, equal_var=False).pvalue:.3f}"
    assert tukey == f"{stats.ttest_ind(UNI, BI).pvalue:.3f}"
    low, _, high = interval.partition(" to ")
    assert -8 <= float(low) < -5 < float(high) <= -2
    assert "Goal completion within 5 cm (%)" in table.title


def test_each_task_is_judged_by_its_own_metric_and_radius():
    tables = tables_of(
        long_table(
            rows(COMPLETION, "bi_s", BI),
            rows(TIME, "bi_s", [5.0, 6.0, 7.0], task="hold_position"),
            rows(TIME, "cc_s", [15.0, 16.0, 17.0], task="hold_position"),
            lesioned(metric=TIME, task="hold_position"),
        )
    )
    assert "pairs_random_reach" not in tables  # one model is no comparison
    assert tables["models_hold_position"].rows == [["Time within 1 cm (steps)", "6.0 ± 1.0", "16.0 ± 1.0"]]
    assert [row[0] for row in tables["lesions_hold_position"].rows][-1] == "CC-S, intact"
    assert tables["lesions_hold_position"].rows[-1][1] == "16.0 ± 1.0"
    assert "Time within 1 cm" in tables["specialization_hold_position"].title


def test_one_seed_has_a_mean_and_no_test():
    (models, tests, pairs, *_) = tables_of(
        long_table(rows(COMPLETION, "uni_b", [92.0]), rows(COMPLETION, "bi_s", [97.0]), lesioned())
    ).values()
    assert models.rows == [["Goal completion within 5 cm (%)", "92", "97"]]
    none = "2 of 2 groups with fewer than 2 seeds take no part"
    assert tests.rows == [["Goal completion within 5 cm (%)", none, "–", none, "–"]]
    assert pairs.rows == [["Uni-B − Bi-S", "-5", "– to –", "–", "–", "–"]]


def test_a_model_without_a_number_has_dashes():
    nothing = [math.nan] * 3
    (models, _, pairs) = tables_of(
        long_table(rows(COMPLETION, "uni_b", nothing), rows(COMPLETION, "uni_dl", UNI))
    ).values()
    assert models.rows == [["Goal completion within 5 cm (%)", "–", "92.0 ± 2.0"]]
    assert pairs.rows == [["Uni-B − Uni-DL", "–", "– to –", "–", "–", "–"]]


def test_no_results_make_no_tables():
    assert tables_of(long_table()) == {}


def test_large_means_keep_a_decimal():
    (table,) = tables_of(long_table(rows("time_to_peak_speed", "uni_b", [1234.5, 1235.5]))).values()
    assert table.rows == [["Time to peak hand speed (ms)", "1235.00 ± 0.71"]]
