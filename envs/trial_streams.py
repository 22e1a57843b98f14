"""One random stream per arm, or pair of arms, so that its trials do not depend on how many there are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

from bilateral_rl.envs.doors import checked_seed
from bilateral_rl.envs.generators import generator_states, set_generator_states
from bilateral_rl.envs.infos import hands_that_hold
from bilateral_rl.envs.trials import TrialBatch, check_array

DRAWN_AHEAD = 64
"""Trials drawn at once per arm where no noise is drawn between them; a block of draws equals draws one by one."""


class TrialStreams:
    """Draws the next trials of a batch of arms, arm ``i`` from a generator of its own.

    Args:
        batch: the arms.
        seeds: one per arm; None seeds from the operating system.

    Attributes:
        holds: (n, 2 arms), whether each hand is to hold in the trial that runs; None in a task of one arm.
    """

    def __init__(self, batch: TrialBatch, seeds: Sequence[int | None]) -> None:
        self._batch = batch
        self._generators = [seeding.np_random(checked_seed(seed))[0] for seed in seeds]
        ahead = 1 if batch.settings.noisy else DRAWN_AHEAD
        self._uniform = np.zeros((batch.n, ahead, batch.task.n_uniform))
        self._next = np.full(batch.n, ahead)
        self.holds = None if batch.n_arms == 1 else np.zeros((batch.n, 2), dtype=np.bool_)

    def reseed(self, seeds: Sequence[int | None]) -> None:
        """Begin arm ``i``'s stream anew from ``seeds[i]``; where that is None, the stream goes on."""
        for arm, seed in enumerate(seeds):
            if seed is not None:
                self._generators[arm] = seeding.np_random(checked_seed(seed))[0]
                self._next[arm] = self._uniform.shape[1]

    def state_arrays(self) -> dict[str, NDArray[Any]]:
        """Return the generators and what they have drawn ahead, by name."""
        return {"generators": generator_states(self._generators), "uniform": self._uniform, "next": self._next}

    def set_state_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go on from the state that :meth:`state_arrays` returned.

        Raises:
            ValueError: arrays of another shape or type, or numbers that such streams cannot come to.
        """
        for name, present in self.state_arrays().items():
            check_array(name, arrays.get(name), present)
        uniform, following = arrays["uniform"], arrays["next"]
        if (uniform < 0).any() or (uniform >= 1).any() or (following < 0).any() or (following > uniform.shape[1]).any():
            raise ValueError("uniform or next is out of range")
        set_generator_states(self._generators, arrays["generators"])
        self._uniform[:] = uniform
        self._next[:] = following
        if self.holds is not None:  # which is no part of the state, as the numbers of each running trial are
            running = uniform[np.arange(len(uniform)), following - 1]
            self.holds[:] = hands_that_hold(self._batch.task.trials(running, self._batch.settings))

    def start(self, arms: NDArray[np.int32]) -> None:
        """Begin the next trial of each of ``arms``."""
        ahead = self._uniform.shape[1]
        noise = []
        for arm in arms[self._next[arms] == ahead]:
            draws = self._batch.draw(self._generators[arm], ahead)
            self._uniform[arm] = draws.uniform
            self._next[arm] = 0
            if draws.noise is not None:
                noise.append(draws.noise)
        uniform = self._uniform[arms, self._next[arms]]
        self._next[arms] += 1
        trials = self._batch.task.trials(uniform, self._batch.settings)
        self._batch.start(arms, trials, np.concatenate(noise) if noise else None)
        if self.holds is not None:
            self.holds[arms] = hands_that_hold(trials)
