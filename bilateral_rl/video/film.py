"""What a video shows: the same trials by one or several controllers, picture by picture."""

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
"""How long the end of a trial stands still (s of video)."""

Picture = NDArray[np.uint8]


@dataclass(frozen=True)
class Take:
    """The trials of one controller."""

    label: str
    """Who is acting."""
    record: TrialRecord
    threshold: float
    """Radius of the goal (m)."""

    def scene(self, trial: int, step: int, caption: str) -> Scene:
        """What there is to see after ``step`` steps of a trial; before the first, muscles are at rest."""
        record = self.record
        rest = np.full(record.activation.shape[-1], record.arm.min_activation)
        return Scene(
            angles=record.joint[trial, step],
            activation=record.activation[trial, step - 1] if step else rest,
            target=record.target[trial],
            path=record.hand[trial, : step + 1],
            threshold=self.threshold,
            load=record.load[trial],
            caption=f"{self.label}\n{caption}\n{self.goal(trial, step)}",
        )

    def goal(self, trial: int, step: int) -> str:
        """How the trial stands after ``step`` steps, by the measures of ``evaluate`` (paper section 3)."""
        distance, start = self.record.distance[trial], self.record.start_distance[trial]
        so_far = trial_measures(distance[None, : max(step, 1)], start[None], self.threshold)
        if start <= self.threshold:
            return f"in the goal {so_far.time_in_goal[0] if step else 0} of {step} steps"
        if step and so_far.goal_completion[0]:
            return "goal reached"
        return "goal not reached" if step == len(distance) else "goal not reached yet"


@dataclass(frozen=True)
class Film:
    """Trials one after another, with a pause after each; the controllers side by side.

    Args:
        takes: the same trials by each controller.
        slow_down: seconds of video for a second of the arm's time.
        size: side of a controller's picture (pixels).
    """

    takes: Sequence[Take]
    slow_down: int
    size: int

    @property
    def fps(self) -> float:
        """Pictures a second: one for every step."""
        return 1 / (self.slow_down * self._first.arm.timestep)

    @property
    def steps(self) -> int:
        """Of a trial."""
        return len(self._first.distance[0])

    @property
    def trials(self) -> int:
        """How many trials each controller does."""
        return len(self._first.target)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of a picture: rows of controllers, never more rows than columns."""
        return self.size * math.ceil(len(self.takes) / self._columns), self.size * self._columns

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
        """All controllers after ``step`` steps of a trial, (h, w, 3) RGB."""
        seconds = step * self._first.arm.timestep
        caption = f"trial {trial + 1} of {self.trials}, {seconds:.2f} s, {self.slow_down}× slower"
        scenes = [take.scene(trial, step, caption) for take in self.takes]
        return tile([draw(self._first.arm, scene, self.size) for scene in scenes], self._columns)

    @property
    def _columns(self) -> int:
        return math.ceil(len(self.takes) / math.isqrt(len(self.takes)))

    @property
    def _still(self) -> int:
        return round(PAUSE * self.fps)

    @property
    def _first(self) -> TrialRecord:
        return self.takes[0].record
