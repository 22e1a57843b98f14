"""`bilateral-rl record`, and the page that says how to read what it writes."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

RUN = "runs/random_reach/cc_s-bptt-1"
PAGE = Path(__file__).parents[3] / "docs" / "recordings.md"


def test_every_network_with_every_lesion_does_the_trials_of_evaluate(invoke, trained, tmp_path):
    lesions = ("--lesion", "intact", "--lesion", "callosum")
    code, out = invoke("record", RUN, "--out", "data.csv", "--trials", 4, "--seed", 7, *lesions)
    assert (code, out) == (0, "Saved 24 trials in data.csv.\n")
    table = pd.read_csv(tmp_path / "data.csv")
    assert len(table) == 2 * 3 * 4 * 21
    assert table.seed.unique().tolist() == [0, 1, 2]
    for lesion in ("intact", "callosum"):
        assert invoke("evaluate", RUN, "--trials", 4, "--seed", 7, "--lesion", lesion, "--csv", "t.csv")[0] == 0
        measured = pd.read_csv(tmp_path / "t.csv")
        ends = table[(table.lesion == lesion) & (table.step == 20)]
        np.testing.assert_allclose(ends.distance_m, measured.final_error_m, rtol=1e-5)
        sums = table[table.lesion == lesion].groupby(["seed", "trial"]).reward_dominant.sum()
        np.testing.assert_allclose(sums, measured.return_dominant, rtol=1e-4)
    beside = json.loads((tmp_path / "data.csv.json").read_text())
    assert beside["run"] == RUN
    assert beside["seeds"] == [0, 1, 2]
    assert beside["settings"]["trial_length"] == 20
    assert beside["changed"] == {}
    assert {"bilateral-rl", "torch"} <= beside["versions"].keys()


def test_one_network_on_another_task_with_other_settings(invoke, trained, tmp_path):
    arguments = ("--task", "hold_position", "--set", "trial.max_load=3", "--set", "trial.arm.timestep=0.005")
    code, out = invoke("record", f"{RUN}:1", "--out", "data.npz", "--trials", 4, *arguments)
    assert code == 0
    assert "Note: A step is 5 ms here and was 10 ms in the training" in out
    with np.load(tmp_path / "data.npz") as data:
        assert data["seed"].tolist() == [1] * 4
        assert data["time"][-1] == pytest.approx(0.1)
        assert 0 < np.abs(data["load"]).max() <= 3
        np.testing.assert_array_equal(data["distance"][:, 0], 0)
        said = json.loads(str(data["metadata"]))
    trial = {"trial.trial_length": 20, "trial.max_load": 3.0, "trial.arm.timestep": 0.005}  # the length goes along
    assert said["changed"] == {"task": "hold_position", **trial}


MISTAKES = [
    (["record", RUN, "--out", "x.xlsx"], "ends in .csv, .npz, .parquet, .nc"),
    (["record", "runs/none", "--out", "x.csv"], "no run runs/none"),
    (["record", f"{RUN}:9", "--out", "x.csv"], "no seed 9"),
    (["record", RUN, "--out", "x.csv", "--trials", "0"], "--trials"),
    (["record", RUN, "--out", "x.csv", "--seed", "-1"], "--seed"),
    (["record", RUN, "--out", "x.csv", "--lesion", "left"], "Unknown lesion 'left'"),
    (["record", RUN, "--out", "x.csv", "--task", "juggle"], "Unknown task 'juggle'"),
    (
        ["record", RUN, "--out", "x.csv", "--set", "bptt.learning_rate=1"],
        "bptt.learning_rate changes nothing in a test",
    ),
    (
        ["record", RUN, "--out", "x.csv", "--set", "trial.threshold=0.1"],
        "trial.threshold changes nothing in a recording",
    ),
    (["record", RUN, "--out", "x.csv", "--weights", "none"], "the run's weights are"),
    (["record", RUN, "--out", "nowhere/x.csv"], "Cannot write nowhere/x.csv: No such file or directory"),
    (["evaluate", RUN, "--lesion", "left"], "Unknown lesion 'left'"),
    (["evaluate", RUN, "--set", "ppo.gamma=0.9"], "ppo.gamma changes nothing in a test"),
    (["evaluate", RUN, "--set", "trial.max_load=3"], "trial.max_load changes nothing in random_reach"),
]


@pytest.mark.parametrize(("arguments", "says"), MISTAKES)
def test_a_mistake_is_one_sentence_and_leaves_nothing(call, trained, tmp_path, arguments, says):
    code, out, err = call(*arguments)
    assert (code, out) == (2, "")
    assert says in err
    assert len(err.strip().splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["runs"]


def test_a_lesion_that_a_model_cannot_have_is_named_with_those_that_it_can(call, make_run):
    run = make_run("bi_s").path
    for command in (["record", "--out", "x.csv"], ["evaluate"]):
        code, _, err = call(*command, run, "--lesion", "callosum")
        assert code == 2
        assert "bilateral and cannot have the lesion callosum; choose from intact, shallow_dominant" in err


def test_trials_that_leave_all_bounds_are_told_and_nothing_is_left(call, trained, tmp_path):
    code, _, err = call("record", RUN, "--out", "x.csv", "--set", "trial.arm.timestep=1e6")
    assert code == 2
    assert "cannot be recorded: joint_velocity leaves all bounds" in err
    assert [path.name for path in tmp_path.iterdir()] == ["runs"]


def test_evaluate_says_what_was_changed(invoke, trained, tmp_path):
    changes = ("--task", "hold_position", "--set", "trial.max_load=3", "--set", "trial.trial_length=10")
    code, out = invoke(
        "evaluate", RUN, "--trials", 4, "--lesion", "deep_dominant", *changes, "--csv", "t.csv", "--json", "t.json"
    )
    assert code == 0
    said = "lesion: deep dominant; task = hold_position; trial.trial_length = 10; trial.max_load = 3.0"
    assert said in " ".join(out.split())
    assert "of 10 steps" in out
    table, values = pd.read_csv(tmp_path / "t.csv"), json.loads((tmp_path / "t.json").read_text())
    assert values["lesion"] == "deep_dominant"
    assert values["changed"] == {"task": "hold_position", "trial.trial_length": 10, "trial.max_load": 3.0}
    assert values["sides"]["contribution_dominant"] == 0
    assert (table.lesion == "deep_dominant").all()
    assert (table.task == "hold_position").all()
    assert (table["trial.max_load"] == 3).all()
    assert 0 < table[["load_x_N", "load_y_N"]].abs().max(axis=None) <= 3


def test_the_page_reads_what_the_command_writes(invoke, trained, monkeypatch):
    for name in ("reach.csv", "reach.parquet", "reach.npz", "reach.nc"):
        assert invoke("record", RUN, "--out", name, "--trials", 3)[0] == 0
    text = PAGE.read_text(encoding="utf-8")
    blocks = re.findall(r"```py\n(.*?)```", text, re.DOTALL)
    assert len(blocks) == 3
    names: dict = {}
    for block in blocks:
        exec(block, names)
    assert names["paths"].shape == (9, 21, 2)
    assert names["elbow"].shape == names["speed"].index.shape == (21,)
