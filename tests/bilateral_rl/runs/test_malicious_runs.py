"""Somebody else's run, made to do harm: every command refuses it in one sentence, changes nothing, executes nothing.

Which traps there are, and that no loader falls for any: test_fuzz_loaders.py.
"""

import contextlib
import dataclasses
import os
import shutil
import subprocess
import tempfile
from functools import partial

import hostile_files as hostile
import pytest
import yaml
from loader_fuzzing import in_time, listing

from bilateral_rl.commands import app as cli
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.tensors import save
from bilateral_rl.io.terminal import Terminal
from bilateral_rl.io.yaml_files import read_settings
from bilateral_rl.runs.policies import load_policies
from bilateral_rl.study.folder import claimed_folder
from bilateral_rl.training import run as training


@pytest.fixture(autouse=True)
def _in_time():
    with in_time():
        yield


@pytest.fixture
def canary(tmp_path):
    """A file that is there if anything was executed."""
    return tmp_path / "canary"


@pytest.fixture
def outside(tmp_path):
    """A file that is no part of any run."""
    path = tmp_path / "home" / ".bashrc"
    path.parent.mkdir()
    path.write_text("mine\n")
    return path


@pytest.fixture
def run(run):
    """A run, and a sound one beside it."""
    shutil.copytree(run.path, run.path.with_name("sound"))
    return run


@pytest.fixture
def unharmed(tmp_path, monkeypatch, canary):
    """A context that must change no file and execute nothing."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))

    @contextlib.contextmanager
    def check():
        before = listing(tmp_path)
        yield
        assert listing(tmp_path) == before
        assert not canary.exists()

    return check


@pytest.fixture
def not_read(unharmed):
    """Calls a function that must refuse what it should read or continue."""

    def check(function, says):
        with unharmed(), pytest.raises(UserError) as error:
            function()
        assert says in str(error.value)

    return check


@pytest.fixture
def refused(call, unharmed, monkeypatch):
    """Calls commands that must each refuse: exit code 2, and one line that holds ``says``."""
    monkeypatch.setattr(cli, "console", Terminal(width=80))

    def check(*commands, says=""):
        for arguments in commands:
            with unharmed():
                code, out, err = call(*arguments)
            assert code == 2, (arguments, out, err)
            assert err.startswith("Error: "), err
            assert err.count("\n") == 1
            assert says in err
            assert "\x1b" not in out + err

    return check


def readers(run):
    """Commands that read a run's configuration and weights."""
    yield "evaluate", run, "--trials", 4
    yield "lesion", run, "--trials", 4, "--no-retrain"
    yield "compare", run, run.with_name("sound"), "--trials", 4
    yield "render", run, "--trials", 1
    yield "train", "--init-from", run, "--timesteps", 100


def resuming(run):
    yield "train", "--resume", run, "--timesteps", 100_000


# Configurations and weights


@pytest.mark.parametrize("trap", ["a tag that calls", "a pipe"])
def test_no_command_takes_a_configuration_that_is_a_trap(run, refused, canary, outside, trap):
    shutil.copyfile(run.path / "config.yaml", outside)
    hostile.put(run.path / "config.yaml", (hostile.yaml_traps(canary) | hostile.places(outside))[trap])
    refused(*readers(run.path), *resuming(run.path), says="config.yaml")


@pytest.mark.parametrize("trap", ["a pickle", "nan", "a link out"])
def test_no_command_takes_weights_that_are_a_trap(run, refused, canary, outside, trap):
    path = run.path / "weights/final.safetensors"
    traps = hostile.pickles(canary) | hostile.tensor_traps(path.read_bytes()) | hostile.places(outside)
    shutil.copyfile(path, outside)
    hostile.put(path, traps[trap])
    refused(*readers(run.path), says="final" if trap == "nan" else "final.safetensors")


def test_a_configuration_that_is_given_may_be_a_pipe_but_no_trap(run, refused, tmp_path):
    endless, pipe = tmp_path / "zero", tmp_path / "pipe"
    endless.symlink_to("/dev/zero")
    refused(("train", "--config", endless), says="larger")
    os.mkfifo(pipe)
    text = (run.path / "config.yaml").read_text()
    with subprocess.Popen(["sh", "-c", f"cat {run.path / 'config.yaml'} > {pipe}"]):
        assert yaml.safe_dump(read_settings(pipe), sort_keys=False) == text


def test_pickles_beside_weights_are_not_even_seen(run, not_read, canary):
    (run.path / "weights/final.safetensors").unlink()
    for suffix, content in zip((".pkl", ".pth"), hostile.pickles(canary).values(), strict=True):
        (run.path / f"weights/final{suffix}").write_bytes(content)
    not_read(lambda: load_policies(run), says="the run's weights are: best")


def test_a_folder_of_weights_that_is_none(run, not_read, outside):
    outside.unlink()
    shutil.copytree(run.path / "weights", outside)
    for place in hostile.places(outside).values():
        hostile.put(run.path / "weights", place)
        not_read(lambda: load_policies(run), says="weights")


def test_names_of_weights_do_not_climb_out(run, not_read):
    sound = run.load_weights("final")
    for path in (run.path.parent / "x.safetensors", run.path / "final.safetensors", run.path / "weights/.safetensors"):
        save(sound, path)
    for name in ("../../x", "/etc/passwd", "../final", "", "..", "\0", "\x1b[31m[red]"):
        not_read(partial(load_policies, run, name), says="the run's weights are:")


def test_weights_that_overflow_are_not_tested(run, refused):
    """Finite numbers of which the network makes others."""
    weights = run.load_weights("final")
    exploring = weights["log_std"].clone()
    weights["log_std"].fill_(-3e38)
    run.save_weights("final", weights)
    refused(("evaluate", run.path, "--trials", 2, "--no-deterministic"), says="cannot be tested")
    for name, tensor in weights.items():
        if "combination" in name or "output" in name:
            tensor.fill_(3e38)
            tensor.view(-1)[::2] *= -1
    run.save_weights("final", weights | {"log_std": exploring})
    refused(*list(readers(run.path))[:4], says="cannot be tested")


def test_a_run_that_is_linked_to_or_links_within_itself_is_read(call, run, tmp_path):
    final = run.path / "weights/final.safetensors"
    final.rename(run.path / "weights/best.safetensors")
    final.symlink_to("best.safetensors")
    (tmp_path / "link").symlink_to(run.path)
    os.link(run.path / "config.yaml", tmp_path / "hard")
    code, out, err = call("evaluate", tmp_path / "link", "--trials", 2)
    assert (code, err) == (0, "")
    assert "goal radius" in out


# Trainings that go on


def test_a_training_does_not_go_on_through_a_link_or_into_a_pipe(run, not_read, outside):
    for name in (
        "status.json",
        "config.yaml",
        "resume.safetensors",
        "evaluations.csv",
        "weights",
        "weights/x",
        ".lock",
        "anything",
    ):
        config = dataclasses.replace(run.config(), timesteps=100_000)
        for kind in ("a link out", "a pipe", "a device"):
            backup = run.path.parent / "backup"
            shutil.copytree(run.path, backup)
            hostile.put(run.path / name, hostile.places(outside)[kind])
            not_read(partial(training.resume, run, config), says=name)
            shutil.rmtree(run.path)
            backup.rename(run.path)


@pytest.mark.parametrize("name", ["epochs.csv", "seed_0", "weights"])
def test_a_supervised_training_does_not_go_on_through_a_link(bptt_run, refused, outside, name):
    hostile.put(bptt_run.path / name, hostile.places(outside if name == "epochs.csv" else outside.parent)["a link out"])
    refused(("train", "--resume", bptt_run.path, "--epochs", 100), says="is a link out of")


# What lies beside a run


@pytest.mark.parametrize("name", [None, "lesions.csv", "lesions_final_error.png", "anything"])
def test_lesions_are_not_written_through_a_link(run, refused, outside, name):
    folder = run.path.with_name(f"{run.path.name}-lesions")
    if name is None:
        (outside.parent / "empty").mkdir()
        folder.symlink_to(outside.parent / "empty")
    else:
        folder.mkdir()
        (folder / "lesions.csv").touch()
        hostile.put(folder / name, hostile.places(outside)["a link out"])
    refused(("lesion", run.path, "--trials", 4, "--no-retrain"), says="is a link")


def test_a_video_is_not_written_through_a_link(run, refused, outside):
    run.path.with_name(f"{run.path.name}.mp4").symlink_to(outside.with_name("autostart"))
    refused(("render", run.path, "--trials", 1), says="choose another --out")


@pytest.mark.parametrize("trap", ["a pickle", "a pipe"])
def test_settings_of_lesions_that_are_a_trap(run, refused, canary, outside, trap):
    folder = run.path.with_name(f"{run.path.name}-lesions")
    folder.mkdir()
    (folder / "lesions.csv").touch()
    traps = hostile.JSONS | hostile.pickles(canary) | hostile.places(outside)
    hostile.put(folder / "settings.json", traps[trap])
    refused(("lesion", run.path, "--trials", 4, "--no-retrain"))


# Lists of runs


@pytest.mark.parametrize("name", ["config.yaml", "status.json"])
def test_a_list_shows_a_trap_among_runs_as_unreadable(call, run, outside, canary, name):
    bad = run.path.with_name("cc_s-ppo-2")
    shutil.copytree(run.path, bad)
    traps = hostile.pickles(canary) | hostile.places(outside)
    for trap in ("a pickle", "a pipe", "a link out", "a link to itself"):
        hostile.put(bad / name, traps[trap])
        code, out, err = call("list")
        assert (code, err) == (0, "")
        (good,) = (line for line in out.splitlines() if "cc_s-ppo-1" in line)
        assert "finished" in good
        shown = [line for line in out.splitlines() if "cc_s-ppo-2" in line]
        assert "unreadable" in "".join(shown)
    assert not canary.exists()


@pytest.mark.parametrize("name", ["\x1b[31m[red]evil\x1b]0;title\x07", "[bold]x", "\u202eright", "\udce4"])
def test_a_name_does_not_steer_the_terminal(call, run, monkeypatch, name):
    monkeypatch.setattr(cli, "console", Terminal(width=300))
    bad = run.path.with_name(name)
    run.path.rename(bad)
    for arguments in (["list"], ["evaluate", bad, "--trials", 2], ["evaluate", bad / "x"]):
        _, out, err = call(*arguments)
        assert not {"\x1b", "\x07", "\u202e", "\udce4"} & {*(out + err)}
    if "bold" in name:
        assert name in out + err


# Studies


STUDY = {"sweep": {"seed": ["0"]}, "algo": "bptt", "overrides": {}, "trials": 4}


@pytest.fixture
def study(tmp_path):
    """A sweep that was begun."""
    folder = tmp_path / "sweep"
    (folder / "results").mkdir(parents=True)
    (folder / "study.yaml").write_text(yaml.safe_dump(STUDY))
    return folder


@pytest.mark.parametrize("name", ["study.yaml", "sweep.csv", "results", "results/seed=0.csv", "logs", "runs"])
def test_a_study_does_not_go_on_through_a_link_or_into_a_pipe(study, not_read, outside, name):
    def claim():
        with claimed_folder(study, STUDY):
            pass

    for kind in ("a pipe", "a device", "a link out"):
        hostile.put(study / name, hostile.places(outside)[kind])
        not_read(claim, says=name)
