import json
import os
import subprocess
import sys
import types

import pytest
import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from bilateral_rl.config.parse import merge
from bilateral_rl.config.resolve import resolve
from bilateral_rl.io.errors import UserError
from bilateral_rl.training.run import resume, train
from bilateral_rl.training.tracking import TRACKING, Tracking


def with_values(config, **values):
    return resolve(None, None, [merge(config.to_values(), values)])


# --- without the package --------------------------------------------------------------------------------------------


@pytest.fixture(params=["missing", "a folder that it left behind"])
def _no_wandb(request, monkeypatch):
    for name in [name for name in sys.modules if name.partition(".")[0] == "wandb"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "wandb", None if request.param == "missing" else types.ModuleType("wandb"))


@pytest.mark.usefixtures("_no_wandb")
def test_without_weights_and_biases_nothing_is_begun_and_the_error_says_how_to_get_it(small, tmp_path):
    with pytest.raises(UserError, match=r'pip install -c constraints.txt -e "\.\[track\]"'):
        train(with_values(small, track=True), tmp_path)
    assert not any(tmp_path.iterdir())


@pytest.mark.usefixtures("_no_wandb")
def test_the_command_says_it_before_it_announces_anything(call, tmp_path):
    code, out, err = call("train", "--track", "--timesteps", "100", "--n-envs", "2")
    assert (code, out) == (2, "")
    assert "--track needs Weights & Biases" in " ".join(err.split())
    assert not (tmp_path / "runs").exists()


@pytest.mark.usefixtures("_no_wandb")
def test_a_tracked_run_is_resumed_without_unless_it_is_asked_for_again(call, run):
    run.write_config(with_values(run.config(), track=True))
    code, _, err = call("train", "--resume", run.path, "--timesteps", "5000", "--track")
    assert code == 2, err
    code, _, err = call("train", "--resume", run.path, "--timesteps", "5000")
    assert code == 0, err
    assert not run.config().track


def test_supervised_training_cannot_be_tracked(call):
    code, _, err = call("train", "--algo", "bptt", "--track")
    assert code == 2
    assert "track is a setting of another algorithm than bptt" in " ".join(err.split())


# --- with it, offline -----------------------------------------------------------------------------------------------


@pytest.fixture
def wandb(monkeypatch, tmp_path):
    """The real package, which here reaches nobody, and its runs, with what they had when they were finished."""
    monkeypatch.setenv("WANDB_MODE", "offline")
    monkeypatch.setenv("WANDB_DIR", str(tmp_path))
    monkeypatch.delenv("WANDB_PROJECT", raising=False)
    package = pytest.importorskip("wandb", exc_type=ImportError)
    finished, finish = [], package.Run.finish

    def remember(run, *arguments, **options):
        run.log({}, step=run.step, commit=True)  # as finishing does
        summary = json.loads(json.dumps(dict(run.summary), default=dict))
        finished.append(types.SimpleNamespace(
            id=run.id, name=run.name, project=run.project, config=run.config.as_dict(), summary=summary
        ))  # fmt: skip
        finish(run, *arguments, **options)

    monkeypatch.setattr(package.Run, "finish", remember)
    package.finished = finished
    return package


def scalars(folder):
    """The last value of each number in tensorboard."""
    events = EventAccumulator(str(folder.path), size_guidance={"scalars": 0})
    events.Reload()
    return {tag: events.Scalars(tag)[-1] for tag in events.Tags()["scalars"]}


def test_every_number_and_figure_of_tensorboard_reaches_it(wandb, small, tmp_path):
    config = with_values(small, track=True, evaluation={"lesion_probe_every": 2_000})
    folder = train(config, tmp_path / "runs").folder
    (tracked,) = wandb.finished
    numbers = {tag: event.value for tag, event in scalars(folder).items()}
    got = {name: float(tracked.summary[name]) for name in numbers}
    assert got == pytest.approx(numbers, rel=1e-6, nan_ok=True)
    assert {"return/dominant", "value_loss/non_dominant", "evaluation/final_error_cm"} < got.keys()
    assert "lesions_final_error_cm/callosum" in got
    assert tracked.summary["_step"] == 4_000
    for figure in ("hand_paths", "specialization_over_training"):
        assert tracked.summary[f"figures/{figure}"]["width"] > 100
    assert (tracked.name, tracked.project) == (folder.path.name, "bilateral-rl")
    assert tracked.config == config.to_values()
    assert folder.read_json(TRACKING) == {"id": tracked.id}


def test_tracking_leaves_the_training_as_it_is_and_the_run_folder_without_its_files(wandb, small, run, tmp_path):
    folder = train(with_values(small, track=True), tmp_path / "tracked").folder
    expected, weights = run.load_weights("final"), folder.load_weights("final")
    assert all(torch.equal(expected[name], weights[name]) for name in expected)
    assert {path.name for path in folder.path.iterdir()} - {path.name for path in run.path.iterdir()} >= {TRACKING}
    assert not (folder.path / "wandb").exists()


def test_a_resumed_training_goes_on_with_the_same_run(wandb, run):
    config = with_values(run.config(), timesteps=5_000, track=True)
    resume(run, config)
    resume(run, with_values(config, timesteps=6_000))
    first, second = wandb.finished
    assert first.id == second.id
    assert second.summary["_step"] == 6_000


def test_the_project_can_be_named(wandb, run, monkeypatch):
    monkeypatch.setenv("WANDB_PROJECT", "hemispheres")
    Tracking(run, run.config()).close()
    assert wandb.finished[0].project == "hemispheres"


def test_steps_that_it_has_seen_are_not_repeated(wandb, run, capfd):
    tracking = Tracking(run, run.config())
    for step, value in ((10, 1.0), (20, 2.0), (15, 3.0)):
        tracking.write({"x": value, "hidden": 1.0, "words": "no"}, {"x": ("",), "hidden": ("tensorboard",)}, step)
    tracking.close()
    (tracked,) = wandb.finished
    assert (tracked.summary["x"], tracked.summary["_step"]) == (2.0, 20)
    assert not {"hidden", "words"} & tracked.summary.keys()
    assert "Steps must be monotonically increasing" not in capfd.readouterr().err


def test_an_id_that_cannot_be_is_refused(wandb, run):
    for known in ('"abc"', '{"id": 3}', '{"id": "../../etc"}', '{"id": ""}', "{"):
        (run.path / TRACKING).write_text(known)
        with pytest.raises(UserError, match=f"{TRACKING} is damaged"):
            Tracking(run, run.config())


def test_a_failure_while_it_logs_is_told_once_and_ends_nothing(wandb, small, tmp_path, monkeypatch):
    def fail(*_arguments, **_options):
        raise ConnectionResetError("Connection lost")

    monkeypatch.setattr(wandb.Run, "log", fail)
    outcome = train(with_values(small, track=True), tmp_path / "runs")
    assert outcome.folder.status()["state"] == "finished"
    assert outcome.notes == ["Weights & Biases failed, and the training went on without it: Connection lost"]


def run_alone(script, **environment):
    """Run ``script`` in a process of its own: settings are read once a process."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("WANDB_")}
    done = subprocess.run(
        [sys.executable, "-c", script], env=inherited | environment, stdin=subprocess.DEVNULL,
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


TRACK_TWO_STEPS = """
import os, signal, time
from pathlib import Path
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.training.tracking import Tracking, check_tracking
folder = RunFolder(Path(os.environ["RUN"]))
check_tracking()
tracking = Tracking(folder, folder.config())
tracking.write({"x": 1.0}, {"x": ("",)}, 10)
"""


def test_its_process_may_be_killed(run, tmp_path):
    pytest.importorskip("wandb", exc_type=ImportError)
    kill = """
children = Path(f"/proc/{os.getpid()}/task").glob("*/children")
for child in {int(pid) for children in children for pid in children.read_text().split()}:
    os.kill(child, signal.SIGKILL)
time.sleep(0.3)
tracking.write({"x": 2.0}, {"x": ("",)}, 20)
tracking.close()
print(tracking.notes)
"""
    notes = run_alone(TRACK_TWO_STEPS + kill, RUN=str(run.path), WANDB_MODE="offline", WANDB_DIR=str(tmp_path))
    assert "failed, and the training went on without it" in notes


@pytest.mark.slow
def test_without_a_network_it_is_kept_for_later(run, tmp_path):
    pytest.importorskip("wandb", exc_type=ImportError)
    environment = {"WANDB_BASE_URL": "http://127.0.0.1:9", "WANDB_API_KEY": 40 * "a", "WANDB_INIT_TIMEOUT": "2"}
    script = TRACK_TWO_STEPS + "tracking.close()\nprint(tracking.notes)"
    notes = run_alone(script, RUN=str(run.path), WANDB_DIR=str(tmp_path), **environment)
    assert "was not reached" in notes
    assert "wandb sync" in notes
    assert list(tmp_path.glob("wandb/offline-run-*/run-*.wandb"))


def test_it_must_know_who_one_is(tmp_path):
    pytest.importorskip("wandb", exc_type=ImportError)
    script = """
from bilateral_rl.io.errors import UserError
from bilateral_rl.training.tracking import check_tracking
try:
    check_tracking()
except UserError as error:
    print(error)
"""
    assert "wandb login" in run_alone(script, HOME=str(tmp_path), WANDB_DIR=str(tmp_path))
