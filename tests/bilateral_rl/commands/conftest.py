import itertools
import shutil
from pathlib import Path

import pytest
import torch
from rich.console import Console
from typer.testing import CliRunner

from bilateral_rl.commands import app as cli
from bilateral_rl.config.parse import merge
from bilateral_rl.config.resolve import resolve
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import build_network, build_policy, stack_states
from bilateral_rl.study import grid, lesion_folder, sweep

SHORT = {"trial": {"trial_length": 10}}
SHORT_BPTT = {"bptt": {"trials": 32, "batch_size": 16}}


@pytest.fixture
def toy_models(monkeypatch):
    """Trainings take the results that lie in ``prepared``, beside the study's folder, and fail where there are none."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "study"))
    for module in (grid, sweep):
        monkeypatch.setattr(module, "TRAIN_AND_MEASURE", "toy_models:measure")


@pytest.fixture
def invoke(tmp_path, monkeypatch):
    """Calls ``bilateral-rl`` in an empty folder; its exit code and what it printed. Errors are raised."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cli, "console", Console(width=200))

    def run(*arguments):
        result = CliRunner().invoke(cli.app, [str(argument) for argument in arguments])
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        return result.exit_code, result.output

    return run


@pytest.fixture
def undrawn(monkeypatch):
    """Figures take a second each."""
    monkeypatch.setattr(lesion_folder, "save", lambda figure, path: None)
    monkeypatch.setattr(lesion_folder, "lesion_effects", lambda *arguments: None)


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
        for seed in config.all_seeds:
            torch.manual_seed(10 * seed + len(model))
            states[seed] = build_network(config).state_dict()
        folder.save_weights("final", stack_states(states))
        return folder

    return make
