"""A run as a folder to publish: it acts as the run does, and holds nothing that is executed or private."""

import re

import numpy as np
import pandas as pd
import pytest
import yaml

import bilateral_rl as brl
from bilateral_rl.analysis.metrics import find_metric
from bilateral_rl.api.evaluation import evaluate
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.export import exported_config
from bilateral_rl.runs.export_card import Measured, model_card
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import load_policies, network_states

FEW = {"trials": 6, "seed": 3}


def files(path):
    return sorted(file.relative_to(path).as_posix() for file in path.rglob("*") if file.is_file())


def card(path):
    """The metadata and the text of an exported folder's card."""
    _, head, text = (path / "README.md").read_text(encoding="utf-8").split("---\n", 2)
    return yaml.safe_load(head), text


def metrics(path):
    (model,) = card(path)[0]["model-index"]
    (result,) = model["results"]
    return {metric["type"]: metric["value"] for metric in result["metrics"]}


def test_all_networks_of_a_run_act_and_are_measured_as_they_were(bptt_run, tmp_path, same_bits):
    run = brl.load(bptt_run.path)
    made = run.export(tmp_path / "deep" / "made", **FEW)
    assert made == brl.load(tmp_path / "deep" / "made")
    names = ["README.md", "config.yaml", "epochs.csv", "status.json", "versions.json", "weights/final.safetensors"]
    assert files(made.path) == names
    pd.testing.assert_frame_equal(made.curves(), run.curves())
    before, after = network_states(bptt_run), network_states(made.folder)
    assert before.keys() == after.keys()
    assert all(same_bits(before[seed], after[seed]) for seed in before)
    pd.testing.assert_frame_equal(made.evaluate(**FEW), run.evaluate(**FEW))
    assert made.status["epochs"] == 6
    assert made.status["exported_from"] == "cc_s-bptt-1, final"
    assert (made.config, made.folder.read_json("versions.json")) == (run.config, bptt_run.read_json("versions.json"))
    assert list(made.path.parent.iterdir()) == [made.path]


def test_one_seed_of_several_and_weights_of_another_time(bptt_run, tmp_path, same_bits):
    made = brl.load(bptt_run.path, seed=2).export(tmp_path / "one", weights="best", **FEW)
    assert made.seeds == brl.load(tmp_path / "one").seeds == [2]
    expected = network_states(bptt_run, "best")[2]
    assert same_bits(network_states(made.folder)[2], expected)
    assert not same_bits(network_states(bptt_run, "final")[2], expected)
    assert [one["seed"] for one in made.status["seeds"]] == [2]
    assert {line.split(",")[0] for line in (made.path / "epochs.csv").read_text().splitlines()} == {"seed", "2"}
    assert made.status["exported_from"] == "cc_s-bptt-1, best"


def test_a_policy_of_reinforcement_learning_keeps_its_critics(run, tmp_path, same_bits):
    made = brl.load(run.path).export(tmp_path / "made", **FEW)
    pd.testing.assert_frame_equal(made.curves(), brl.load(run.path).curves())
    states = [load_policies(folder)[0].state_dict() for folder in (run, made.folder)]
    assert same_bits(*states)
    assert any("critic" in name or "value" in name for name in states[0])


def test_the_card_says_what_was_measured(bptt_run, tmp_path):
    run = brl.load(bptt_run.path)
    path = run.export(tmp_path / "made", **FEW).path
    records = evaluate(run, **FEW).records.values()
    told = metrics(path)
    assert len(told) > 8
    for name in ("goal_completion_5cm", "final_error", "return_dominant"):
        value = np.mean([find_metric(name).value(record) for record in records])
        assert told[name] == pytest.approx(value, rel=5e-3)
    total = np.mean([record.vector_return.mean() for record in records])
    mean, deviation = map(float, told["mean_reward"].split(" +/- "))
    assert mean == pytest.approx(total, abs=0.006)
    assert deviation > 0
    text = card(path)[1]
    assert "3 networks (seeds 0 to 2) that move a planar arm" in text
    assert "`bilateral-rl evaluate FOLDER --trials 6 --seed 3`" in text
    assert re.search(r"^\| Final error \| [\d.]+ cm \([\d.]+ to [\d.]+\) \|$", text, re.MULTILINE)


def test_a_hub_of_models_reads_the_card(bptt_run, tmp_path):
    huggingface_hub = pytest.importorskip("huggingface_hub")
    path = brl.load(bptt_run.path).export(tmp_path / "made", **FEW).path
    data = huggingface_hub.ModelCard((path / "README.md").read_text(encoding="utf-8")).data
    assert (data.library_name, data.pipeline_tag, data.model_name) == (
        "bilateral-rl",
        "robotics",
        "cc_s random_reach bptt",
    )
    assert {"cc_s", "bptt", "bilateral_rl/RandomReach-v0"} <= set(data.tags)
    read = {result.metric_type: result.metric_value for result in data.eval_results}
    assert read == metrics(path)


def test_the_lines_of_the_card_load_it_again(small_bptt, tmp_path):
    from bilateral_rl.training.run import train

    trial = {"trial_length": 20, "threshold": 0.03, "arm": {"timestep": 0.02}}
    noisy = {"network": {"hidden_noise": 0.1}}
    folder = train(small_bptt(seeds=2, epochs=1, trial=trial, **noisy), tmp_path / "runs").folder
    path = brl.load(folder.path).export(tmp_path / "made", **FEW).path
    (code,) = re.findall(r"```python\n(.*?)```", card(path)[1], re.DOTALL)
    names = {}
    exec(code.replace("FOLDER", path.as_posix()), names)
    assert names["env"].settings == folder.config().trial
    assert names["action"].shape == (8, 6)
    assert names["policy"].motor_network.noise.std == 0.1
    assert "hidden units are noisy (standard deviation 0.1)" in " ".join(card(path)[1].split())


def test_what_only_this_machine_knows_stays_here(bptt_run, small_bptt, tmp_path):
    from bilateral_rl.training.run import train

    config = small_bptt(seeds=1, epochs=1, init_from=f"{bptt_run.path}:0")
    folder = train(config, tmp_path / "runs").folder
    path = brl.load(folder.path).export(tmp_path / "made", **FEW).path
    for name in files(path):
        assert str(tmp_path).encode() not in (path / name).read_bytes()
    assert exported_config(folder, None).init_from is None


def test_what_has_no_value_is_left_out_of_the_index(small_bptt):
    nan = float("nan")
    measures = [Measured("a", "A", "", [nan, nan]), Measured("b", "B", "cm", [nan, 2.0])]
    text = model_card(small_bptt(), measures, (-1.0, 0.5), "Means")
    (model,) = yaml.safe_load(text.split("---\n")[1])["model-index"]
    assert [(m["type"], m["value"]) for m in model["results"][0]["metrics"]] == [
        ("mean_reward", "-1.00 +/- 0.50"),
        ("b", 2.0),
    ]
    assert "| A | – |" in text
    assert "| B | 2 cm (2 to 2) |" in text


def test_what_is_refused_leaves_nothing(bptt_run, tmp_path):
    run = brl.load(bptt_run.path)
    (tmp_path / "file").write_text("mine")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").write_text("mine")
    before = files(tmp_path)
    for out, weights, error in (
        ("file", "final", "file exists: choose another `out`, or remove it"),
        ("full", "final", "full exists: choose another `out`, or remove it"),
        ("file/below", "final", "Cannot write .*below: Not a directory; choose another `out`"),
        ("new", "step_9", "step_9.safetensors does not exist"),
    ):
        with pytest.raises(UserError, match=error):
            run.export(tmp_path / out, weights=weights, **FEW)
    assert files(tmp_path) == before
    assert not (tmp_path / "new").exists()


def test_an_empty_folder_is_taken(bptt_run, tmp_path):
    (tmp_path / "empty").mkdir()
    assert RunFolder.open(brl.load(bptt_run.path).export(tmp_path / "empty", **FEW).path)


def test_the_command_writes_what_other_commands_take(call, bptt_run, tmp_path):
    code, out, _ = call("export", f"{bptt_run.path}:1", "--out", "made", "--trials", 4)
    assert (code, "Exported to made" in out) == (0, True)
    assert call("evaluate", "made", "--trials", 4)[0] == 0
    assert call("lesion", "made", "--lesion", "callosum", "--no-retrain", "--trials", 4)[0] == 0
    code, _, error = call("export", bptt_run.path, "--out", "made")
    assert (code, "made exists: choose another --out" in error) == (2, True)
