"""The interface between a session and what learns in it: one network or several, by reinforcement or supervised."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, Literal, Protocol

from bilateral_rl.io.tensors import Tensors
from bilateral_rl.io.training_log import TrainingLog
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.runs.folder import RunFolder

Moment = Literal["start", "checkpoint", "end"]
"""When weights are saved: before anything is learned, along the way, or at the end (also of a stopped training)."""


class Watcher(Protocol):
    """All that a learner knows of the world around it."""

    def step(self, done: int) -> bool:
        """Hear how much is done; the answer is whether to go on."""

    def between(self) -> bool:
        """Do what belongs between two stretches of learning, such as saving; the answer is whether to go on.

        A learner calls it where its state is whole: before the first stretch and after each one.
        """


class Diverged(Exception):  # noqa: N818 - no fault of the program
    """Says, in a sentence for people, that what was learned is no longer made of finite numbers."""


class Learner(ABC):
    """Learns in stretches, can be saved between two of them, and goes on from there to the same bits."""

    evaluation_every: int
    """Distance between two evaluations, in what ``done`` counts; 0 for one at every boundary."""
    checkpoint_every: int
    """Distance between two checkpoints, in what ``done`` counts."""
    logs: Mapping[str, TrainingLog] = {}
    """Text files that it appends to, by name; the session cuts them back where the training goes on from a state."""

    @property
    @abstractmethod
    def done(self) -> int:
        """Environment steps or updates so far."""

    @property
    @abstractmethod
    def finished(self) -> bool:
        """Whether there is nothing left to learn."""

    @abstractmethod
    def why_finished(self) -> str:
        """Say what is finished and what to do for more, as the rest of a sentence about the run's folder."""

    @abstractmethod
    def state(self) -> Tensors:
        """Return everything that the rest of the training depends on, by name.

        Raises:
            Diverged: it is not made of finite numbers.
        """

    @abstractmethod
    def load(self, state: Tensors) -> None:
        """Go on from :meth:`state`. Raises ValueError for what is no such state."""

    @abstractmethod
    def status(self, run_state: str) -> dict[str, Any]:
        """Return what ``status.json`` says beside the state of the run."""

    @abstractmethod
    def weights(self, moment: Moment) -> dict[str, Tensors]:
        """Return the weights to save now, by the name of their file, the most recent ones first."""

    @abstractmethod
    def best(self) -> Tensors:
        """Return the best weights so far; empty if there are none yet."""

    @abstractmethod
    def policies(self) -> dict[int, MotorPolicy]:
        """Return what was learned, ready to act, by seed."""

    @abstractmethod
    def open(self, folder: RunFolder) -> None:
        """Open what is written along the way. Entries of a future that will be learned again are removed."""

    @abstractmethod
    def close(self) -> None:
        """Close what :meth:`open` opened, and let go of everything that is no longer needed."""

    @abstractmethod
    def learn(self, watcher: Watcher) -> bool:
        """Learn until the end; False if the watcher stopped it before, or something that :meth:`notes` tells of.

        Raises:
            Diverged: learning cannot go on.
        """

    @abstractmethod
    def evaluate(self) -> tuple[dict[str, float], bool]:
        """Measure, and log, what has been learned so far: the measures, and whether it is the best so far."""

    def write_tables(self, folder: RunFolder) -> None:
        """Write tables that are made anew from the state at each save; there are none unless a learner has some."""
        return

    def finish(self) -> None:
        """Do what comes after the last save, such as drawing; nothing unless a learner says so."""
        return

    def notes(self) -> list[str]:
        """Return sentences that a person should read at the end."""
        return []
