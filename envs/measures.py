"""What a trial achieved: the paper's three measures and the final error (paper section 3)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bilateral_rl.envs.doors import numbers
from bilateral_rl.envs.refusals import shown

STEPS_TO_COMPLETE = 3
"""Consecutive steps within the threshold that complete a reach."""


class TrialMeasures(NamedTuple):
    """Measures of ``n`` trials, from the onset of the last target on: the first step, unless a timeline changes it."""

    goal_completion: NDArray[np.bool_]
    """(n,): whether the hand came within the threshold and stayed for three consecutive steps; in a trial without a
    cue, whether it never left the threshold. Of a hand that starts in its goal it says nothing: its first three steps
    complete it."""
    speed_to_goal: NDArray[np.float64]
    """(n,): distance to the target at the onset (m) over the steps from there until the goal was reached, the first of
    those three steps counted; NaN where it never was, and where there is no such distance, as in a hold."""
    time_in_goal: NDArray[np.int64]
    """(n,): steps within the threshold; none in a trial without a cue."""
    final_error: NDArray[np.float64]
    """(n,): distance to the target after the last step (m)."""
    speed_to_third_step: NDArray[np.float64]
    """(n,): as ``speed_to_goal``, but over the steps until the third of the three (m/step)."""
    time_to_goal: NDArray[np.float64]
    """(n,): steps until the goal was reached, the first of the three counted; all from the onset on where it never was,
    or no cue came."""

    def means(self) -> dict[str, float]:
        """Return the means over the trials in the units that people read: percent, cm, steps.

        The speed is the mean over the trials that have one, NaN if none does.
        """
        reached = self.speed_to_goal[~np.isnan(self.speed_to_goal)]
        return {
            "goal_completion_percent": 100 * float(self.goal_completion.mean()),
            "speed_to_goal_cm_per_step": 100 * float(reached.mean()) if len(reached) else float("nan"),
            "time_in_goal_steps": float(self.time_in_goal.mean()),
            "final_error_cm": 100 * float(self.final_error.mean()),
        }


def trial_measures(
    distance: ArrayLike, start_distance: ArrayLike, threshold: float, onset: ArrayLike | None = None
) -> TrialMeasures:
    """Return the measures of ``n`` trials of ``T`` steps.

    Args:
        distance: (n, T), hand to target after each step (m).
        start_distance: (n,), hand to target at the onset (m).
        threshold: radius of the goal (m).
        onset: (n,), step at which the last target began; T where no cue came. None: the start.

    Raises:
        TypeError: no numbers.
        ValueError: other shapes, no step, or an onset outside the trial.
    """
    distance, start_distance = (
        numbers(name, values).astype(np.float64)
        for name, values in (("distance", distance), ("start_distance", start_distance))
    )
    if distance.ndim != 2 or not distance.shape[1] or start_distance.shape != distance.shape[:1]:
        raise ValueError(
            "distance must have shape (n, T), with a step at least, and start_distance (n,), got "
            f"{distance.shape} and {start_distance.shape}."
        )
    inside, length = distance <= threshold, distance.shape[1]
    begun = np.zeros(len(distance), dtype=np.int64) if onset is None else _checked_onset(onset, distance)
    counted = inside if onset is None else inside & (np.arange(length) >= begun[:, None])
    stays = _runs_start(counted, STEPS_TO_COMPLETE)
    reached = np.asarray(stays.any(axis=1))
    first = stays.argmax(axis=1) if stays.shape[1] else np.zeros(len(distance), dtype=np.int64)
    steps = np.where(reached, first + 1 - begun, np.nan)
    distance_to_go = np.where(start_distance > 0, start_distance, np.nan)
    return TrialMeasures(
        goal_completion=np.where(begun < length, reached, inside.all(axis=1)),
        speed_to_goal=distance_to_go / steps,
        time_in_goal=counted.sum(axis=1),
        final_error=distance[:, -1],
        speed_to_third_step=distance_to_go / (steps + STEPS_TO_COMPLETE - 1),
        time_to_goal=np.where(reached, steps, length - begun),
    )


def _checked_onset(onset: ArrayLike, distance: NDArray[np.float64]) -> NDArray[np.int64]:
    steps, (n, length) = numbers("onset", onset), distance.shape
    if steps.dtype.kind not in "iu":
        raise TypeError(f"onset must consist of whole numbers of steps, got {steps.dtype}.")
    if steps.shape != (n,) or (steps > length).any() or (steps < 0).any():
        raise ValueError(f"onset must be {n} steps from 0 to {length}, got {shown(steps)}.")
    return steps.astype(np.int64)


def _runs_start(inside: NDArray[np.bool_], length: int) -> NDArray[np.bool_]:
    """Return (n, T - length + 1) bool: whether ``length`` consecutive steps inside start at each step."""
    n_starts = max(inside.shape[1] - length + 1, 0)
    starts = np.ones((len(inside), n_starts), dtype=np.bool_)
    for offset in range(length):
        starts &= inside[:, offset : offset + n_starts]
    return starts
