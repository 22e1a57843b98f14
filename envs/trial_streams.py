"""One random stream per arm, so that an arm's trials do not depend on how many arms there are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

from bilateral_rl.envs.trials import TrialBatch

DRAWN_AHEAD = 64
"""Trials drawn at once per arm where no noise is drawn between them; a block of draws equals draws one by one."""


class TrialStreams:
    """Draws the next trials of a batch of arms, arm ``i`` from a generator of its own.

    Args:
        batch: the arms.
        seeds: one per arm; None seeds from the operating system.
    """

    def __init__(self, batch: TrialBatch, seeds: Sequence[int | None]) -> None:
        self._batch = batch
        self._generators = [seeding.np_random(seed)[0] for seed in seeds]
        ahead = 1 if batch.settings.noisy else DRAWN_AHEAD
        self._uniform = np.empty((batch.n, ahead, batch.task.n_uniform))
        self._next = np.full(batch.n, ahead)

    def reseed(self, seeds: Sequence[int | None]) -> None:
        """Begin arm ``i``'s stream anew from ``seeds[i]``; where that is None, the stream goes on."""
        for arm, seed in enumerate(seeds):
            if seed is not None:
                self._generators[arm] = seeding.np_random(seed)[0]
                self._next[arm] = self._uniform.shape[1]

    def start(self, arms: NDArray[np.int32]) -> None:
        """Begin the next trial of each of ``arms``."""
        ahead = self._uniform.shape[1]
        noise = []
        for arm in arms[self._next[arms] == ahead]:
            draws = self._batch.draw(self._generators[arm], ahead)
            self._uniform[arm] = draws.uniform
            self._next[arm] = 0
            if draws.noise is not None:
                noise.append(draws.noise[0])
        uniform = self._uniform[arms, self._next[arms]]
        self._next[arms] += 1
        trials = self._batch.task.trials(uniform, self._batch.settings)
        self._batch.start(arms, trials, np.stack(noise) if noise else None)
