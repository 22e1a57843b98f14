"""Tests in which every trial of two arms is done both ways: as it is drawn, and with the arms exchanged.

Else all networks would share the accidents of one set of trials, of which one hand had the easier ones, and a
difference between the hands would be found where there is none.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

from bilateral_rl.envs.doors import whole_number
from bilateral_rl.envs.experiments.exchanged import exchanged
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.task import HandForces, Task, Trials
from bilateral_rl.envs.trial_checks import checked_trials
from bilateral_rl.envs.trials import TrialBatch
from bilateral_rl.io.errors import UserError


class OddTrialsError(UserError, ValueError):
    """The trials of a test cannot be halved into those that are drawn and those with the arms exchanged."""


class DrawnTrials(NamedTuple):
    """``n`` trials of a test, before they begin."""

    seeds: list[int]
    """(n,), what each is drawn by."""
    exchanged: NDArray[np.bool_]
    """(n,), which ones are the trial before them with the arms exchanged."""
    uniform: NDArray[np.float64]
    """(n, n_uniform), the uniform numbers that they are drawn from."""
    trials: Trials
    """What the task makes of them, as :class:`~bilateral_rl.envs.task.Trials` says."""
    noise: NDArray[np.float64] | None
    """(n · arms, T + 1, 20), standard normal; None where the settings have no noise."""


def trial_seeds(task: Task, settings: TrialSettings, n: int, first: int) -> tuple[list[int], NDArray[np.bool_]]:
    """Return the seeds (n,) of the trials of a test, and which are done with the arms exchanged.

    Trial i is the first one of seed ``first + i``; where arms are exchanged, that holds for even i, and the next trial
    is the same with the arms exchanged.

    Raises:
        OddTrialsError: an odd number of trials where arms are exchanged.
        TypeError, ValueError: no such seed.
    """
    first, number = whole_number("seed", first, 0), np.arange(n)
    if not task.is_symmetric(settings):
        return [first + i for i in range(n)], np.zeros(n, dtype=np.bool_)
    if n % 2:
        raise OddTrialsError(
            f"Every trial of two arms is also done with the arms exchanged: their number must be even, got {n}."
        )
    return [first + i - i % 2 for i in range(n)], number % 2 == 1


def draw(batch: TrialBatch, seeds: list[int], where: NDArray[np.bool_]) -> DrawnTrials:
    """Draw the trials of a test, each by its seed, and with the arms exchanged where that is said."""
    draws = {seed: batch.draw(seeding.np_random(seed)[0]) for seed in dict.fromkeys(seeds)}
    uniform = np.concatenate([draws[seed].uniform for seed in seeds])
    noise = [draw.noise for draw in map(draws.__getitem__, seeds) if draw.noise is not None]
    trials = exchanged(batch.task.trials(uniform, batch.settings), where)
    return DrawnTrials(seeds, where, uniform, trials, exchange_hands(np.concatenate(noise), where) if noise else None)


def exchange_hands(rows: NDArray[Any], where: NDArray[np.bool_]) -> NDArray[Any]:
    """Return rows of hands (n · arms, …), each in its own arm's frame, of which in trials of ``where`` (n,) the arms
    are exchanged: as the arms are mirror images of each other there, the rows change places.
    """
    if not where.any():
        return rows
    pairs = rows.reshape(len(where), -1, *rows.shape[1:])
    return np.where(where.reshape(-1, *[1] * rows.ndim), pairs[:, ::-1], pairs).reshape(rows.shape)


def hand_rows(drawn: DrawnTrials, batch: TrialBatch) -> Trials:
    """Return the trials as they are checked when they begin, a row a hand."""
    return checked_trials(drawn.trials, batch.n, batch.task, batch.settings)


def target_indices(drawn: DrawnTrials, batch: TrialBatch) -> NDArray[np.int32]:
    """Return which of the listed targets each hand has, (n · arms,), from 0; -1 without a list."""
    index = np.asarray(batch.task.target_indices(drawn.uniform, batch.settings), dtype=np.int32)
    by_hand = np.broadcast_to(index.reshape(batch.n, -1), (batch.n, batch.n_arms))
    return exchange_hands(by_hand.reshape(-1), drawn.exchanged)


def fields_of_hands(drawn: DrawnTrials, batch: TrialBatch) -> HandForces | None:
    """Return the forces of each hand as if the field were on in each trial, (n · arms, …); None without such."""
    task = batch.task
    forces = task.field(drawn.uniform, batch.settings) if task.has_forces else None
    if forces is None:
        return None
    with_field = task.trials(drawn.uniform, batch.settings)._replace(forces=forces)
    return hand_rows(drawn._replace(trials=exchanged(with_field, drawn.exchanged)), batch).forces
