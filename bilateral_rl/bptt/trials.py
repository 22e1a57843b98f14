"""The trials that each seed trains on: its own, drawn once, in an order of its own every epoch (paper section 5)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from bilateral_rl.bptt.trial_tensors import TrialTensors
from bilateral_rl.envs.arm import Arm
from bilateral_rl.envs.forces import affine_forces
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.tasks import Task
from bilateral_rl.envs.trial_checks import checked_trials

_WEIGHTS, _TRAINING, _VALIDATION, _ORDER, _RETRAINING, _RETRAINING_ORDER = range(6)
"""Numbers of a seed's random streams; none depends on how much of another was used."""


def initial_weights_seed(seed: int) -> int:
    """Return the number to seed torch with before the seed's network is made."""
    return int(_sequence(seed, _WEIGHTS).generate_state(1, np.uint64)[0] >> 1)


def training_trials(seed: int, n: int, task: Task, settings: TrialSettings) -> TrialTensors:
    """Return the ``n`` trials that the seed trains on, each tensor (n, …)."""
    return _draw(_sequence(seed, _TRAINING), n, task, settings)


def validation_trials(seed: int, n: int, task: Task, settings: TrialSettings) -> TrialTensors:
    """Return the ``n`` trials that decide when the seed stops, each tensor (n, …)."""
    return _draw(_sequence(seed, _VALIDATION), n, task, settings)


def retraining_trials(seed: int, n: int, task: Task, settings: TrialSettings) -> TrialTensors:
    """Return the ``n`` trials by which the seed's network adapts to a lesion, each tensor (n, …)."""
    return _draw(_sequence(seed, _RETRAINING), n, task, settings)


def stacked(trials: Sequence[TrialTensors], device: str = "cpu") -> TrialTensors:
    """Return the trials (n, …) of each seed as one, each tensor (seeds, n, …)."""
    return TrialTensors.stack(trials).map(lambda tensor: tensor.to(device))


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
    trials = checked_trials(drawn, n, task, settings)
    arm = Arm(settings.arm)

    def hand(angles: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the hand's position (n, 2) at joint angles (m)."""
        return arm.rest(torch.from_numpy(angles)).cartesian[:, :2].numpy()

    target = hand(trials.goal)
    arrays: dict[str, NDArray[Any]] = {"start": trials.start, "target": target, "load": trials.load}
    if trials.timeline is not None:
        timeline = trials.timeline
        arrays |= {"go": timeline.go, "jump": timeline.jump, "jump_target": hand(timeline.jump_goal)}
    if trials.forces is not None:
        arrays |= affine_forces(trials.forces, hand(trials.start), target)._asdict()
        arrays |= {"pulse": trials.forces.pulse, "pulse_window": trials.forces.pulse_window}
    if trials.spring is not None:
        arrays |= trials.spring._asdict()
    return TrialTensors(**{name: torch.from_numpy(array.copy()) for name, array in arrays.items()})
