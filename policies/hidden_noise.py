"""Noise of hidden units: normal numbers from a stream of the network's own, or in tests of each trial's."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

_STREAM = 100
"""Tells the noise's streams from all others that are drawn from by the same seeds: the arm's, and BPTT's trials."""
_BLOCK = 16
"""Steps that the streams of trials draw at once: a call of a generator costs more than the numbers."""


class HiddenNoise:
    """The noise of a network's hidden units, from a stream on which nothing else that is random depends.

    Args:
        std: standard deviation of the noise, in units of activity; 0 for none.
        shape: (layers · sides, width) of the network.
        sides: of the network.
    """

    def __init__(self, std: float, shape: tuple[int, int], sides: int = 1) -> None:
        self.std, self.shape, self.sides = std, shape, sides
        self._generator: np.random.Generator | None = None
        self._trials: _TrialStreams | None = None

    def draw(self, n: int, device: torch.device | str = "cpu") -> Tensor | None:
        """Draw the noise of ``n`` samples, (n, layers · sides, width), for ``network(observation, noise)``.

        Returns:
            None for a network without noise, which draws nothing.

        Raises:
            ValueError: another number of samples than of trials, within :meth:`of_trials`.
        """
        if not self.std:
            return None
        numbers = self._trials.draw(n) if self._trials else _draw(self.generator, (n, *self.shape))
        return torch.from_numpy(np.float32(self.std) * numbers).to(device)

    @property
    def generator(self) -> np.random.Generator:
        """The stream; unless it has been seeded, that of torch seeds it when it is first needed."""
        if self._generator is None:
            self.seed(int(torch.randint(2**63 - 1, ())))
        assert self._generator is not None
        return self._generator

    def seed(self, seed: int) -> None:
        """Let the stream begin anew."""
        self._generator = _generator(seed)

    @contextlib.contextmanager
    def of_trials(self, seeds: Sequence[int], exchanged: Sequence[bool] = ()) -> Iterator[None]:
        """Within a ``with`` block, draw from a stream for each sample, which begins there by its seed.

        So a trial of a test has the same noise each time, whatever trials it is done with, and the network's own stream
        goes on afterwards as if there had been no test.

        Args:
            seeds: one for each of the samples of every :meth:`draw` within the block.
            exchanged: for which of them the two sides exchange their noise, as where both arms are exchanged; for none
                by itself.
        """
        before, self._trials = self._trials, _TrialStreams(seeds, self.shape, self.sides, exchanged)
        try:
            yield
        finally:
            self._trials = before


class _TrialStreams:
    """A stream for each trial, so that its noise is the same whichever trials it is done with."""

    def __init__(
        self, seeds: Sequence[int], shape: tuple[int, int], sides: int = 1, exchanged: Sequence[bool] = ()
    ) -> None:
        self._seeds, self._shape, self._sides = seeds, shape, sides
        self._exchanged = np.flatnonzero(exchanged)
        self._generators: list[np.random.Generator] = []  # made when the first is needed, as most networks need none
        self._block: NDArray[np.float32] = np.empty((len(seeds), 0, *shape), dtype=np.float32)
        self._step = 0

    def draw(self, n: int) -> NDArray[np.float32]:
        """Return standard normal numbers (n, layers · sides, width), a sample a trial."""
        if n != len(self._seeds):
            raise ValueError(f"there are {len(self._seeds)} trials with noise of their own, and {n} samples.")
        self._generators = self._generators or [_generator(seed) for seed in self._seeds]
        if self._step == self._block.shape[1]:
            self._block = np.stack([_draw(one, (_BLOCK, *self._shape)) for one in self._generators])
            if len(self._exchanged):
                by_side = self._block.reshape(len(self._seeds), _BLOCK, -1, self._sides, self._shape[1])
                by_side[self._exchanged] = by_side[self._exchanged, :, :, ::-1]
            self._step = 0
        self._step += 1
        return self._block[:, self._step - 1]


def _generator(seed: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(_STREAM,)))


def _draw(generator: np.random.Generator, shape: tuple[int, ...]) -> NDArray[np.float32]:
    return generator.standard_normal(shape, dtype=np.float32)
