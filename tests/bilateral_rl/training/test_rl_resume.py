"""A training that is stopped or killed, at any moment and again and again, ends as one that never was."""

import random
import signal
import time

import pytest
from processes import is_saving, started, wait_until
from rl_runs import ALGORITHMS, curves, differences, evaluations, small_rl
from supervised_runs import Watch, with_values

from bilateral_rl.envs.experiments.experiment import Experiment
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.training.run import resume, train

EXPERIMENT = Experiment(
    name="pushed_and_pulled",
    start={"hand": [0.0, 0.4]},
    target={"center_out": {"number": 4}},
    timeline={"go": [2, 5], "no_go_share": 0.2, "jump": {"at": [3, 6], "offset": [[0.05, 0.0]], "share": 0.5}},
    forces={
        "curl": 10,
        "elastic_field": {"stiffness": 20, "center": "start"},
        "pulse": {"force": {"size": 3, "directions": 4}, "at": 2, "steps": 3, "share": 0.5},
        "channel": {"share": 0.2},
        "field_off_share": 0.2,
    },
)
"""Everything that an experiment may have."""


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_a_training_that_is_stopped_ends_with_the_bits_of_one_in_one_go(tmp_path, whole_run, algo):
    config = small_rl(algo)
    outcome = train(config, tmp_path, Watch(stop_at=300))
    for stop_at in (700, float("inf")):
        assert outcome.stopped_by == signal.SIGINT
        assert 0 < outcome.done < config.timesteps
        assert outcome.folder.status()["state"] == "interrupted"
        progress = Watch(stop_at)
        outcome = resume(RunFolder(outcome.folder.path), config, progress)
        assert progress.started[0] < progress.steps[0]
    assert outcome.stopped_by is None
    assert differences(outcome.folder, whole_run(algo)) == []
    assert outcome.folder.status() == whole_run(algo).status()


@pytest.mark.parametrize("algo", ["ppo", "sac", "td3"])
def test_an_experiment_with_cues_forces_and_senses_of_its_own_is_learned_and_goes_on_to_the_same_bits(tmp_path, algo):
    senses = {"vision_noise": 0.01, "velocity_noise": 0.1, "vision_delay": 4, "proprioception_delay": 2}
    losses = {"losses": {"dominant": {"hand_speed": 0.5}, "non_dominant": {"penalty": 1.0}, "last_steps": 15}}
    config = small_rl(algo, EXPERIMENT, timesteps=800, trial=senses | losses, network={"hidden_noise": 0.05})
    whole = train(config, tmp_path / "whole")
    stopped = train(config, tmp_path, Watch(stop_at=400))
    assert stopped.stopped_by == signal.SIGINT
    resume(RunFolder(stopped.folder.path), config)
    assert differences(stopped.folder, whole.folder) == []
    on_the_way = sorted(name for name in whole.folder.weight_names() if name.startswith("step"))
    early, late = (whole.folder.load_weights(name) for name in (on_the_way[-1], "final"))
    assert all((early[name] != late[name]).any() for name in early if "dominant.0.weight" in name)


@pytest.mark.parametrize("algo", ["ppo", "sac"])
def test_a_training_that_is_killed_ends_with_the_bits_of_one_in_one_go(tmp_path, whole_run, algo):
    path, output = tmp_path / "random_reach" / f"cc_s-{algo}-1", tmp_path / "output"
    generator = random.Random(0)
    command = ["train", "--config", whole_run(algo).path / "config.yaml", "--out", tmp_path]
    saved = []
    for steps, during_a_save in ((300, False), (700, True)):
        with started(*command, output=output) as process:
            wait_until(lambda steps=steps: _steps(path) >= steps, process, output)
            if during_a_save:
                wait_until(lambda: is_saving(path), process, output, pause=0)
            else:
                time.sleep(generator.uniform(0.0, 0.05))
            process.kill()
            process.join()
        assert process.exitcode == -signal.SIGKILL, output.read_text()
        saved.append(_steps(path))
        command = ["train", "--resume", path]
    assert saved == sorted(saved)
    assert saved[-1] < 1_600
    resume(RunFolder(path), RunFolder(path).config())
    assert not [*path.rglob(".*")]  # left behind
    assert differences(RunFolder(path), whole_run(algo)) == []


def _steps(path):
    return RunFolder(path).status().get("timesteps", -1) if path.exists() else -1


def test_what_was_logged_after_the_saved_state_is_logged_once(tmp_path, whole_run):
    config = with_values(whole_run("ppo").config(), evaluation={"checkpoint_every": 10_000})
    watch = Watch(stop_at=700)
    with pytest.raises(KeyboardInterrupt):
        train(config, tmp_path, _LeavesAtOnce(700))
    (path,) = tmp_path.glob("*/*/")
    folder = RunFolder(path)
    assert folder.status()["timesteps"] == 0
    assert len(evaluations(folder)) == 2
    resume(folder, config, watch)
    resume(folder, config)
    steps = [int(row["timesteps"]) for row in evaluations(folder)]
    assert steps == [int(row["timesteps"]) for row in evaluations(whole_run("ppo"))]
    shown, expected = curves(folder), curves(whole_run("ppo"))
    del shown["time/fps"], expected["time/fps"]
    assert shown == expected


def test_a_training_by_the_updates_of_an_earlier_version_is_refused_and_stays(tmp_path):
    config = small_rl("ppo")
    folder = train(config, tmp_path, Watch(stop_at=300)).folder
    state = folder.load_resume()
    del state["counter.update_rules"]  # as version 0.2.0 wrote it
    folder.save_resume(state)
    before = {path: path.read_bytes() for path in folder.path.rglob("*") if path.is_file()}
    with pytest.raises(UserError, match=r"was trained by an earlier version.*--init-from"):
        resume(folder, config)
    assert {path: path.read_bytes() for path in folder.path.rglob("*") if path.is_file()} == before


class _LeavesAtOnce(Watch):
    """Presses Ctrl-C twice."""

    def on_step(self, done):
        asked = self._stop_at
        super().on_step(done)
        if done >= asked:
            signal.raise_signal(signal.SIGINT)


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_evaluations_and_saved_states_change_nothing(tmp_path, whole_run, algo):
    rarely = {"every": 10_000, "checkpoint_every": 10_000}
    quiet = train(small_rl(algo, evaluation=rarely), tmp_path).folder.load_weights("final")
    busy = whole_run(algo).load_weights("final")
    assert all(quiet[name].equal(busy[name]) for name in busy)
