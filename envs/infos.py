"""What the environments' infos say of a trial, for every face alike."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.measures import TrialMeasures, trial_measures

if TYPE_CHECKING:
    from bilateral_rl.envs.task import Trials
    from bilateral_rl.envs.trials import TrialBatch

_MEASURES = ("speed_to_goal", "time_in_goal", "final_error")


def hands_that_hold(trials: Trials) -> NDArray[np.bool_]:
    """Return (…, 2 arms), whether each hand of trials of two arms is to hold: its goal is the posture it starts in."""
    start, goal = (np.asarray(angles, dtype=np.float32) for angles in trials[:2])
    # NumPy is slow where it reduces a short axis.
    return np.asarray((start[..., 0] == goal[..., 0]) & (start[..., 1] == goal[..., 1]))


def final_infos(
    batch: TrialBatch, arms: NDArray[np.int32], holds: NDArray[np.bool_] | None = None
) -> list[dict[str, Any]]:
    """Return what infos say at the end of the trials of ``arms``, one dictionary a trial.

    A hand that reaches succeeds by completing its goal, one that holds by being in it at the end. Of two arms each
    measure is (2,), the dominant hand's first, and a success is that of both; so is ``holds`` (k, 2), which of the
    hands were to hold.
    """
    hands = batch.hands(arms)
    onset = batch.onset[hands] if batch.task.has_timeline else None
    measures = trial_measures(batch.distance[hands], batch.start_distance[hands], batch.settings.threshold, onset)
    succeeds = _succeeds(batch, hands, measures)
    columns: dict[str, list[Any]] = {"vector_return": list(batch.vector_return[arms])}
    if batch.n_arms == 1:
        columns["is_success"] = succeeds.tolist()
        columns |= {name: getattr(measures, name).tolist() for name in _MEASURES}
    else:
        columns["is_success"] = (succeeds[::2] & succeeds[1::2]).tolist()
        of_hands = ("goal_completion", *_MEASURES)
        columns |= {name: list(getattr(measures, name).reshape(-1, 2)) for name in of_hands}
    if holds is not None:
        columns["holds"] = list(holds)
    return [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]


def _succeeds(batch: TrialBatch, hands: NDArray[np.int32], measures: TrialMeasures) -> NDArray[np.bool_]:
    if batch.task.has_timeline:
        return measures.goal_completion
    # It starts in its goal, which any three first steps would complete.
    holds = batch.start_distance[hands] == 0
    return np.where(holds, measures.final_error <= batch.settings.threshold, measures.goal_completion)
