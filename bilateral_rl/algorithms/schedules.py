"""Schedules of hyperparameters over a training."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class linear_schedule:  # noqa: N801 - used as a function; a class so that SB3 can pickle it
    """A schedule that goes linearly from ``initial`` to ``final``, by the remaining progress (1 to 0)."""

    initial: float
    final: float

    def __call__(self, remaining: float) -> float:
        return self.final + (self.initial - self.final) * max(remaining, 0.0)
