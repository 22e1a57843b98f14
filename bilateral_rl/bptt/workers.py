"""Threads that share the work of a rollout."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import torch

from bilateral_rl.io.cpus import usable_cpus


class Workers:
    """``n`` threads, each with one thread of torch's, so that the same bits come out however many there are.

    Kernels and matrix products leave Python's lock, so that threads run side by side.

    Args:
        n: number of threads; 1 is the calling one, 0 as many as there are CPUs for this process.
    """

    def __init__(self, n: int = 1) -> None:
        self.n = n or usable_cpus()
        self._pool: ThreadPoolExecutor | None = None
        if self.n > 1:
            self._pool = ThreadPoolExecutor(self.n, initializer=torch.set_num_threads, initargs=(1,))

    def parts(self, n: int) -> list[range]:
        """Return ``range(n)`` cut into a part of nearly equal size for each thread."""
        parts = min(n, self.n)
        bounds = [n * i // parts for i in range(parts + 1)]
        return [range(a, b) for a, b in itertools.pairwise(bounds)]

    def share(self, jobs: list[Callable[[], Any]]) -> None:
        """Do every job, side by side, and wait for all."""
        if self._pool is None:
            for job in jobs:
                job()
        else:
            for future in [self._pool.submit(job) for job in jobs]:
                future.result()

    def close(self) -> None:
        """Let the threads go."""
        if self._pool is not None:
            self._pool.shutdown()
