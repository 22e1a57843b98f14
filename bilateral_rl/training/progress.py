"""How a training tells others where it is, how it is asked to stop, and how it ended."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from types import FrameType

from bilateral_rl.policies import MotorPolicy
from bilateral_rl.runs.folder import RunFolder


class Progress:
    """Is told how a training comes along; subclass it to watch one.

    What is counted is environment steps in reinforcement learning and updates in supervised training
    (``config.unit``).
    """

    def on_start(self, done: int) -> None:
        """Hear that the training starts, with ``done`` of its total done before."""

    def on_step(self, done: int) -> None:
        """Hear that ``done`` of the total are done."""

    def on_stop(self) -> None:
        """Hear that somebody asked for a stop, which comes once all is saved."""

    def on_evaluation(self, done: int, measures: dict[str, float]) -> None:
        """Hear what an evaluation measured.

        ``measures`` holds ``seed`` where it is about one of several networks, and ``epoch`` and ``seeds_training``
        where it is the mean over those that train side by side.
        """


UNWATCHED = Progress()


@dataclass(frozen=True)
class Outcome:
    """How a training ended."""

    folder: RunFolder
    done: int
    """Environment steps or updates."""
    stopped_by: signal.Signals | None
    """The signal that stopped it before its end; None if it came there."""
    seconds: float
    """Duration of this stretch of the training."""
    policies: dict[int, MotorPolicy]
    """The trained policies by seed."""
    notes: list[str] = field(default_factory=list)
    """Sentences that a person should read."""

    @property
    def interrupted(self) -> bool:
        """Whether it was stopped before its end."""
        return self.stopped_by is not None


class StopRequest:
    """Remembers that somebody pressed Ctrl-C, or asked this process to terminate (SIGTERM)."""

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

        def request(number: int, frame: FrameType | None) -> None:
            if self.requested and number == signal.SIGINT:
                raise KeyboardInterrupt
            self.signal = self.signal or signal.Signals(number)

        before = {number: signal.signal(number, request) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
