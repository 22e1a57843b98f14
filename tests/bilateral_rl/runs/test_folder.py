import dataclasses
import errno
import importlib.metadata
import os
import shutil
import subprocess
import threading
from pathlib import Path

import pytest
import torch

from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder, find_runs
from bilateral_rl.training import run as training


def test_folders_are_numbered_and_never_shared(tmp_path, small):
    made: list[RunFolder] = []
    threads = [threading.Thread(target=lambda: made.append(RunFolder.create(tmp_path, small))) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(f.path.name for f in made) == sorted(f"cc_s-ppo-{n}" for n in range(1, 9))
    assert find_runs(tmp_path)[-1].path.name == "cc_s-ppo-8"


def test_configuration_and_weights_come_back_as_they_were(tmp_path, small):
    folder = RunFolder.create(tmp_path, small)
    assert folder.config() == small
    weights = {"a": torch.randn(3, 2), "b": torch.tensor(0.5)}
    folder.save_weights("final", weights)
    loaded = folder.load_weights("final")
    assert loaded.keys() == weights.keys()
    assert all(torch.equal(loaded[k], weights[k]) for k in weights)


def test_a_run_records_the_versions_that_made_it(run):
    versions = run.read_json("versions.json")
    assert versions["torch"] == importlib.metadata.version("torch")  # torch.__version__ may name a build of it too
    assert {"bilateral-rl", "commit", "python", "stable-baselines3", "warp-lang"} <= versions.keys()


def test_a_run_of_a_checkout_records_its_commit(run):
    root = Path(__file__).parents[3]
    if shutil.which("git") is None or not (root / ".git").exists():
        pytest.skip("no checkout")
    commit = run.read_json("versions.json")["commit"]
    command = ["git", "-C", str(root), "rev-parse", "HEAD"]
    head = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert head.startswith(commit.removesuffix("-dirty"))


def test_truncated_weights_are_refused(run):
    path = run.path / "weights" / "final.safetensors"
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(UserError, match="damaged"):
        run.load_weights("final")


def test_weights_that_are_not_finite_are_refused(run):
    weights = run.load_weights("final")
    weights["log_std"][0] = float("nan")
    run.save_weights("final", weights)
    with pytest.raises(UserError, match="log_std"):
        run.load_weights("final")


def test_a_hash_tells_which_weights_a_file_holds(run):
    before = run.weights_hash("final")
    weights = run.load_weights("final")
    run.save_weights("final", dict(reversed(weights.items())))
    assert run.weights_hash("final") == before
    weights["log_std"][0] += 1
    run.save_weights("final", weights)
    assert run.weights_hash("final") != before
    with pytest.raises(UserError, match="best, final"):
        run.weights_hash("finale")


def test_missing_weights_are_refused_naming_those_there_are(run):
    with pytest.raises(UserError, match="best, final"):
        run.load_weights("finale")


def test_a_missing_or_foreign_folder_is_refused(tmp_path):
    with pytest.raises(UserError, match="no run"):
        RunFolder.open(tmp_path / "nothing")
    with pytest.raises(UserError, match=r"config\.yaml"):
        RunFolder.open(tmp_path)


def test_a_model_is_no_run_but_can_be_made_one(tmp_path):
    (tmp_path / "model.ZIP").touch()
    with pytest.raises(UserError, match="bilateral-rl import"):
        RunFolder.open(tmp_path / "model.ZIP")


def test_names_that_no_file_can_have_are_no_runs():
    for name in ("x" * 5_000, "\0", "a/" * 3_000):
        with pytest.raises(UserError, match="no run"):
            RunFolder.open(Path(name))


def test_nothing_is_left_of_a_run_whose_first_files_cannot_be_written(tmp_path, small, monkeypatch):
    def fail(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(RunFolder, "write_json", fail)
    with pytest.raises(UserError, match="No space left on device"):
        RunFolder.create(tmp_path, small)
    assert not list((tmp_path / small.task).iterdir())


# The lock


def test_one_training_at_a_time_writes_into_a_folder(run):
    before = sorted(run.path.iterdir())
    with run.locked():
        with pytest.raises(UserError, match="Another training is writing into"), RunFolder(run.path).locked():
            pass
        with pytest.raises(UserError, match="Another training"), run.locked():
            pass
    with run.locked():
        pass
    assert sorted(run.path.iterdir()) == before


def test_what_a_killed_training_left_goes_with_the_next_one(run):
    weights, left = run.weight_names(), run.path / "weights/.final.safetensors.0a1b2c3d.tmp"
    left.write_text("half")
    assert run.weight_names() == weights
    with run.locked():
        assert not left.exists()


def test_a_lock_that_is_a_link_is_not_followed(run, tmp_path):
    (run.path / ".lock").symlink_to("config.yaml")
    before = (run.path / "config.yaml").read_text()
    with pytest.raises(UserError, match="Cannot write"), run.locked():
        pass
    assert (run.path / "config.yaml").read_text() == before


@pytest.mark.parametrize("of", ["run", "bptt_run"])
def test_a_run_that_is_trained_is_not_resumed(request, of):
    run = request.getfixturevalue(of)
    config = run.config()
    longer = {"epochs": 100} if config.algo == "bptt" else {"timesteps": 100_000}
    with run.locked(), pytest.raises(UserError, match="Another training"):
        training.resume(run, dataclasses.replace(config, **longer))


def test_a_folder_that_cannot_be_made_is_a_clear_error(tmp_path, small):
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="--out"):
        RunFolder.create(tmp_path / "file", small)
