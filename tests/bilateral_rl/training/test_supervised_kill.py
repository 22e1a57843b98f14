"""A training that is killed, at any moment and again and again, ends with the bits it would have had anyway."""

import json
import random
import signal
import time

from processes import TIMEOUT, is_saving, started, wait_until

from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.training.run import resume, train


def epochs_done(path):
    try:
        return json.loads((path / "status.json").read_text())["epochs"]
    except FileNotFoundError:
        return -1


def test_a_killed_training_ends_with_the_same_bits_as_one_in_one_go(tmp_path, small_bptt, same_bits):
    settings = {"trials": 128, "learning_rate": 0.02, "patience": 15}
    config = small_bptt(epochs=80, threads=1, bptt=settings)
    whole = train(config, tmp_path / "whole").folder
    stopped = [seed["epochs"] for seed in whole.status()["seeds"]]
    assert min(stopped) < 40 < max(stopped)

    (tmp_path / "config.yaml").write_bytes((whole.path / "config.yaml").read_bytes())
    path, output = tmp_path / "killed" / "random_reach" / "cc_s-bptt-1", tmp_path / "output"
    generator = random.Random(0)
    command = ["--config", tmp_path / "config.yaml", "--out", tmp_path / "killed"]
    came_to = []
    for epoch, during_a_save in ((5, False), (20, True), (40, False)):
        with started("train", *command, output=output) as process:
            wait_until(lambda epoch=epoch: epochs_done(path) >= epoch, process, output)
            if during_a_save:
                wait_until(lambda: is_saving(path), process, output, pause=0.0)
            else:
                time.sleep(generator.uniform(0.0, 0.05))
            process.kill()
            process.join(TIMEOUT)
        assert process.exitcode == -signal.SIGKILL, output.read_text()
        came_to.append(epochs_done(path))
        assert json.loads((path / "status.json").read_text())["state"] == "running"
        command = ["--resume", path]
    assert came_to == sorted(came_to)
    assert came_to[-1] < max(stopped)
    resume(RunFolder(path), RunFolder(path).config())

    killed = RunFolder(path)
    for name in ("final", "best"):
        assert same_bits(killed.load_weights(name), whole.load_weights(name))
    assert same_bits(killed.load_resume(), whole.load_resume())
    assert (path / "epochs.csv").read_bytes() == (whole.path / "epochs.csv").read_bytes()
    assert killed.status() == whole.status()
