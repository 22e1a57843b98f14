"""Trainings from Python: what they are made of, how they are watched and stopped, and how they go on."""

import io
import os
import signal
import threading
import time

import pytest
import torch
import yaml
from rich.console import Console

import bilateral_rl as brl
from bilateral_rl.io.errors import Stopped, UserError

SHORT = {"timesteps": 800, "n_envs": 8, "progress": False}
SETTINGS = {"ppo.n_steps": 10, "ppo": {"batch_size": 40}, "trial": {"trial_length": 20}, "evaluation.trials": 4}


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def values(run):
    return yaml.safe_load((run.path / "config.yaml").read_text())


def test_arguments_win_over_settings_and_these_over_a_configuration():
    first = brl.train(model="bi_s", units=8, seed=4, settings=SETTINGS, **SHORT)
    assert str(first.path) == "runs/random_reach/bi_s-ppo-1"
    assert (first.status["state"], first.config.network.units, first.seeds) == ("finished", 8, [4])
    again = brl.train(config=first.config, out="elsewhere", progress=False)
    assert values(again) == values(first)
    assert all(
        torch.equal(tensor, again.policy().state_dict()[name]) for name, tensor in first.policy().state_dict().items()
    )
    other = brl.train(config=first.path / "config.yaml", init_from=first, settings={"seed": 5, "ppo.gamma": 0.5},
                      threshold=0.03, progress=False)  # fmt: skip
    expected = values(first) | {"seed": 5, "init_from": first.name}
    expected["ppo"]["gamma"], expected["trial"]["threshold"] = 0.5, 0.03
    assert values(other) == expected


def test_a_run_goes_on_where_it_was():
    run = brl.train(settings=SETTINGS, **SHORT).resume(timesteps=1600, progress=False)
    assert run.status["timesteps"] == run.config.timesteps == 1600
    with pytest.raises(UserError, match="has done its 1,600 steps; give a larger `timesteps` to train it further"):
        run.resume(progress=False)
    with pytest.raises(UserError, match=r"`resume\(\)` takes only `timesteps`, `track`, `device` here, not `epochs`"):
        run.resume(epochs=3)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"model": "cc"}, "Unknown model 'cc'"),
        ({"n_envs": 0}, "n_envs must be at least 1"),
        ({"seeds": 0}, "^`seeds` must be at least 1, got 0"),
        ({"seeds": [3, 5]}, r"^`seeds` takes consecutive seeds, such as range\(100, 130\), not \[3, 5\]"),
        ({"seeds": range(2, 4), "seed": 1}, "^`seeds` 2..3 names the first seed, and so does `seed`: leave"),
        ({"settings": ["ppo.gamma=1"]}, "^`settings` takes settings by name"),
        ({"settings": {"ppo.gama": 1}}, "Unknown setting 'gama' in ppo"),
        ({"config": "none.yaml"}, "Cannot read the configuration none.yaml"),
        (
            {"init_from": "runs/none"},
            r"There is no run runs/none in .*; `bilateral_rl.list_runs\(\)` shows those there are",
        ),
        ({"algo": "bptt", "timesteps": 5}, "leave it out or choose the `algo`"),
        ({"device": "cuda:99"}, "device"),
    ],
)
def test_a_slip_is_a_sentence_and_leaves_nothing(arguments, says, tmp_path):
    with pytest.raises(UserError, match=says):
        brl.train(**arguments)
    assert list(tmp_path.iterdir()) == []


def test_seeds_may_be_a_range_and_notes_are_warnings(monkeypatch):
    run = brl.train("bptt", "bi_s", epochs=1, seeds=range(3, 5), progress=False,
                    settings={"bptt.trials": 32, "bptt.batch_size": 16, "bptt.validation_trials": 4})  # fmt: skip
    assert (run.seeds, brl.load(run, seed=4).seeds) == ([3, 4], [4])
    assert run.status["epochs"] == 1


def test_it_is_watched_where_one_says(capsys):
    console = Console(file=io.StringIO(), width=200)
    brl.train(settings=SETTINGS, **SHORT | {"progress": console})
    assert "cc_s learns random_reach by ppo: 800 steps over 8 arms, seed 0. Ctrl-C stops" in console.file.getvalue()
    brl.train(settings=SETTINGS, **SHORT | {"progress": True})
    out, err = capsys.readouterr()
    assert (out, "800 steps: goal" in err) == ("", True)


def test_an_interrupt_saves_and_says_how_to_go_on(tmp_path):
    path = tmp_path / "runs/random_reach/cc_s-ppo-1"

    def interrupt():
        while not (path / "evaluations.csv").exists():
            time.sleep(0.05)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(Stopped, match=r"Stopped, and saved in runs/.*-1; `bilateral_rl\.load\('runs/.*-1'\)\.resume"):
        brl.train(settings=SETTINGS, **SHORT | {"timesteps": 10**8})
    thread.join()
    assert brl.load(path).status["state"] == "interrupted"
