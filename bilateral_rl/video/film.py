"""What a video shows: the same trials by one or several networks, picture by picture."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.envs.arm_drawing import ArmScene, CueScene
from bilateral_rl.envs.canvas import tile
from bilateral_rl.envs.force_drawing import HandForceScene
from bilateral_rl.envs.forces import AffineForces, affine_forces
from bilateral_rl.envs.measures import trial_measures
from bilateral_rl.envs.rendering import Scene, draw, picture_size
from bilateral_rl.envs.spring_drawing import SpringScene
from bilateral_rl.envs.tasks import NEVER

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
        n = self.record.n_arms
        rows = range(n * trial, n * (trial + 1))
        words = [self.label, caption]
        if n == 1:
            words = [self.label, f"{caption}{self._condition(trial)}", self.goal(trial, step)]
        distance = self.record.shoulder_distance or 0.0
        arms = tuple(self._arm(row, step) for row in rows)
        return Scene(arms, self.radius, "\n".join(words), distance, self._spring(rows[0], step))

    def _arm(self, row: int, step: int) -> ArmScene:
        record = self.record
        rest = np.full(record.activation.shape[-1], record.arm.min_activation)
        has_role = record.n_arms > 1
        return ArmScene(
            angles=record.joint[row, step],
            activation=record.activation[row, step - 1] if step else rest,
            target=record.seen_target[row, min(step, record.seen_target.shape[1] - 1)],
            path=record.hand[row, : step + 1],
            load=record.load[row],
            forces=self._forces(row, step),
            cue=self._cue(row, step),
            role=record.plan.role[row] if has_role else None,
            words=f"{self.goal(row, step)}{self._condition(row)}" if has_role else "",
        )

    def _spring(self, row: int, step: int) -> SpringScene | None:
        """Return the spring on the dominant hand, which is in a ``row``, and the other one, if there is one."""
        force = self.record.spring_force
        if force is None or not force[row].any():
            return None
        start = self.record.body_positions(self.record.hand)[row : row + 2, 0]
        return SpringScene(float(np.linalg.norm(start[1] - start[0])), force[row, step])

    def goal(self, row: int, step: int) -> str:
        """Say how a trial of one arm, or a hand of one of two, stands after ``step`` steps.

        By the measures of ``evaluate`` (paper section 3).
        """
        onset, start = self._onset(row, step)
        distance = self.record.distance[row, onset:]
        steps = step - onset
        so_far = trial_measures(distance[None, : max(steps, 1)], np.array([start]), self.radius)
        if start <= self.radius:
            return f"in the goal {so_far.time_in_goal[0] if steps else 0} of {steps} steps"
        if steps and so_far.goal_completion[0]:
            return "goal reached"
        return "goal not reached" if steps == len(distance) else "goal not reached yet"

    def _onset(self, row: int, step: int) -> tuple[int, float]:
        """Return the step at which the target began that is seen after ``step`` steps, and its distance then (m)."""
        record, plan = self.record, self.record.plan
        began = max((int(at) for at in (plan.go[row], plan.jump[row]) if at <= step), default=0)
        if began == plan.onset[row]:
            return began, float(record.start_distance[row])
        return began, float(np.linalg.norm(record.hand[row, began] - record.seen_target[row, began]))

    def _condition(self, row: int) -> str:
        """Say what sets a trial apart, where trials are not all plain."""
        conditions = self.record.plan.condition
        if conditions[row] != "null":
            return f", {conditions[row].replace('no_go', 'no cue').replace('+', ' + ')}"
        others = {part for joined in set(conditions.tolist()) for part in joined.split("+")}
        missing = [part for part in ("field", "jump", "pulse") if part in others]
        return f", no {' or '.join(missing)}" if missing else ""

    def _forces(self, row: int, step: int) -> HandForceScene | None:
        record, forces = self.record, self._affine
        if forces is None:
            return None
        force = record.force[row, step - 1] - record.load[row] if step else np.zeros(2, np.float32)
        if step and record.spring_force is not None:
            force = force - record.spring_force[row, step - 1]
        return HandForceScene(force, *(values[row] for values in forces))

    def _cue(self, row: int, step: int) -> CueScene | None:
        plan = self.record.plan
        if not self._has_cues:
            return None
        return CueScene.at(step, int(plan.go[row]), int(plan.jump[row]), plan.goal[row])

    @property
    def has_extras(self) -> bool:
        """Whether cues or forces are drawn."""
        return self._has_cues or self._affine is not None

    @cached_property
    def _has_cues(self) -> bool:
        plan = self.record.plan
        return bool((plan.go > 0).any() or (plan.jump < NEVER).any())

    @cached_property
    def _affine(self) -> AffineForces | None:
        plan = self.record.plan
        return None if plan.forces is None else affine_forces(plan.forces, self.record.hand[:, 0], plan.goal)


@dataclass(frozen=True)
class Film:
    """Trials one after another, with a pause after each, and the networks side by side.

    Args:
        performances: the same trials by each network, at least as many as are shown.
        slow_down: seconds of video for a second of the arm's time.
        size: height of a network's picture, and the width of one of one arm (pixels).
        trials: how many trials are shown, the first ones.
    """

    performances: Sequence[Performance]
    slow_down: int
    size: int
    trials: int

    @property
    def fps(self) -> float:
        """Pictures a second; there is one for every step."""
        return 1 / (self.slow_down * self._first.arm.timestep)

    @property
    def steps(self) -> int:
        """Steps of a trial."""
        return len(self._first.distance[0])

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of a picture (pixels): rows of networks, never more rows than columns."""
        first = self._first
        width, height = picture_size(first.arm, first.n_arms, first.shoulder_distance or 0.0, self.size)
        return height * math.ceil(len(self.performances) / self._columns), width * self._columns

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

    def colorful(self) -> Picture:
        """Draw the first trial such that all colors are in it: its end, and before it cues and forces if there are."""
        if not self.performances[0].has_extras:
            return self.picture(0, self.steps)
        strongest = 1 + int(np.linalg.norm(self._first.force[0], axis=1).argmax())
        return tile([self.picture(0, step) for step in (0, strongest, self.steps)])

    @property
    def _columns(self) -> int:
        return math.ceil(len(self.performances) / math.isqrt(len(self.performances)))

    @property
    def _still(self) -> int:
        return round(PAUSE * self.fps)

    @property
    def _first(self) -> TrialRecord:
        return self.performances[0].record
