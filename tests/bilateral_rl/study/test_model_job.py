"""A job of one training: what it leaves, and that it goes on where it was, whatever stopped it."""

import json
import shutil
import signal
from pathlib import Path

import pandas as pd
import pytest
import torch
from torch.utils.tensorboard import SummaryWriter

from bilateral_rl.analysis.results import COLUMNS
from bilateral_rl.config.parse import merge
from bilateral_rl.config.resolve import resolve
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder, find_runs
from bilateral_rl.study.lesioning import measured_metrics
from bilateral_rl.study.model_job import find_run, is_run_of, train_and_measure
from bilateral_rl.training import checkpoint, supervised
from bilateral_rl.training import run as training

RESULT = "results/random_reach/cc_s.csv"
LESIONS = {"lesions": ["callosum"], "trials": 16, "retraining_trials": 64, "profile": "paper"}


class Watcher:
    """Keeps what it is told, and reacts once when ``when(done, text, n)`` holds."""

    def __init__(self, when=lambda done, text, n: False, react=lambda: None):
        self.told, self._when, self._react = [], when, react

    def __call__(self, done, text):
        self.told.append((done, text))
        if self._when(done, text, len(self.told)):
            self._when = lambda *_: False
            self._react()


def press_ctrl_c():
    signal.raise_signal(signal.SIGINT)


def leave_at_once():
    raise KeyboardInterrupt


def work(folder, config, watcher=None):
    tables = [{"lesions": LESIONS, "result": RESULT}]
    train_and_measure(folder, watcher or Watcher(), config.to_values(), tables, "runs")


def contents(path):
    return {str(file.relative_to(path)): file.read_bytes() for file in path.rglob("*") if file.is_file()}


def no_training(*_):
    raise AssertionError("trained again")


@pytest.fixture(autouse=True)
def no_pictures(monkeypatch):
    """They take longer than these trainings."""
    monkeypatch.setattr(supervised, "hand_paths", lambda *_: None)
    monkeypatch.setattr(SummaryWriter, "add_figure", lambda *_, **__: None)


@pytest.fixture(scope="module")
def config(small_bptt):
    """Three epochs of four updates of two seeds."""
    return small_bptt(bptt={"trials": 64, "learning_rate": 0.02}, threads=1)


@pytest.fixture(scope="module")
def whole(config, tmp_path_factory):
    """The job done in one go."""
    folder = tmp_path_factory.mktemp("whole")
    watcher = Watcher(lambda *_: (folder / RESULT).exists(), no_training)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(supervised, "hand_paths", lambda *_: None)
        patch.setattr(SummaryWriter, "add_figure", lambda *_, **__: None)
        work(folder, config, watcher)
    return folder, watcher.told


def copy_of(whole, tmp_path):
    shutil.copytree(whole[0], tmp_path / "study")
    (tmp_path / "study" / RESULT).unlink()
    return tmp_path / "study"


def test_it_trains_and_writes_the_results_last(config, whole):
    folder, told = whole  # the watcher saw no results before the end
    (run,) = find_runs(folder / "runs")
    assert run.path == folder / "runs" / "random_reach" / "cc_s-bptt-1"
    assert run.status()["state"] == "finished"
    results = pd.read_csv(folder / RESULT)
    assert list(results) == list(COLUMNS)
    states = results[["seed", "lesion", "network", "protocol"]].drop_duplicates()
    assert len(states) == 2 * 2 * 2 * 3
    assert set(results["lesion"]) == {"intact", "callosum"}
    assert set(results["seed"]) == {0, 1}
    assert set(results["metric"]) == {metric.name for metric in measured_metrics(config)}
    assert {path.name for path in (folder / RESULT).parent.iterdir()} == {"cc_s.csv", "cc_s.json"}
    source = json.loads((folder / RESULT).with_suffix(".json").read_text())
    assert source["run"] == "../../runs/random_reach/cc_s-bptt-1"
    assert source["weights_hash"] == run.weights_hash("final")
    assert source["trials"] == 16
    shares = [done for done, _ in told]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    assert {text for _, text in told} >= {"training", "testing: intact", "testing: callosum", "tested"}


@pytest.mark.parametrize(
    ("when", "react", "saved"),
    [
        pytest.param(lambda done, text, n: done > 0.4, leave_at_once, 1 / 3, id="within the second epoch"),
        pytest.param(lambda done, text, n: done > 0.4, press_ctrl_c, 1 / 3, id="Ctrl-C within the second epoch"),
        pytest.param(lambda done, text, n: n == 1, leave_at_once, 0, id="before anything was saved"),
        pytest.param(lambda done, text, n: n == 1, press_ctrl_c, 0, id="Ctrl-C at the start"),
        pytest.param(lambda done, text, n: text == "testing: callosum", leave_at_once, 1, id="among the tests"),
    ],
)
def test_interrupted_it_goes_on_and_ends_as_if_it_had_not_been(tmp_path, config, whole, when, react, saved):
    with pytest.raises(KeyboardInterrupt):
        work(tmp_path, config, Watcher(when, react))
    assert not (tmp_path / RESULT).exists()
    (before,) = find_runs(tmp_path / "runs")
    watcher = Watcher()
    work(tmp_path, config, watcher)
    assert watcher.told[0][0] == pytest.approx(saved / 1.2)  # it tells first what was done
    assert [run.path for run in find_runs(tmp_path / "runs")] == [before.path]
    assert (tmp_path / RESULT).read_bytes() == (whole[0] / RESULT).read_bytes()
    for name in ("weights/final.safetensors", "weights/best.safetensors", "resume.safetensors", "epochs.csv"):
        own, other = (folder / "runs" / "random_reach" / "cc_s-bptt-1" / name for folder in (tmp_path, whole[0]))
        assert own.read_bytes() == other.read_bytes()


def test_a_finished_run_is_tested_and_not_trained_again_by_whatever_threads(tmp_path, config, whole, monkeypatch):
    folder = copy_of(whole, tmp_path)
    before = contents(folder / "runs")
    for name in ("train", "resume"):
        monkeypatch.setattr(training, name, no_training)
    work(folder, resolve(None, None, [config.to_values() | {"threads": 2}]))
    assert contents(folder / "runs") == before
    assert (folder / RESULT).read_bytes() == (whole[0] / RESULT).read_bytes()


def test_a_failed_run_is_refused_and_stays(tmp_path, config, whole):
    folder = copy_of(whole, tmp_path)
    run = find_run(folder / "runs", config)
    run.write_json("status.json", run.status() | {"state": "failed"})
    before = contents(folder / "runs")
    with pytest.raises(UserError, match=r"cc_s-bptt-1 failed before; remove that folder to try again\."):
        work(folder, config)
    assert contents(folder / "runs") == before
    assert not (folder / RESULT).exists()


def test_runs_of_other_settings_are_left_alone(tmp_path, config, small_bptt):
    others = [merge(config.to_values(), {"seed": 5}), small_bptt("cc_s", "hold_position").to_values()]
    for values in others:
        training.train(resolve(None, None, [merge(values, {"epochs": 1})]), tmp_path / "runs")
    damaged = tmp_path / "runs" / "random_reach" / "cc_s-bptt-7"
    damaged.mkdir()
    (damaged / "config.yaml").write_text("seed: [")
    before = contents(tmp_path / "runs")
    work(tmp_path, config)
    after = contents(tmp_path / "runs")
    assert {name: after[name] for name in before} == before
    assert find_run(tmp_path / "runs", config).path.name == "cc_s-bptt-8"


def test_a_run_is_found_by_all_its_settings_but_those_of_the_machine(config, whole):
    runs, values = whole[0] / "runs", config.to_values()

    def found(**changes):
        return find_run(runs, resolve(None, None, [merge(values, changes)])) is not None

    assert found()
    assert found(threads=4)
    assert found(device="cuda")
    assert not found(seeds=3)
    assert not found(epochs=4)
    assert not found(model="cc_ns")
    assert not found(task="hold_position")
    assert not found(bptt={"learning_rate": 0.03})


def test_a_training_that_fails_says_why(tmp_path, small_bptt):
    config = small_bptt(bptt={"learning_rate": 1e30}, epochs=2)
    with pytest.raises(UserError, match="no longer a number"):
        work(tmp_path, config)
    with pytest.raises(UserError, match="failed before"):
        work(tmp_path, config)
    assert not (tmp_path / RESULT).exists()


def test_reinforcement_learning_killed_before_its_first_save_starts_anew(tmp_path, small, run):
    config = resolve(None, None, [small.to_values() | {"seed": 3, "timesteps": 1000}])
    path = tmp_path / "runs" / "random_reach" / "cc_s-ppo-1"
    half = RunFolder(path)
    half.write_config(config)
    (path / "resume.safetensors").unlink()
    (path / "status.json").write_text(json.dumps({"state": "running", "timesteps": 0, "updates": 0}))
    work(tmp_path, config)
    assert half.status()["state"] == "finished"
    results = pd.read_csv(tmp_path / RESULT)
    assert set(results["seed"]) == {3}
    assert set(results["algo"]) == {"ppo"}


def test_a_run_whose_updates_went_by_other_rules_is_none_of_a_study(tmp_path):
    run = RunFolder(tmp_path / "run")
    shutil.copytree(Path(__file__).parents[2] / "data" / "run_0_1_0_ppo", run.path)
    assert not is_run_of(run, run.config())
    state = run.load_resume()
    run.save_resume(state | {checkpoint.RULES: torch.tensor(checkpoint.UPDATE_RULES)})
    assert is_run_of(run, run.config())
    (run.path / "resume.safetensors").write_bytes(b"damaged")
    assert is_run_of(run, run.config()), "whoever goes on with it says so"
