"""Small films and videos, and what is in them."""

import io
from types import SimpleNamespace

import imageio_ffmpeg
import numpy as np
import pytest
from plain_trials import without_forces
from rich.console import Console

from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.commands.render import render
from bilateral_rl.envs.arm import ArmParameters
from bilateral_rl.training.run import train
from bilateral_rl.video import files
from bilateral_rl.video.film import Film, Performance

pytest.importorskip("pygame")

SIZE = 320
JOINT = (0.26773175, 1.60175456)
"""Shoulder and elbow (rad) of the hand at (0.2, 0.4)."""


def _make_record(n=1, steps=8, **values) -> TrialRecord:
    """``n`` trials of a hand that stays at (0.2, 0.4), 30 cm from its target, by muscles at 0.1."""
    record = {
        "joint": np.tile(np.float32(JOINT), (n, steps + 1, 1)),
        "hand": np.tile(np.float32([0.2, 0.4]), (n, steps + 1, 1)),
        "target": np.tile(np.float32([-0.1, 0.4]), (n, 1)),
        "load": np.zeros((n, 2), np.float32),
        "distance": np.full((n, steps), 0.3, np.float32),
        "start_distance": np.full(n, 0.3, np.float32),
        "observation": np.zeros((n, steps, 16), np.float32),
        "excitation": np.zeros((n, steps, 6), np.float32),
        "activation": np.full((n, steps, 6), 0.1, np.float32),
        "vector_return": np.zeros((n, 2), np.float32),
        "arm": ArmParameters(),
    }
    record |= values
    return TrialRecord(**without_forces(record["hand"], record["target"], record["load"]) | record)


@pytest.fixture(scope="session")
def make_record():
    """Builder of records by hand: a hand that stays 30 cm from its target, and what is given."""
    return _make_record


def _make_film(*records) -> Film:
    trials = len(records[0].hand) // records[0].n_arms
    return Film([Performance(f"network {i}", record, 0.05) for i, record in enumerate(records)], 4, SIZE, trials)


@pytest.fixture(scope="session")
def make_film():
    """Builder of films of records."""
    return _make_film


@pytest.fixture(scope="session")
def unilateral(small_bptt, tmp_path_factory):
    """A run of another network."""
    return str(train(small_bptt("uni_b", seeds=1), tmp_path_factory.mktemp("uni")).folder.path)


@pytest.fixture
def show(tmp_path):
    """Render with small defaults; gives the path, what was said, and the pictures."""

    def call(*runs, out=tmp_path / "video.mp4", trials=1, lesion="intact", **options):
        said = io.StringIO()
        options = {"seed": 7, "weights": "final", "slow_down": 4, "size": SIZE, "task": None, "overrides": []} | options
        console = Console(file=said, width=1000)
        path = render(
            runs=[str(run) for run in runs], out=out, trials=trials, lesion=lesion, console=console, **options
        )
        meta, pictures = _decode(path) if path.suffix == ".mp4" and path.exists() else (None, None)
        return SimpleNamespace(path=path, said=said.getvalue(), meta=meta, pictures=pictures)

    return call


@pytest.fixture
def filmed(monkeypatch):
    """The films that would have been written: nothing is drawn."""
    films = []
    monkeypatch.setattr(files, "write", lambda path, film, *_: films.append(film))
    return films


def _decode(path):
    """What a video says of itself, and its pictures (n, h, w, 3)."""
    frames = imageio_ffmpeg.read_frames(str(path), input_params=["-threads", "1"])
    meta = next(frames)
    width, height = meta["size"]
    return meta, np.stack([np.frombuffer(frame, np.uint8).reshape(height, width, 3) for frame in frames])


@pytest.fixture(scope="session")
def decode():
    """What a video says of itself, and its pictures."""
    return _decode


def _apart(first, second):
    """Share of pixels in which pictures differ more than lossy compression makes them."""
    return (np.abs(first.astype(int) - second).max(axis=-1) > 60).mean()


@pytest.fixture(scope="session")
def apart():
    """Share of pixels in which pictures clearly differ."""
    return _apart


def _tree(path):
    """Every file below a folder, with its bytes."""
    return {file: file.read_bytes() for file in path.rglob("*") if file.is_file()}


@pytest.fixture(scope="session")
def tree():
    """Every file below a folder, with its bytes."""
    return _tree
