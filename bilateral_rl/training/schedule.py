"""When something along a training is due: counted so that going on from a saved state changes nothing."""

from __future__ import annotations


class Schedule:
    """Something that is due at every multiple of ``every``, or whenever it is asked for if ``every`` is 0.

    A training that goes on from a saved state does it where a training in one go would have done it.

    Args:
        every: how much lies between two times.
        done: how much is done already.
        at_once: whether it is due at ``done`` already.
    """

    def __init__(self, every: int, done: int, at_once: bool = False) -> None:
        self._every = every
        self._next = done if at_once else self._after(done)

    def is_due(self, done: int) -> bool:
        """Whether the next multiple has come; if so, the one after it is waited for."""
        if done < self._next:
            return False
        self._next = self._after(done)
        return True

    def _after(self, done: int) -> int:
        return (done // self._every + 1) * self._every if self._every else done
