import json
import os
import re
import signal
import threading
import time

import pandas as pd
import pytest
import yaml

import bilateral_rl
from bilateral_rl.vocabulary import SIDES

SMALL = ["--timesteps", "2000", "--n-envs", "20", "--set", "ppo.batch_size=250", "--set", "evaluation.trials=8"]


def test_train_then_evaluate_then_list(call, tmp_path):
    code, out, err = call("train", "--model", "bi_s", "--task", "hold_position", *SMALL)
    assert (code, err) == (0, "")
    run = "runs/hold_position/bi_s-ppo-1"
    for line in (
        f"bilateral-rl evaluate {run}",
        f"bilateral-rl render {run}",
        "tensorboard --logdir runs",
        "goal completion",
    ):
        assert line in out
    assert "--out" not in out
    progress = re.findall(r"steps: .*", out)
    assert progress
    assert all(re.match(r"steps: \d+ of 50 steps in goal, final error", line) for line in progress), "not of completion"
    sides = re.search(
        r"Sides: dominant (\d+) %, non-dominant (\d+) % of the commands' modulation; constant parts ", out
    )
    assert sides
    assert yaml.safe_load((tmp_path / run / "config.yaml").read_text())["model"] == "bi_s"

    code, out, err = call("evaluate", run, "--trials", 16, "--csv", "t.csv", "--json", "t.json")
    assert (code, err) == (0, "")
    table = json.loads((tmp_path / "t.json").read_text())
    assert list(table["by_threshold_m"]) == ["0.02", "0.03", "0.05"]
    printed = re.search(r"5 cm\s+│ +– │ +– │ +([\d.]+) of 50 steps", out)  # a hold starts in its goal
    assert printed
    assert float(printed[1]) == pytest.approx(table["by_threshold_m"]["0.05"]["time_in_goal_steps"], abs=0.051)
    assert table["by_threshold_m"]["0.05"]["goal_completion_percent"] == 100
    assert len(pd.read_csv(tmp_path / "t.csv")) == 16
    percent = [table["sides"][f"contribution_percent_{side}"] for side in SIDES]
    assert sum(percent) == pytest.approx(100)
    printed = re.findall(r"dominant +│ +([\d.]+) %", out)
    assert [float(share) for share in printed] == pytest.approx(percent, abs=0.051)

    code, _, err = call("evaluate", run, "--set", "trial.load")
    assert (code, "such as trial.sensory_noise=0.01" in err) == (2, True)

    # The end of a training and `evaluate` do the same trials.
    code, out, _ = call("evaluate", run)
    printed = re.findall(r"dominant +│ +([\d.]+) %", out)
    assert [float(share) for share in printed] == pytest.approx([float(share) for share in sides.groups()], abs=0.56)

    code, out, _ = call("list")
    assert code == 0
    for word in ("cc_ns", "random_reach", "ppo", "finished", "2,000"):
        assert word in out
    assert run in "".join(out.split())


def test_the_version_is_printed_alone(call):
    assert call("--version") == (0, f"{bilateral_rl.__version__}\n", "")


def test_a_network_with_one_side_is_told_of_nothing_about_sides(call, tmp_path):
    code, out, _ = call("train", "--model", "uni_dl", *SMALL)
    assert (code, "Sides" in out) == (0, False)
    code, out, _ = call("evaluate", "runs/random_reach/uni_dl-ppo-1", "--trials", 4, "--json", "t.json")
    assert (code, "side" in out) == (0, False)
    assert "sides" not in json.loads((tmp_path / "t.json").read_text())


def test_a_configuration_file_repeats_a_run_and_flags_win_over_it(call, tmp_path):
    code, *_ = call("train", *SMALL, "--seed", 5)
    assert code == 0
    first = tmp_path / "runs/random_reach/cc_s-ppo-1"
    code, *_ = call("train", "--config", first / "config.yaml", "--units", 12)
    assert code == 0
    values = [yaml.safe_load((tmp_path / f"runs/random_reach/cc_s-ppo-{n}/config.yaml").read_text()) for n in (1, 2)]
    assert values[1]["seed"] == 5
    assert values[1]["network"]["units"] == 12
    values[1]["network"]["units"] = 10
    assert values[0] == values[1]


MISTAKES = [
    (["train", "--model", "[/x]"], "'[/x]'"),
    (["train", "--n-envs", "0"], "n_envs"),
    (["train", "--units", "7"], "odd"),
    (["train", "--set", "timesteps=2020-99-99"], "neither"),
    (["train", "--set", "trial.max_load=5"], "trial.max_load changes nothing in random_reach, which draws no load"),
    (["train", "--config", "missing.yaml"], "missing.yaml"),
    (["train", "--resume", "runs/none"], "no run"),
    (["train", "--resume", "runs/none", "--out", "x"], "--out"),
    (["train", "--resume", "runs/none", "--units", "12"], "not --units. For other settings begin a new run"),
    (["train", "--resume", "runs/none", "--seed", "2"], "begin a new run: `bilateral-rl train --init-from runs/none`"),
    (["evaluate", "none"], "no run none in "),
    (["train", "--out", "/proc/nothing", *SMALL], "--out"),
    (["train", "--algo", "bptt", "--timesteps", "1000"], "timesteps"),
    (["train", "--epochs", "2"], "epochs"),
    (["train", "--algo", "bptt", "--init-from", "runs/none"], "no run runs/none"),
    (["train", "--algo", "bptt", "--init-from", "runs/none:3"], "no run runs/none"),
    (["evaluate", "runs/none:1"], "no run runs/none"),
    (["evaluate", "."], "config.yaml"),
]


def test_a_mistake_is_one_clear_sentence_and_leaves_nothing_behind(call, tmp_path):
    for arguments, says in MISTAKES:
        code, out, err = call(*arguments)
        assert code == 2
        assert not out or "/proc/nothing" in arguments  # it shows only when the training has begun
        assert err.startswith("Error: ")
        assert says in err, arguments
        assert len(err.strip().splitlines()) == 1
        assert list(tmp_path.iterdir()) == []


def test_ctrl_c_saves_and_says_how_to_go_on(call, tmp_path):
    run = tmp_path / "runs/random_reach/cc_s-ppo-1"

    def press_ctrl_c():
        deadline = time.monotonic() + 90
        while not (run / "evaluations.csv").exists() and time.monotonic() < deadline:
            time.sleep(0.1)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=press_ctrl_c).start()
    code, out, err = call("train", "--timesteps", "100000000", "--n-envs", "20")
    assert code == 130, err
    assert "bilateral-rl train --resume runs/random_reach/cc_s-ppo-1" in " ".join(out.split())
    assert json.loads((run / "status.json").read_text())["state"] == "interrupted"
    assert (run / "weights/final.safetensors").exists()
