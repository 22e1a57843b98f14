import itertools
import shutil
import sys

import pytest
import torch
from rich.console import Console

from bilateral_rl import cli
from bilateral_rl.commands import lesion
from bilateral_rl.controllers import build_network, build_policy, seeds_of, stack_states
from bilateral_rl.resolve import resolve
from bilateral_rl.run_folder import RunFolder
from bilateral_rl.settings import merge

SHORT = {"trial": {"trial_length": 10}}
SHORT_BPTT = {"bptt": {"trials": 32, "batch_size": 16}}


@pytest.fixture
def call(tmp_path, monkeypatch, capsys):
    """Calls the command in a folder of its own, on a terminal of 80 columns: its exit code, output and errors."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cli, "console", Console(width=80))

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["bilateral-rl", *map(str, arguments)])
        code = 0
        try:
            cli.main()
        except SystemExit as end:
            code = end.code or 0
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return call


@pytest.fixture
def undrawn(monkeypatch):
    """Figures take a second each."""
    monkeypatch.setattr(lesion, "save", lambda figure, path: None)
    monkeypatch.setattr(lesion, "lesion_effects", lambda *arguments: None)


@pytest.fixture
def trained(_trained_bptt, tmp_path):
    """A finished run of three seeds at runs/random_reach/cc_s-bptt-1."""
    path = tmp_path / "runs" / "random_reach" / "cc_s-bptt-1"
    shutil.copytree(_trained_bptt.path, path)
    return RunFolder(path)


@pytest.fixture
def make_run(tmp_path):
    """Builder of runs whose networks are fresh ones; their weights depend on seed and model."""

    def make(model="cc_s", algo="bptt", task="random_reach", out="runs", **values):
        config = resolve(algo, task, [merge(merge(SHORT, SHORT_BPTT if algo == "bptt" else {}), values)], model=model)
        paths = (tmp_path / out / task / f"{model}-{algo}-{number}" for number in itertools.count(1))
        folder = RunFolder(next(path for path in paths if not path.exists()))
        (folder.path / "weights").mkdir(parents=True)
        folder.write_config(config)
        if algo != "bptt":
            torch.manual_seed(1000 + config.seed)
            folder.save_weights("final", build_policy(config).state_dict())
            return folder
        states = {}
        for seed in seeds_of(config):
            torch.manual_seed(10 * seed + len(model))
            states[seed] = build_network(config).state_dict()
        folder.save_weights("final", stack_states(states))
        return folder

    return make
