"""The zoo's commands, called as on the command line."""

import shlex
import sys

import pytest

ARM = "bilateral_rl/RandomReach-v0"
QUICK = {
    "hemispheric_ppo": "n_steps:20 batch_size:40",
    "hemispheric_a2c": "n_steps:10",
    "hemispheric_sac": "learning_starts:100 train_freq:4 buffer_size:1000",
    "hemispheric_td3": "learning_starts:100 train_freq:4 buffer_size:1000",
}
"""Hyperparameters for a training of a few hundred steps."""


@pytest.fixture
def zoo(tmp_path, monkeypatch, capsys):
    """Runs a command of ``python -m bilateral_rl.zoo`` in a folder of its own and gives what it printed."""
    monkeypatch.chdir(tmp_path)

    def call(command):
        from bilateral_rl.zoo.__main__ import main

        monkeypatch.setattr(sys, "argv", ["zoo", *shlex.split(command)])
        main()
        return capsys.readouterr().out

    return call


@pytest.fixture
def train(zoo):
    """Trains for a few hundred steps with four environments."""

    def call(algo="hemispheric_ppo", env=ARM, steps=320, params="", options=""):
        quick = QUICK.get(algo, QUICK.get(f"hemispheric_{algo}"))
        params = f"n_envs:4 {quick} {params}"
        return zoo(f"train --algo {algo} --env {env} -n {steps} --eval-freq -1 --seed 0 {options} -params {params}")

    return call
