"""Supervised trainings on the command line: what is printed, written and refused."""

import json
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from bilateral_rl.commands import app as cli
from bilateral_rl.commands.train import _next_training
from bilateral_rl.config.resolve import resolve
from bilateral_rl.runs.folder import RunFolder

SMALL = [
    *("--algo", "bptt", "--seeds", "2", "--epochs", "3", "--set", "trial.trial_length=20"),
    *("--set", "bptt.trials=32", "--set", "bptt.batch_size=16", "--set", "bptt.validation_trials=8"),
]
RUN = "runs/random_reach/cc_s-bptt-1"


@pytest.fixture
def trained(_trained_bptt, tmp_path):
    """A finished run of three seeds at ``RUN``."""
    shutil.copytree(_trained_bptt.path, tmp_path / RUN)
    return RunFolder(tmp_path / RUN)


def percentages(out):
    """Goal completion at 5 cm, as printed."""
    found = re.search(r"5 cm\s+│\s+([\d.]+)(?: ± ([\d.]+))? %", out)
    assert found, out
    return found[1], found[2]


def test_train_says_what_it_does_what_came_of_it_and_what_is_next(call, tmp_path):
    code, out, err = call("train", *SMALL, "--model", "bi_s", "--task", "hold_position", "--seed", "4")
    run = "runs/hold_position/bi_s-bptt-1"
    assert (code, err) == (0, "")
    text = " ".join(out.split())
    assert "bi_s learns hold_position by bptt: up to 3 epochs of 32 trials, seeds 4 to 5 side by side" in text
    for epoch in (1, 2, 3):
        judged = r"\d+ of \d+ steps in goal, final error"
        assert re.search(rf"epoch +{epoch}, 2 of 2 seeds training, validation loss \d\.\d+: {judged}", out)
    assert re.search(r"5 cm +│ +– │ +– │ +[\d.]+ ± [\d.]+ of 20 steps", out)  # a hold, which starts in its goal
    assert "mean ± standard deviation over 2 seeds" in text
    assert re.search(r"Sides: dominant \d+ ± \d+ %, non-dominant \d+ ± \d+ % of the commands' modulation", text)
    for line in (f"Saved in {run}", f"bilateral-rl evaluate {run}", "tensorboard --logdir runs"):
        assert line in out
    assert f"bilateral-rl train --algo ppo --model bi_s --task hold_position --init-from {run}:4\n" in out
    values = yaml.safe_load((tmp_path / run / "config.yaml").read_text())
    expected = {"algo": "bptt", "model": "bi_s", "task": "hold_position", "seed": 4, "seeds": 2, "epochs": 3}
    assert {name: values[name] for name in expected} == expected
    assert values["bptt"]["batch_size"] == 16


def test_what_is_said_to_be_next_works(call):
    code, out, _ = call("train", *SMALL)
    assert code == 0
    (following,) = re.findall(r"bilateral-rl (train --algo ppo .*)", out)
    quick = ["--timesteps", "1000", "--n-envs", "20", "--set", "ppo.batch_size=250", "--set", "evaluation.trials=8"]
    code, out, err = call(*following.split(), *quick, "--set", "trial.trial_length=20")
    assert (code, err) == (0, "")
    code, out, err = call("train", *SMALL, "--init-from", "runs/random_reach/cc_s-ppo-1")
    assert (code, err) == (0, "")
    config = RunFolder.open(cli.RUNS / "random_reach" / "cc_s-bptt-2").config()
    assert config.init_from == "runs/random_reach/cc_s-ppo-1"


def test_flags_reach_the_configuration(call, tmp_path):
    flags = ["--seeds", "1", "--epochs", "1", "--profile", "released", "--units", "10", "--threshold", "0.02"]
    code, *_ = call("train", *SMALL, *flags, "--set", "bptt.penalty_coefficient=0.5", "--out", "elsewhere")
    assert code == 0
    config = RunFolder.open(tmp_path / "elsewhere/random_reach/cc_s-bptt-1").config()
    assert (config.seeds, config.epochs, config.profile, config.trial.threshold) == (1, 1, "released", 0.02)
    assert (config.penalty, config.penalty_coefficient) == ("released", 0.5)


def test_a_range_of_seeds_trains_those_networks(call, tmp_path):
    code, out, err = call("train", *SMALL, "--seeds", "103..105", "--epochs", 1)
    assert (code, err) == (0, "")
    assert "seeds 103 to 105 side by side" in " ".join(out.split())
    assert f"--init-from {RUN}:103" in out
    config = RunFolder(tmp_path / RUN).config()
    assert (config.seed, config.seeds) == (103, 3)
    call("evaluate", f"{RUN}:104", "--trials", 4, "--csv", "one.csv")
    assert set(pd.read_csv(tmp_path / "one.csv")["seed"]) == {104}
    assert "has no seed 1; it has seeds 103 to 105" in call("evaluate", f"{RUN}:1")[2]
    code, *_ = call("train", *SMALL, "--init-from", RUN, "--seeds", "104..105", "--epochs", 1)
    assert code == 0


def test_evaluate_tests_every_seed_and_writes_a_row_a_trial_and_seed(call, trained, tmp_path):
    code, out, err = call("evaluate", RUN, "--trials", 16, "--csv", "t.csv", "--json", "t.json")
    assert (code, err) == (0, "")
    rows = pd.read_csv(tmp_path / "t.csv")
    assert len(rows) == 16 * 3
    assert rows.groupby("seed")["trial"].apply(list).to_dict() == {seed: list(range(16)) for seed in range(3)}
    table = json.loads((tmp_path / "t.json").read_text())
    assert list(table["by_seed"]) == ["0", "1", "2"]
    by_seed = [table["by_seed"][str(seed)]["0.05"] for seed in range(3)]
    for name, mean in table["by_threshold_m"]["0.05"].items():
        values = [values[name] for values in by_seed if values[name] is not None]
        assert mean == (pytest.approx(np.mean(values)) if values else None)
    errors = 100 * rows.groupby("seed")["final_error_m"].mean()
    assert [values["final_error_cm"] for values in by_seed] == pytest.approx(errors.tolist(), rel=1e-5)
    assert len(set(errors)) == 3
    completion = [values["goal_completion_percent"] for values in by_seed]
    assert [float(p) for p in percentages(out)] == pytest.approx(
        [np.mean(completion), np.std(completion, ddof=1)], abs=0.051
    )
    assert "over 3 seeds" in " ".join(out.split())


def test_evaluate_tells_what_each_side_supplies_a_seed_and_in_all(call, trained, tmp_path):
    _, out, _ = call("evaluate", RUN, "--trials", 16, "--json", "t.json")
    sides = json.loads((tmp_path / "t.json").read_text())["sides"]
    by_seed = [sides["by_seed"][str(seed)]["contribution_percent_dominant"] for seed in range(3)]
    assert sides["contribution_percent_dominant"] == pytest.approx(np.mean(by_seed))
    printed = re.findall(r"([0-2]|all) +│ dominant +│ +([\d.]+)(?: ± ([\d.]+))? %", out)
    assert [name for name, *_ in printed] == ["0", "1", "2", "all"]
    assert [float(share) for _, share, _ in printed[:3]] == pytest.approx(by_seed, abs=0.051)
    _, mean, deviation = printed[3]
    assert [float(mean), float(deviation)] == pytest.approx([np.mean(by_seed), np.std(by_seed, ddof=1)], abs=0.051)


def test_evaluate_tests_one_seed_if_it_is_named(call, trained, tmp_path):
    call("evaluate", RUN, "--trials", 16, "--csv", "all.csv", "--json", "all.json")
    code, out, err = call("evaluate", f"{RUN}:1", "--trials", 16, "--csv", "one.csv", "--json", "one.json")
    assert (code, err) == (0, "")
    assert percentages(out)[1] is None
    rows, one = pd.read_csv(tmp_path / "all.csv"), pd.read_csv(tmp_path / "one.csv")
    pd.testing.assert_frame_equal(one, rows[rows["seed"] == 1].reset_index(drop=True))
    tables = [json.loads((tmp_path / f"{name}.json").read_text()) for name in ("all", "one")]
    assert tables[1]["by_seed"] == {"1": tables[0]["by_seed"]["1"]}
    assert tables[1]["by_threshold_m"] == tables[1]["by_seed"]["1"]


def test_data_for_the_terminal_are_apart_from_what_people_read(call, bptt_run):
    _, out, err = call("evaluate", bptt_run.path, "--trials", 4, "--json", "-")
    assert set(json.loads(out)["by_seed"]) == {"0", "1", "2"}
    assert "goal completion" in err


def test_evaluate_tests_the_best_weights_if_asked(call, trained, tmp_path):
    for weights in ("final", "best"):
        code, *_ = call("evaluate", RUN, "--trials", 16, "--weights", weights, "--csv", f"{weights}.csv")
        assert code == 0
    final, best = (pd.read_csv(tmp_path / f"{weights}.csv") for weights in ("final", "best"))
    assert not final.equals(best)


def test_list_shows_a_run_of_several_seeds(call, trained):
    code, out, _ = call("list")
    assert code == 0
    text = " ".join(out.split())
    for word in ("bptt", "supervised", "finished", "6 epochs of 3 seeds"):
        assert word in text
    assert RUN in "".join(out.split())


def test_resume_goes_on_to_more_epochs(call, trained):
    code, out, err = call("train", "--resume", RUN, "--epochs", 8)
    assert (code, err) == (0, "")
    assert re.search(r"epoch +7,", out)
    assert not re.search(r"epoch +6,", out)
    assert (trained.status()["epochs"], trained.config().epochs) == (8, 8)


MISTAKES = [
    (["train", "--resume", RUN, "--timesteps", "1000"], "here, not --timesteps"),
    (["train", "--resume", RUN, "--seeds", "4"], "not --seeds"),
    (["train", "--resume", RUN, "--profile", "released"], "not --profile"),
    (["train", "--resume", RUN, "--init-from", RUN], "not --init-from"),
    (["train", "--resume", RUN], "larger --epochs"),
    (["train", "--resume", RUN, "--epochs", "6"], "larger --epochs"),
    (["evaluate", f"{RUN}:3"], "has no seed 3; it has seeds 0 to 2"),
    (["evaluate", RUN, "--weights", "step_1"], "best, final"),
    (["train", *SMALL, "--init-from", RUN, "--seed", "2"], f"name one, as {RUN}:0"),
    (["train", *SMALL, "--init-from", f"{RUN}:3"], "has no seed 3"),
    (["train", *SMALL, "--init-from", RUN, "--model", "uni_b"], "unilateral"),
    (["train", "--algo", "ppo", "--init-from", RUN, "--seed", "3"], f"name one, as {RUN}:0"),
]


def test_a_mistake_about_a_run_is_one_clear_sentence_and_leaves_it_alone(call, trained, tmp_path):
    def files():
        return {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}

    before = files()
    for arguments, says in MISTAKES:
        code, _, err = call(*arguments)
        assert code == 2
        assert says in err, arguments
        assert len(err.strip().splitlines()) == 1
        assert files() == before


def test_a_training_that_fails_in_every_seed_is_one_clear_sentence(call, tmp_path):
    code, _, err = call("train", *SMALL, "--set", "bptt.learning_rate=1e30")
    assert code == 2
    assert "Seed 0 failed" in err
    assert "Seed 1 failed" in err
    assert "bptt.learning_rate" in err
    assert len(err.strip().splitlines()) == 1
    assert RunFolder(tmp_path / RUN).status()["state"] == "failed"
    code, out, _ = call("list")
    assert code == 0
    assert "failed" in out
    assert call("evaluate", RUN, "--trials", 4)[0] == 0
    code, _, err = call("train", "--resume", RUN, "--epochs", 9)
    assert code == 2
    assert len(err.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("task", "changes", "known"), [("center_out", {}, True), ("mine.yaml", {}, False),
                                   ("curl_field", {"experiment": {"forces": {"curl": 3}}}, False)],
)  # fmt: skip
def test_what_is_suggested_next_can_be_typed(task, changes, known, tmp_path, monkeypatch):
    """A run keeps an experiment of one's own, but not the path of its file: its own configuration is one."""
    monkeypatch.chdir(tmp_path)
    Path("mine.yaml").write_text("start: {hand: [0.0, 0.4]}\ntarget: {center_out: {}}\n")
    config = resolve("bptt", task, [changes])
    run = RunFolder(Path("runs/a/b"))
    run.begin(config)
    suggested = shlex.split(_next_training(config, str(run.path), Path("runs")))
    named = suggested[suggested.index("--task") + 1]
    assert named == (task if known else "runs/a/b/config.yaml")
    assert resolve("ppo", named).experiment == config.experiment
