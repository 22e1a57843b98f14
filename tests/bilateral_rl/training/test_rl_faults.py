"""What can go wrong around a training: nothing is lost, nothing half-written, and one sentence says what to do."""

import contextlib
import io
import os
import shutil
import signal
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest
from processes import TIMEOUT, finished, in_process, started, wait_until
from rich.console import Console
from rl_runs import curves, differences, small_rl
from small_disk import NOT_ALLOWED, train_on
from stable_baselines3.common.monitor import load_results
from supervised_runs import Watch, contents, with_values

from bilateral_rl.commands.evaluate import evaluate
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.training.run import resume, train


def is_one_sentence_with(output, *words):
    (error,) = [line for line in output.splitlines() if line.startswith("Error:")]
    return all(word in error for word in words) and "Traceback" not in output and "Exception" not in output


@pytest.mark.parametrize(("algo", "share"), [("ppo", 1.1), ("sac", 0.7)])
def test_a_file_that_cannot_grow_stops_the_training_and_keeps_what_was_saved(tmp_path, whole_run, algo, share):
    """Of PPO that is tensorboard's file, which a thread writes; of SAC the state with its replay buffer."""
    largest = int(share * (whole_run(algo).path / "resume.safetensors").stat().st_size)
    command = ["train", "--config", whole_run(algo).path / "config.yaml", "--out", tmp_path]
    code, text = finished(*command, output=tmp_path / "output", largest_file=largest)
    folder = RunFolder(tmp_path / "random_reach" / f"cc_s-{algo}-1")
    saved = folder.status()["timesteps"]
    assert code == 2, text
    assert is_one_sentence_with(text, str(folder.path), "File too large", f"after {saved:,} steps", "--resume"), text
    assert 0 < saved < 1_600
    assert not [*folder.path.rglob(".*")]
    resume(folder, folder.config())
    assert differences(folder, whole_run(algo)) == []


def test_a_full_disk_stops_the_training_and_it_goes_on_once_there_is_room(tmp_path, whole_run):
    disk, output = tmp_path / "disk", tmp_path / "output"
    disk.mkdir()
    config = shutil.copy(whole_run("sac").path / "config.yaml", tmp_path)
    with in_process(train_on, disk, 450_000, config, tmp_path / "saved", output=output) as process:
        process.join(TIMEOUT)
    if process.exitcode == NOT_ALLOWED:
        pytest.skip("no process may have a disk of its own here")
    text = output.read_text()
    assert process.exitcode == 0, text
    assert is_one_sentence_with(text, "No space left on device", "is saved", "--resume"), text
    assert differences(RunFolder(tmp_path / "saved"), whole_run("sac")) == []


@contextlib.contextmanager
def read_only(folder):
    """A copy of ``folder`` in which nobody may write; root takes the place of nobody to feel it."""
    with tempfile.TemporaryDirectory() as outside:
        copy = Path(outside) / "run"
        shutil.copytree(folder, copy)
        for path in (Path(outside), *copy.rglob("*"), copy):
            path.chmod(0o555 if path.is_dir() else 0o444)
        was_root = os.geteuid() == 0
        if was_root:
            os.seteuid(65534)
        try:
            yield copy
        finally:
            if was_root:
                os.seteuid(0)
            for path in (Path(outside), copy, *copy.rglob("*")):
                path.chmod(0o755)


def test_a_read_only_folder_is_refused_and_stays_as_it_was(run):
    config = with_values(run.config(), timesteps=8_000)
    before = contents(run)
    with read_only(run.path) as path:
        with pytest.raises(UserError, match=r"Cannot write .*Permission denied"):
            resume(RunFolder(path), config)
        with pytest.raises(UserError, match=r"Cannot write a run under .*Permission denied.*--out"):
            train(config, path)
        assert {path.relative_to(run.path): content for path, content in _by_path(before).items()} == {
            file.relative_to(path): content for file, content in _by_path(contents(RunFolder(path))).items()
        }


def _by_path(by_name):
    return {Path(name): content for name, content in by_name.items()}


def test_a_second_training_in_a_folder_is_refused_and_sigterm_saves_the_first(tmp_path, whole_run):
    config, output = whole_run("ppo").path / "config.yaml", tmp_path / "output"
    path = tmp_path / "random_reach" / "cc_s-ppo-1"
    folder = RunFolder(path)
    with started("train", "--config", config, "--out", tmp_path, output=output) as process:
        wait_until((path / "resume.safetensors").exists, process, output)
        os.kill(process.pid, signal.SIGSTOP)
        before = contents(folder)
        with pytest.raises(UserError, match="Another training"):
            resume(folder, folder.config())
        assert contents(folder) == before
        os.kill(process.pid, signal.SIGTERM)
        os.kill(process.pid, signal.SIGCONT)
        process.join(TIMEOUT)
    text = output.read_text()
    assert process.exitcode == 128 + signal.SIGTERM, text
    assert "--resume" in text
    assert folder.status()["state"] == "interrupted"
    resume(folder, folder.config())
    assert differences(folder, whole_run("ppo")) == []


def test_sigterm_stops_a_supervised_training_too(tmp_path, small_bptt):
    class Terminates(Watch):
        def on_step(self, done):
            if done == 3:
                signal.raise_signal(signal.SIGTERM)

    outcome = train(small_bptt(), tmp_path, Terminates())
    assert outcome.stopped_by == signal.SIGTERM
    assert outcome.folder.status()["state"] == "interrupted"


def test_a_killed_evaluation_leaves_the_old_table_or_the_new_one(tmp_path, run):
    table, output = tmp_path / "table.csv", tmp_path / "output"
    arguments = {"run": str(run.path), "trials": 2_000, "seed": 5, "deterministic": True, "weights": "final"}
    arguments |= {"lesion": "intact", "task": None, "overrides": [], "by": None}
    arguments |= {"csv": table, "json_file": None, "console": Console(file=io.StringIO())}
    evaluate(**arguments)
    new = table.read_bytes()
    table.write_text("old")
    names = {table.name, output.name, "runs"}
    with started("evaluate", run.path, "--trials", 2_000, "--seed", 5, "--csv", table, output=output) as process:
        wait_until(lambda: _names(tmp_path) - names or not process.is_alive(), process, output, pause=0)
    assert table.read_bytes() in (b"old", new)
    evaluate(**arguments)
    assert table.read_bytes() == new
    assert all(name.endswith(".tmp") for name in _names(tmp_path) - names)  # nothing reads what the killed one left


def _names(folder):
    return {path.name for path in folder.iterdir()}


class _Clock:
    """The clock on the wall, which somebody sets."""

    def __init__(self, monkeypatch):
        self._time, self._time_ns, self.offset = time.time, time.time_ns, 0
        monkeypatch.setattr(time, "time", lambda: self._time() + self.offset)
        monkeypatch.setattr(time, "time_ns", lambda: self._time_ns() + self.offset * 10**9)


def test_a_clock_that_goes_back_changes_nothing(tmp_path, whole_run, monkeypatch):
    clock = _Clock(monkeypatch)

    class SetsBack(Watch):
        def on_step(self, done):
            super().on_step(done)
            clock.offset = -3_600 * (1 + (done >= 600))

    outcome = train(small_rl("ppo"), tmp_path, Watch(stop_at=300))
    outcome = resume(outcome.folder, small_rl("ppo"), SetsBack())
    assert outcome.seconds > 0
    assert differences(outcome.folder, whole_run("ppo")) == []
    times = load_results(str(outcome.folder.path))["t"].to_numpy()
    assert times[0] >= 0
    assert (np.diff(times) >= 0).all()
    assert times[-1] < 600
    speeds = [value for _, value in curves(outcome.folder)["time/fps"]]
    assert all(0 < speed < 1e6 for speed in speeds)


def test_a_run_of_several_seeds_or_one_that_cannot_go_on_is_refused_before_it_is_announced(call, run):
    shutil.copytree(run.path, "run")
    for arguments, words in ((["run:0"], "without :0"), (["run"], "larger --timesteps")):
        code, out, err = call("train", "--resume", *arguments)
        assert code == 2
        assert out == ""
        assert is_one_sentence_with(err, words)
