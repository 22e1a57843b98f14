"""What a video shows: the same trials by one or several networks, picture by picture."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.analysis.trials import TrialRecord
from bilateral_rl.envs.canvas import tile
from bilateral_rl.envs.measures import trial_measures
from bilateral_rl.envs.rendering import Scene, draw

PAUSE = 0.6
"""Seconds of video for which the end of a trial stands still."""

Picture = NDArray[np.uint8]


@dataclass(frozen=True)
class Performance:
    """The trials of one network, for a film."""

    label: str
    """The network in words."""
    record: TrialRecord
    """Its trials."""
    radius: float
    """Radius of the goal (m)."""

    def scene(self, trial: int, step: int, caption: str) -> Scene:
        """Return what there is to see after ``step`` steps of a trial; before the first, muscles are at rest."""
        record = self.record
        rest = np.full(record.activation.shape[-1], record.arm.min_activation)
        return Scene(
            angles=record.joint[trial, step],
            activation=record.activation[trial, step - 1] if step else rest,
            target=record.target[trial],
            path=record.hand[trial, : step + 1],
            threshold=self.radius,
            load=record.load[trial],
            caption=f"{self.label}\n{caption}\n{self.goal(trial, step)}",
        )

    def goal(self, trial: int, step: int) -> str:
        """Say how the trial stands after ``step`` steps, by the measures of ``evaluate`` (paper section 3)."""
        distance, start = self.record.distance[trial], self.record.start_distance[trial]
        so_far = trial_measures(distance[None, : max(step, 1)], start[None], self.radius)
        if start <= self.radius:
            return f"in the goal {so_far.time_in_goal[0] if step else 0} of {step} steps"
        if step and so_far.goal_completion[0]:
            return "goal reached"
        return "goal not reached" if step == len(distance) else "goal not reached yet"


@dataclass(frozen=True)
class Film:
    """Trials one after another, with a pause after each, and the networks side by side.

    Args:
        performances: the same trials by each network.
        slow_down: seconds of video for a second of the arm's time.
        size: width and height of a network's picture (pixels).
    """

    performances: Sequence[Performance]
    slow_down: int
    size: int

    @property
    def fps(self) -> float:
        """Pictures a second; there is one for every step."""
        return 1 / (self.slow_down * self._first.arm.timestep)

    @property
    def steps(self) -> int:
        """Steps of a trial."""
        return len(self._first.distance[0])

    @property
    def trials(self) -> int:
        """Number of trials."""
        return len(self._first.target)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of a picture (pixels): rows of networks, never more rows than columns."""
        return self.size * math.ceil(len(self.performances) / self._columns), self.size * self._columns

    def __len__(self) -> int:
        """Number of pictures."""
        return self.trials * (self.steps + 1 + self._still)

    def __iter__(self) -> Iterator[Picture]:
        for trial in range(self.trials):
            for step in range(self.steps + 1):
                picture = self.picture(trial, step)
                yield picture
            for _ in range(self._still):
                yield picture

    def picture(self, trial: int, step: int) -> Picture:
        """Draw all networks after ``step`` steps of a trial, (h, w, 3) RGB."""
        seconds = step * self._first.arm.timestep
        caption = f"trial {trial + 1} of {self.trials}, {seconds:.2f} s, {self.slow_down}× slower"
        scenes = [performance.scene(trial, step, caption) for performance in self.performances]
        return tile([draw(self._first.arm, scene, self.size) for scene in scenes], self._columns)

    @property
    def _columns(self) -> int:
        return math.ceil(len(self.performances) / math.isqrt(len(self.performances)))

    @property
    def _still(self) -> int:
        return round(PAUSE * self.fps)

    @property
    def _first(self) -> TrialRecord:
        return self.performances[0].record
