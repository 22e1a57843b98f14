"""What tests of reinforcement learning runs share: small trainings of every algorithm, and when two are the same."""

import csv
import math

import numpy as np
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from bilateral_rl.config.parse import merge
from bilateral_rl.config.resolve import resolve

ALGORITHMS = ("ppo", "a2c", "sac", "td3")

_OFF_POLICY = {"learning_starts": 200, "buffer_size": 1200, "batch_size": 16, "train_freq": 2}
_TD3 = _OFF_POLICY | {"critic_warm_up": 20}
_OF = {"ppo": {"n_steps": 10, "batch_size": 40, "n_epochs": 2}, "a2c": {}, "sac": _OFF_POLICY, "td3": _TD3}
_NOISY = ("ppo", "td3")
"""Algorithms whose small trainings have noise on hidden units; the others', of which each is a peer, have none."""
_SMALL = {
    "timesteps": 1_600,
    "n_envs": 8,
    "network": {"critic_arch": [8]},
    "trial": {"trial_length": 20, "sensory_noise": 0.01},
    "evaluation": {"every": 400, "checkpoint_every": 300, "trials": 4},
}

OF_THE_CLOCK = {"environment.elapsed", "episodes.info.t", "file.monitor.csv"}
"""In what resuming needs: how long it took, and how many digits that has."""


def small_rl(algo, task=None, **values):
    """A training of a second; the replay buffer goes round, and noise is drawn."""
    noise = {"network": {"hidden_noise": 0.05}} if algo in _NOISY else {}
    return resolve(algo, task, [merge(merge(_SMALL | {algo: _OF[algo]}, noise), values)])


def evaluations(folder):
    with (folder.path / "evaluations.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def monitored(folder):
    """Every trial's row, but for its time."""
    _, *lines = (folder.path / "monitor.csv").read_text().splitlines()
    return [
        [field for field, name in zip(row, next(csv.reader(lines[:1])), strict=True) if name != "t"]
        for row in csv.reader(lines)
    ]


def curves(folder):
    """What tensorboard shows: by tag, (step, value); what is no number is None."""
    events = EventAccumulator(str(folder.path), size_guidance={"scalars": 0})
    events.Reload()
    tags = events.Tags()["scalars"]
    return {tag: [(e.step, None if math.isnan(e.value) else e.value) for e in events.Scalars(tag)] for tag in tags}


def differences(one, other):
    """What the folders of two trainings do not agree in, but for the time it took."""
    found = []
    for name in sorted({*one.weight_names()} | {*other.weight_names()}):
        both = name in one.weight_names() and name in other.weight_names()
        found += [name] if not both or _differ(one.load_weights(name), other.load_weights(name)) else []
    states = [{k: t for k, t in folder.load_resume().items() if k not in OF_THE_CLOCK} for folder in (one, other)]
    found += [f"state: {name}" for name in _differ(*states)]
    for read in (evaluations, monitored, _timeless_curves):
        found += [] if read(one) == read(other) else [read.__name__]
    return found


def _timeless_curves(folder):
    shown = curves(folder)
    del shown["time/fps"]
    return shown


def _differ(one, other):
    same = {name for name in one.keys() & other.keys() if _bits(one[name]) == _bits(other[name])}
    return sorted((one.keys() | other.keys()) - same)


def _bits(tensor):
    array = np.ascontiguousarray(tensor.cpu().numpy())
    return array.dtype, array.shape, array.tobytes()
