"""Comparisons from Python: three tables that hold what the command prints and writes."""

import pandas as pd
import pytest

import bilateral_rl as brl
from bilateral_rl.io.errors import UserError

FEW = {"trials": 4, "seed": 3}


@pytest.fixture
def models(make_run):
    return [brl.load(make_run(model, seeds=3).path) for model in ("bi_s", "uni_b")]


def test_models_have_three_tables(models, call, tmp_path):
    comparison = brl.compare(*models, metrics=["effort", "final_error"], **FEW)
    assert comparison.table[["metric", "group", "n"]].to_numpy().tolist() == [
        ["effort", "bi_s", 3], ["effort", "uni_b", 3], ["final_error", "bi_s", 3], ["final_error", "uni_b", 3],
    ]  # fmt: skip
    assert comparison.omnibus["test"].tolist() == ["one-way ANOVA", "Welch's ANOVA"] * 2
    assert (comparison.omnibus["df_between"] == 1).all()
    assert list(comparison.pairs.columns[:3]) == ["metric", "first", "second"]
    options = ["--metric", "effort", "--metric", "final_error", "--trials", 4, "--seed", 3, "--csv", "pairs.csv"]
    assert call("compare", *(run.path for run in models), *options)[0] == 0
    written = pd.read_csv(tmp_path / "pairs.csv", keep_default_na=False, na_values=[""])[list(comparison.pairs)]
    pd.testing.assert_frame_equal(written.fillna({"note": ""}), comparison.pairs, check_dtype=False)
    assert "Comparison.omnibus:" in repr(comparison)
    assert comparison._repr_html_().count("<table") == 3


def test_lesions_are_compared_from_their_table_as_from_the_folder(loaded, undrawn):
    given = {"lesions": ["callosum", "deep_dominant"], "retrain": "none", **FEW, "progress": False}
    results = loaded.lesion(**given, out=loaded.lesions_folder)
    of_table, of_folder = brl.compare(results, metrics="effort"), brl.compare(loaded.path, metrics="effort")
    assert of_table.table["group"].tolist() == ["intact", "callosum", "deep_dominant"]
    for name in ("table", "pairs", "omnibus"):
        pd.testing.assert_frame_equal(getattr(of_table, name), getattr(of_folder, name), check_dtype=False)
    assert of_table.omnibus.empty
    assert (of_table.pairs["protocol"] == "none").all()
    assert brl.compare(results).table["metric"].unique().tolist() == ["goal_completion_5cm"]


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (lambda a, b: brl.compare(), "There is nothing to compare"),
        (lambda a, b: brl.compare(a, a), "Seed 0 of .* is there 2 times"),
        (lambda a, b: brl.compare(a, b, metrics="beauty"), "Unknown metric 'beauty'"),
        (lambda a, b: brl.compare(a, b, metrics="hold_speed"), "leave it out of `metrics`"),
        (lambda a, b: brl.compare(a, b, retrain="none"), "^`retrain` chooses among the lesions of one run"),
        (lambda a, b: brl.compare(a, b, trials=0), "^`trials` must be at least 1"),
        (
            lambda a, b: brl.compare(a),
            r"call `run = bilateral_rl.load\('.*bi_s-bptt-1'\); run.lesion\(out=run\.",
        ),
        (lambda a, b: brl.compare(pd.DataFrame()), "This is no table of lesions"),
        (lambda a, b: brl.compare(a, pd.DataFrame()), "give one table, or the runs themselves"),
    ],
)
def test_a_slip_is_a_sentence(models, wrong, says):
    with pytest.raises(UserError, match=says):
        wrong(*models)
