"""Several networks by reinforcement learning: each as if alone, and one run for all commands."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import pandas as pd
import pytest
from processes import TIMEOUT, CopiedSeed, started, wait_until
from rl_runs import differences, small_rl
from supervised_runs import Watch, with_values

from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder, find_runs
from bilateral_rl.runs.policies import load_policies, network_states
from bilateral_rl.training import side_by_side
from bilateral_rl.training.one_seed import MessageProgress
from bilateral_rl.training.run import resume, train
from bilateral_rl.training.side_by_side import SideBySideLearner

SEEDS = [103, 104]
FIRST, SECOND = SEEDS


@pytest.fixture(scope="module")
def processes():
    """The processes of seeds of trainings of this process, in the order in which they start.

    They begin as copies: to import everything takes longer than these trainings. The command that is killed starts
    them as its users' does.
    """
    begun = []

    def start(*arguments, **options):
        begun.append(CopiedSeed(*arguments, **options))
        return begun[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(side_by_side, "subprocess", SimpleNamespace(Popen=start, PIPE=subprocess.PIPE))
        yield begun


@pytest.fixture(scope="module")
def config(processes):
    return small_rl("ppo", seed=FIRST, seeds=2)


@pytest.fixture(scope="module")
def watched(config, tmp_path_factory):
    """The outcome of the training in one go, and what was told of it."""
    watch = Watch()
    return train(config, tmp_path_factory.mktemp("side_by_side"), watch), watch


@pytest.fixture(scope="module")
def alone(config, tmp_path_factory):
    """The run of each seed alone."""
    out = tmp_path_factory.mktemp("alone")
    return {seed: train(with_values(config, seed=seed, seeds=1), out).folder for seed in SEEDS}


def child(folder, seed):
    return RunFolder(folder.path / f"seed_{seed}")


def test_every_seed_ends_as_if_it_had_trained_alone(watched, alone, same_bits):
    outcome, _ = watched
    for seed in SEEDS:
        assert differences(child(outcome.folder, seed), alone[seed]) == []
    policies = load_policies(outcome.folder)
    for weights in ("final", "best"):
        states = network_states(outcome.folder, weights)
        for seed in SEEDS:
            assert same_bits(states[seed], network_states(alone[seed], weights)[seed])
    assert same_bits(dict(policies[SECOND].state_dict()), alone[SECOND].load_weights("final"))
    assert not same_bits(states[FIRST], states[SECOND])


def test_the_run_says_how_far_every_seed_came_and_what_it_measured(watched, config, alone):
    outcome, watch = watched
    assert outcome.folder.status() == {
        "state": "finished",
        "timesteps": 1_600,
        "weights": "final",
        "seeds": [{"seed": seed, "state": "finished", "timesteps": 1_600} for seed in SEEDS],
    }
    assert (outcome.done, outcome.stopped_by, list(outcome.policies)) == (3_200, None, SEEDS)
    assert watch.steps[-1] == outcome.done == config.total
    assert sorted({measures["seed"] for _, measures in watch.evaluations}) == SEEDS
    table = pd.read_csv(outcome.folder.path / "evaluations.csv")
    for seed in SEEDS:
        expected = pd.read_csv(alone[seed].path / "evaluations.csv")
        pd.testing.assert_frame_equal(
            table[table["seed"] == seed].drop(columns="seed").reset_index(drop=True), expected
        )
    assert [run.path for run in find_runs(outcome.folder.path.parent.parent)] == [outcome.folder.path]


def test_more_timesteps_that_are_stopped_in_between_bring_what_they_bring_each_seed_alone(
    watched, alone, config, tmp_path
):
    folder = RunFolder(shutil.copytree(watched[0].folder.path, tmp_path / "run"))
    with pytest.raises(UserError, match=r"1,600 steps of every seed.*--timesteps"):
        resume(folder, config)
    longer = with_values(config, timesteps=3_200)
    outcome = resume(folder, longer, Watch(stop_at=3_201))
    assert outcome.stopped_by == signal.SIGINT
    assert 3_200 < outcome.done < 6_400
    assert folder.status()["state"] == "interrupted"
    outcome = resume(folder, longer)
    assert outcome.stopped_by is None
    assert [(entry["state"], entry["timesteps"]) for entry in folder.status()["seeds"]] == [("finished", 3_200)] * 2
    for seed in SEEDS:
        expected = RunFolder(shutil.copytree(alone[seed].path, tmp_path / f"{seed}"))
        resume(expected, with_values(expected.config(), timesteps=3_200))
        assert differences(child(folder, seed), expected) == []


def test_no_process_outlives_a_killed_training_and_it_goes_on(watched, tmp_path, call):
    path, output = tmp_path / "random_reach" / "cc_s-ppo-1", tmp_path / "output"
    source = watched[0].folder.path / "config.yaml"
    with started("train", "--config", source, "--out", tmp_path, output=output) as process:
        wait_until((path / f"seed_{FIRST}" / "resume.safetensors").exists, process, output)
        os.kill(process.pid, signal.SIGKILL)
        process.join(TIMEOUT)
    folder = RunFolder(path)
    deadline = time.monotonic() + TIMEOUT
    while any((path / f"seed_{seed}" / ".lock").exists() for seed in SEEDS):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    text = output.read_text()
    assert "1,600 steps over 8 arms, seeds 103 to 104 side by side" in " ".join(text.split())
    code, text, errors = call("train", "--resume", path)
    assert code == 0, errors
    assert re.search(r"steps of all seeds, seed 10[34]: goal", text)  # one of the two may have ended before the other
    assert "mean ± standard deviation over 2 seeds" in " ".join(text.split())
    for seed in SEEDS:
        assert differences(child(folder, seed), child(watched[0].folder, seed)) == []
    assert folder.status() == watched[0].folder.status()


class Assassin(Watch):
    """Kills the process of the first seed as soon as that has learned something, and reads the run at times."""

    def __init__(self, processes, out):
        super().__init__()
        self._processes, self._first, self._out = processes, len(processes), out
        self.statuses = []

    def on_step(self, done):
        super().on_step(done)
        if done:
            self._processes[self._first].kill()

    def on_evaluation(self, done, measures):
        super().on_evaluation(done, measures)
        self.statuses += [folder.status() for folder in find_runs(self._out)]


def test_a_training_is_not_finished_if_the_process_of_a_seed_ends_early(config, tmp_path, processes):
    longer = with_values(config, timesteps=8_000, evaluation={"every": 2_000, "checkpoint_every": 2_000})
    watch = Assassin(processes, tmp_path)
    with pytest.raises(UserError, match=r"seed 103 ended early, with exit code .*train --resume \S*cc_s-ppo-1"):
        train(longer, tmp_path, watch)
    (folder,) = find_runs(tmp_path)
    status = folder.status()
    assert (status["state"], status["seeds"][1]["state"]) == ("interrupted", "finished")
    assert any(status["state"] == "running" and status["timesteps"] for status in watch.statuses)  # for `list`
    resume(folder, longer)
    assert [entry["timesteps"] for entry in folder.status()["seeds"]] == [8_000, 8_000]


def test_the_process_of_a_seed_stops_where_interrupts_were_ignored_when_it_began(config, tmp_path):
    """A shell starts what it puts into the background that way, and the end of the training would be missed."""
    folder = RunFolder(tmp_path)
    folder.begin(with_values(config, seeds=1, timesteps=10**9))
    process = subprocess.Popen(
        [sys.executable, "-m", "bilateral_rl.training.one_seed", tmp_path],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN),
    )
    try:
        assert process.wait(TIMEOUT) in (0, 130)
    finally:
        process.kill()
        process.wait()


def test_a_message_that_nobody_reads_any_more_stops_nothing():
    """A seed whose run was killed would otherwise lose what it has not saved yet."""
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "wb", buffering=0) as output:
        MessageProgress(output).on_evaluation(1, {})


def test_a_training_that_diverges_in_every_seed_is_one_error_that_names_them(config, tmp_path):
    with pytest.raises(UserError, match=r"Seed 103 failed: .*diverged.*Seed 104 failed: .*learning_rate"):
        train(with_values(config, ppo={"learning_rate": 1e30, "max_grad_norm": 1e30}), tmp_path)
    (folder,) = find_runs(tmp_path)
    assert folder.status()["state"] == "failed"


def test_all_commands_take_such_a_run_and_each_of_its_seeds(watched, alone, tmp_path, call):
    run = watched[0].folder.path
    for number, named in enumerate((f"{run}:{SECOND}", alone[SECOND].path)):
        assert call("evaluate", named, "--trials", 8, "--csv", f"{number}.csv")[0] == 0
    assert (tmp_path / "0.csv").read_text() == (tmp_path / "1.csv").read_text()
    for arguments, words in (
        (("evaluate", run, "--trials", 8), "over 2 seeds"),
        (("evaluate", f"{run}:{SECOND}", "--trials", 8, "--weights", "best"), "goal completion"),
        (("lesion", run, "--trials", 8, "--lesion", "callosum", "--no-retrain", "--out", "lesions"), "callosum"),
        (("compare", f"{run}:{FIRST}", f"{run}:{SECOND}", "--trials", 8), None),
        (("render", f"{run}:{SECOND}", "--trials", 1, "--out", "video.gif"), None),
        (("list", "--out", run.parent.parent), "of 2 seeds"),
    ):
        code, out, err = call(*arguments)
        if words is None:
            assert "Traceback" not in err
        else:
            assert (code, err) == (0, "")
            assert words in " ".join(out.split())
    begun = [
        "train",
        "--algo",
        "bptt",
        "--seeds",
        "103..104",
        "--epochs",
        "1",
        "--init-from",
        run,
        "--out",
        tmp_path / "new",
    ]
    few = ["bptt.trials=32", "bptt.batch_size=16", "bptt.validation_trials=8", "trial.trial_length=20"]
    code, _, err = call(*begun, *(word for item in few for word in ("--set", item)))
    assert (code, err) == (0, "")


@pytest.mark.parametrize(("at_once", "expected"), [(1, [1, 1]), (2, [1, 2])])
def test_as_many_seeds_train_at_a_time_as_is_asked_for(config, tmp_path, monkeypatch, at_once, expected):
    learner = SideBySideLearner(config, RunFolder(tmp_path), at_once)
    learner.open(RunFolder(tmp_path))
    alive, most = set(), []

    class Process:
        """Ends at once; its end is known when its exit code is asked for."""

        def __init__(self, seed, folder, events):
            self._seed = seed
            alive.add(seed)
            most.append(len(alive))
            events.put((seed, {"done": 1_600, "notes": []}))
            events.put((seed, None))

        @property
        def code(self):
            alive.discard(self._seed)
            return 0

        def kill(self):
            pass

    class Everything:
        def step(self, done):
            return True

        def between(self):
            return True

    monkeypatch.setattr(side_by_side, "_SeedProcess", Process)
    learner.learn(Everything())
    assert most == expected
