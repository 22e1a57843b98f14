"""The number of threads that torch uses."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import torch


@contextlib.contextmanager
def torch_threads(n: int) -> Iterator[None]:
    """A context in which torch uses ``n`` threads."""
    before = torch.get_num_threads()
    torch.set_num_threads(n)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def one_torch_thread() -> contextlib.AbstractContextManager[None]:
    """A context in which torch uses one thread.

    The networks are so small that a second thread gains nothing, and where other work uses the CPU as well, waiting for
    it makes everything ten times slower.
    """
    return torch_threads(1)
