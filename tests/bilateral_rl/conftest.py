import functools
import itertools
import shutil
import sys

import pytest
import torch
import typer
from rich.console import Console
from rl_runs import small_rl

from bilateral_rl.bptt.history import history_columns
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.state import TrainingState
from bilateral_rl.bptt.trainer import Trainer
from bilateral_rl.bptt.trials import initial_weights_seed
from bilateral_rl.commands import app as cli
from bilateral_rl.config.parse import merge
from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import BPTTConfig, RLConfig
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import build_network, build_policy, stack_states
from bilateral_rl.study import lesion_folder
from bilateral_rl.training.run import train

SMALL = {
    "timesteps": 4_000,
    "n_envs": 20,
    "ppo": {"batch_size": 250},
    "evaluation": {"every": 2_000, "checkpoint_every": 2_000, "trials": 8},
}

SMALL_BPTT = {
    "seeds": 2,
    "epochs": 3,
    "bptt": {"trials": 32, "batch_size": 16, "validation_trials": 8},
    "trial": {"trial_length": 20},
}

SHORT = {"trial": {"trial_length": 10}}
SHORT_BPTT = {"bptt": {"trials": 32, "batch_size": 16}}


@pytest.fixture
def small() -> RLConfig:
    return resolve(None, None, [SMALL])


@pytest.fixture(scope="session")
def _trained(tmp_path_factory) -> RunFolder:
    return train(resolve(None, None, [SMALL]), tmp_path_factory.mktemp("runs")).folder


@pytest.fixture
def run(_trained, tmp_path) -> RunFolder:
    """A small finished run of its own copy, free to be damaged."""
    path = tmp_path / "runs" / "random_reach" / "cc_s-ppo-1"
    shutil.copytree(_trained.path, path)
    return RunFolder(path)


@pytest.fixture(scope="session")
def whole_run(tmp_path_factory):
    """By algorithm, the run of ``rl_runs.small_rl`` in one go."""
    made: dict[str, RunFolder] = {}

    def get(algo: str) -> RunFolder:
        if algo not in made:
            made[algo] = train(small_rl(algo), tmp_path_factory.mktemp(algo)).folder
        return made[algo]

    return get


def _small_bptt(model="cc_s", task="random_reach", **values) -> BPTTConfig:
    return resolve("bptt", task, [merge(SMALL_BPTT, values)], model=model)


@pytest.fixture(scope="session")
def small_bptt():
    """Builder of configurations of supervised trainings that take a tenth of a second."""
    return _small_bptt


@pytest.fixture(scope="session")
def _trained_bptt(tmp_path_factory) -> RunFolder:
    # The best weights are those of epoch 5.
    config = _small_bptt(seeds=3, epochs=6, bptt={"learning_rate": 0.2})
    return train(config, tmp_path_factory.mktemp("runs")).folder


@pytest.fixture
def bptt_run(_trained_bptt, tmp_path) -> RunFolder:
    """A small finished supervised run of three seeds, of its own copy, free to be damaged."""
    path = tmp_path / "runs" / "random_reach" / "cc_s-bptt-1"
    shutil.copytree(_trained_bptt.path, path)
    return RunFolder(path)


@pytest.fixture
def make_trainer():
    """Builder of a supervised training at its start, or at ``state``."""
    made = []

    def make(config, state=None):
        layout = Layout(build_network(config))
        if state is None:
            networks = []
            for seed in config.all_seeds:
                torch.manual_seed(initial_weights_seed(seed))
                networks.append(build_network(config).state_dict())
            state = TrainingState.start(layout.pack(networks), len(history_columns(config, layout)))
        made.append(Trainer(config, layout, state))
        return made[-1]

    yield make
    for trainer in made:
        trainer.close()


def _same_bits(first, second) -> bool:
    if isinstance(first, dict):
        return first.keys() == second.keys() and all(_same_bits(first[name], second[name]) for name in first)
    same_kind = first.dtype == second.dtype and first.shape == second.shape
    return same_kind and first.contiguous().numpy().tobytes() == second.contiguous().numpy().tobytes()


@pytest.fixture(scope="session")
def same_bits():
    """Whether two tensors, or dictionaries of them, are the same to the last bit, what is no number included."""
    return _same_bits


_command_line = functools.cache(typer.main.get_command)
"""All commands and their options, which take 40 ms to build; a process of its own needs them once."""


@pytest.fixture
def call(tmp_path, monkeypatch, capsys):
    """Calls the command in a folder of its own, on a terminal of 80 columns: its exit code, output and errors."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cli, "console", Console(width=80))
    monkeypatch.setattr(typer.main, "get_command", _command_line)

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
    monkeypatch.setattr(lesion_folder, "save", lambda figure, path: None)
    for draw in ("lesion_effects", "lesioned_hands"):
        monkeypatch.setattr(lesion_folder, draw, lambda *_, **__: None)


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
