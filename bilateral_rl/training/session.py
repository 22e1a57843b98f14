"""How a training tells others where it is, how it is asked to stop, and how it ended."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from types import FrameType
from typing import Any

import torch

from bilateral_rl.io.errors import UserError
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.runs.folder import RunFolder


class Progress:
    """Who is told how a training comes along; subclass it to watch, or leave it unwatched.

    What is counted is environment steps in reinforcement learning and updates in supervised training.
    """

    def on_start(self, done: int) -> None:
        """Training starts with ``done`` of its total done before."""

    def on_step(self, done: int) -> None:
        """``done`` of its total are done."""

    def on_evaluation(self, done: int, measures: dict[str, float]) -> None:
        """The controller was evaluated."""


UNWATCHED = Progress()


@dataclass(frozen=True)
class Outcome:
    """How a training ended."""

    folder: RunFolder
    done: int
    """Environment steps or updates."""
    stopped_by: signal.Signals | None
    """What asked it to stop before its end; None if it came there."""
    seconds: float
    policies: dict[int, MotorPolicy]
    """What was trained, by seed."""
    notes: list[str] = field(default_factory=list)
    """What a person should know of it."""

    @property
    def interrupted(self) -> bool:
        """Whether it was stopped before its end."""
        return self.stopped_by is not None


class StopRequest:
    """Whether somebody pressed Ctrl-C, or asked this process to terminate (SIGTERM)."""

    def __init__(self) -> None:
        self.signal: signal.Signals | None = None
        """The first request."""

    @property
    def requested(self) -> bool:
        """Whether there was one."""
        return self.signal is not None

    @contextlib.contextmanager
    def on_interrupt(self) -> Iterator[None]:
        """A context in which a signal requests the stop, and Ctrl-C after that raises KeyboardInterrupt."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return

        def request(number: int, frame: FrameType | None) -> Any:
            if self.requested and number == signal.SIGINT:
                raise KeyboardInterrupt
            self.signal = self.signal or signal.Signals(number)

        before = {number: signal.signal(number, request) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


def check_device(device: str) -> None:
    """Raise a UserError if ``device`` is not there."""
    if device.startswith("cuda") and not torch.cuda.is_available():
        raise UserError("There is no CUDA device here; use --device cpu.")
