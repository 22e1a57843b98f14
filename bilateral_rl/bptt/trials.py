"""The trials that each seed trains on: its own, drawn once, in an order of its own every epoch (paper section 5)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from bilateral_rl.bptt.rollout_arrays import TrialTensors
from bilateral_rl.envs.arm import Arm
from bilateral_rl.envs.doors import checked_trials
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.tasks import Task

_WEIGHTS, _TRAINING, _VALIDATION, _ORDER, _RETRAINING, _RETRAINING_ORDER = range(6)
"""Numbers of a seed's random streams; none depends on how much of another was used."""


def initial_weights_seed(seed: int) -> int:
    """Return the number to seed torch with before the seed's network is made."""
    return int(_sequence(seed, _WEIGHTS).generate_state(1, np.uint64)[0] >> 1)


def training_trials(seed: int, n: int, task: Task, settings: TrialSettings) -> TrialTensors:
    """Return the ``n`` trials that the seed trains on, each tensor (n, 2)."""
    return _draw(_sequence(seed, _TRAINING), n, task, settings)


def validation_trials(seed: int, n: int, task: Task, settings: TrialSettings) -> TrialTensors:
    """Return the ``n`` trials that decide when the seed stops, each tensor (n, 2)."""
    return _draw(_sequence(seed, _VALIDATION), n, task, settings)


def retraining_trials(seed: int, n: int, task: Task, settings: TrialSettings) -> TrialTensors:
    """Return the ``n`` trials by which the seed's network adapts to a lesion, each tensor (n, 2)."""
    return _draw(_sequence(seed, _RETRAINING), n, task, settings)


def stacked(trials: Sequence[TrialTensors], device: str = "cpu") -> TrialTensors:
    """Return the trials (n, 2) of each seed as one, each tensor (seeds, n, 2)."""
    return TrialTensors(*(torch.stack(parts).to(device) for parts in zip(*trials, strict=True)))


def epoch_order(seed: int, epoch: int, n: int) -> NDArray[np.int64]:
    """Return the order (n,) of the seed's trials in ``epoch``: a function of both, so that a resumed run repeats it."""
    return np.random.default_rng(_sequence(seed, _ORDER, epoch)).permutation(n)


def retraining_order(seed: int, epoch: int, n: int) -> NDArray[np.int64]:
    """Return the order (n,) of the seed's trials in ``epoch`` of a retraining; in epoch 0 they stand as drawn."""
    rng = np.random.default_rng(_sequence(seed, _RETRAINING_ORDER, epoch))
    return rng.permutation(n) if epoch else np.arange(n)


def _sequence(seed: int, *stream: int) -> np.random.SeedSequence:
    return np.random.SeedSequence(seed, spawn_key=stream)


def _draw(sequence: np.random.SeedSequence, n: int, task: Task, settings: TrialSettings) -> TrialTensors:
    drawn = task.trials(np.random.default_rng(sequence).random((n, task.n_uniform)), settings)
    trials = checked_trials(drawn, n, task, settings.arm)
    goal = Arm(settings.arm).rest(torch.from_numpy(trials.goal))
    return TrialTensors(
        start=torch.from_numpy(trials.start),
        target=goal.cartesian[:, :2].clone(),
        load=torch.from_numpy(trials.load),
    )
