import threading

import pytest
import torch

from bilateral_rl.errors import UserError
from bilateral_rl.run_folder import RunFolder, find_runs, replacing


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


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path):
    path = tmp_path / "file"
    path.write_text("old")

    def fail():
        with replacing(path) as temporary:
            temporary.write_text("ne")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_run_records_the_versions_that_made_it(run):
    versions = run.read_json("versions.json")
    assert versions["torch"] == torch.__version__
    assert {"bilateral-rl", "commit", "python", "stable-baselines3", "warp-lang"} <= versions.keys()


@pytest.mark.parametrize(
    "content", [b"", b"not tensors", b"\xff" * 8 + b"{}", b"\x08\x00\x00\x00\x00\x00\x00\x00{}      "]
)
def test_damaged_weights_are_refused(run, content):
    (run.path / "weights" / "final.safetensors").write_bytes(content)
    from bilateral_rl.controllers import load_policy

    with pytest.raises(UserError, match=r"damaged|do not fit"):
        load_policy(run)


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


def test_missing_weights_are_refused_naming_those_there_are(run):
    with pytest.raises(UserError, match="best, final"):
        run.load_weights("finale")


@pytest.mark.parametrize("name", ["../../outside", "a/b", ""])
def test_weights_outside_the_run_are_not_read(run, name):
    run.save_weights("outside", {"a": torch.zeros(1)})
    with pytest.raises(UserError):
        run.load_weights(name)


def test_a_missing_or_foreign_folder_is_refused(tmp_path):
    with pytest.raises(UserError, match="no run"):
        RunFolder.open(tmp_path / "nothing")
    with pytest.raises(UserError, match=r"config\.yaml"):
        RunFolder.open(tmp_path)


def test_a_folder_that_cannot_be_made_is_a_clear_error(tmp_path, small):
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="--out"):
        RunFolder.create(tmp_path / "file", small)
