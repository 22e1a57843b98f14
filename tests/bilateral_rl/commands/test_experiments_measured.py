"""Experiments in the commands that measure: taken apart, recorded, compared and lesioned."""

import io
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from everything import EVERYTHING

from bilateral_rl.api import compare, load


@pytest.fixture
def tested(call, make_run):
    """Calls a command on a fresh network in the experiment with everything."""
    run = make_run()

    def tested(command, *arguments):
        return call(command, run.path, "--trials", 64, "--task", EVERYTHING, *arguments)

    return tested


@pytest.mark.parametrize(
    ("by", "column", "expected"),
    [("target", "target", [0, 1, 2, 3]), ("phase", "phase", ["hold", "reach"]), ("condition", "condition", None)],
)
def test_trials_are_taken_apart_on_the_terminal_and_in_files(tested, by, column, expected):
    code, out, _ = tested("evaluate", "--by", by, "--csv", "parts.csv", "--json", "parts.json")
    assert code == 0
    table = pd.read_csv("parts.csv")
    assert {"seed", "trials", "lesion", "task"} < set(table)
    assert expected is None or table[column].tolist() == expected
    assert by == "phase" or table["trials"].sum() == 64
    parts = json.loads(Path("parts.json").read_text())["parts"]
    assert [part[column] for part in parts] == table[column].tolist()
    assert all(str(name)[:8] in out for name in table[column])


def test_what_cannot_take_trials_apart_is_refused_before_anything_is_tested(call, make_run):
    run = make_run().path
    code, out, error = call("evaluate", run, "--by", "hour")
    assert (code, out) == (2, "")
    assert "--by must be one of target, condition, phase" in error
    code, out, error = call("evaluate", run, "--by", "target", "--trials", 4)
    assert (code, out) == (2, "")
    assert "no list" in error


def test_a_recording_says_condition_cue_and_target_of_each_trial(tested):
    assert tested("record", "--out", "trials.csv")[0] == 0
    table = pd.read_csv("trials.csv")
    assert list(table)[:7] == ["seed", "lesion", "trial", "condition", "target_index", "step", "time_s"]
    first = table.groupby("trial").first()
    assert first["go_step"].isna().equals(first["condition"].str.contains("no_go"))
    assert first["go_step"].dropna().between(3, 6).all()
    np.testing.assert_allclose(np.degrees(first["target_angle_rad"]) % 360, 90.0 * first["target_index"], atol=0.01)


def test_the_python_face_gives_the_same_table(tested, make_run):
    run = load(make_run().path)
    table = run.evaluate(64, task=EVERYTHING, by="target")
    _, out, _ = tested("evaluate", "--by", "target", "--csv", "-")
    read = pd.read_csv(io.StringIO(out))
    np.testing.assert_allclose(read["final_error"], table["final_error"], rtol=1e-6)


@pytest.fixture
def mixed(make_run):
    """Builder of runs of a curl field that is off in some trials and a channel in others."""

    def mixed(model):
        forces = {"field_off_share": 0.3, "channel": {"share": 0.3}}
        return make_run(model, task="curl_field", experiment={"forces": forces}, seeds=3).path

    return mixed


def test_lesions_and_comparisons_are_of_the_fields_trials_unless_one_says_otherwise(call, mixed, undrawn):
    run, other = mixed("cc_s"), mixed("uni_b")
    lesion = ("--lesion", "callosum", "--no-retrain", "--no-control", "--trials", 32)
    code, out, error = call("lesion", run, *lesion)
    assert code == 0, error
    assert "No better than" not in out
    preferred = "goal_completion_2cm_in_field"
    table = pd.read_csv(load(run).lesions_folder / "lesions.csv")
    assert {preferred, "final_error", "final_error_in_null", "channel_compensation"} < set(table["metric"])
    assert set(table["task"]) == {"curl_field"}
    assert compare(run).parts[0].keys["metric"] == preferred
    assert compare(run, metrics="final_error_in_null").parts[0].keys["metric"] == "final_error_in_null"
    assert compare(run, other, trials=32).parts[0].keys["metric"] == preferred
    assert (
        compare(load(run).lesion("callosum", "none", control=False, trials=32, progress=False))
        .parts[0]
        .keys["metric"]
        .startswith("goal_completion_")
    )
