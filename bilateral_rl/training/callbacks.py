"""Callbacks of stable-baselines3: what happens while an algorithm learns, and between two of its rollouts."""

from __future__ import annotations

import json
import time
from abc import abstractmethod
from collections.abc import Callable
from typing import ClassVar

from stable_baselines3.common.callbacks import BaseCallback

from bilateral_rl.io.training_log import TrainingLog
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.training.learner import Watcher
from bilateral_rl.training.schedule import Schedule


class BetweenIterations(BaseCallback):
    """Does something between two iterations, once at least ``every`` environment steps have gone by."""

    def __init__(self, every: int) -> None:
        super().__init__()
        self._every = every

    def _on_training_start(self) -> None:
        self._schedule = Schedule(self._every, self.num_timesteps)

    def _on_rollout_start(self) -> None:
        if self._schedule.is_due(self.num_timesteps):
            self.act()

    def _on_step(self) -> bool:
        return True

    @abstractmethod
    def act(self) -> None:
        """Do it now."""


class LogCallback(BetweenIterations):
    """Writes what SB3 and the algorithm recorded: ``learn`` itself is called with ``log_interval=None``.

    SB3 counts iterations from where ``learn`` was called, or episodes, which end many at once with many arms.

    Args:
        timesteps: environment steps of the whole training.
    """

    POINTS = 1000
    """Largest number of points of a curve."""

    def __init__(self, timesteps: int) -> None:
        super().__init__(max(timesteps // self.POINTS, 1))

    def _on_training_start(self) -> None:
        super()._on_training_start()
        self._began = time.monotonic_ns()

    def act(self) -> None:
        """Write it now."""
        # SB3 takes the speed from the clock on the wall, which may be set back.
        self.model.start_time = time.time_ns() - (time.monotonic_ns() - self._began)
        self.model.dump_logs()  # type: ignore[attr-defined] # on- and off-policy algorithms both have it

    def _on_training_end(self) -> None:
        self.act()


class MonitorCallback(BaseCallback):
    """Writes every finished trial to ``monitor.csv`` in the format of SB3's ``Monitor``, with both streams' returns."""

    COLUMNS: ClassVar[tuple[str, ...]] = ("r", "l", "t", "dominant", "non_dominant")

    def __init__(self, folder: RunFolder, environment_id: str) -> None:
        super().__init__()
        self.log = TrainingLog(folder.path / "monitor.csv")
        about = json.dumps({"t_start": time.time(), "env_id": environment_id})
        self._header = f"#{about}\n{','.join(self.COLUMNS)}\n"
        self._lines: list[str] = []

    def _on_training_start(self) -> None:
        self._write()

    def _on_step(self) -> bool:
        if self.locals["dones"].any():
            episodes = [info["episode"] for info in self.locals["infos"] if "episode" in info]
            self._lines += [",".join(f"{e[column]:.6g}" for column in self.COLUMNS) + "\n" for e in episodes]
        return True

    def _on_rollout_start(self) -> None:
        if self._lines:
            self._write()

    def _on_training_end(self) -> None:
        self._write()

    def _write(self) -> None:
        self.log.append("".join(self._lines), self._header)
        self._lines.clear()


class Stopped(Exception):  # noqa: N818 - nothing went wrong
    """The training stops here, between two iterations: SB3 takes no other word for it."""


class WatcherCallback(BaseCallback):
    """Tells a watcher of every step and of every pause between iterations; it comes after all that writes.

    Args:
        watcher: who is told.
    """

    def __init__(self, watcher: Watcher) -> None:
        super().__init__()
        self._step: Callable[[int], bool] = watcher.step
        self._between = watcher.between

    def _on_step(self) -> bool:
        self._step(self.num_timesteps)  # the algorithm stops between iterations only, where its state is whole
        return True

    def _on_rollout_start(self) -> None:
        if not self._between():
            raise Stopped
