"""Some of a record's trials, and what lies in them from a cue or a jump on."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bilateral_rl.analysis.trial_plans import TrialPlan
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.envs.tasks import HandForces

_PER_STEP = ("seen_target", "force", "field_force", "distance", "observation", "excitation", "activation")
_PER_MOMENT = ("joint", "hand", "spring_force")


def chosen(record: TrialRecord, rows: NDArray[np.bool_]) -> TrialRecord:
    """Return the trials of a record for which ``rows`` (n,) is true."""
    plan = dataclasses.replace(record.plan, **_of_rows(record.plan, rows))
    if plan.forces is not None:
        plan = dataclasses.replace(plan, forces=HandForces._make(values[rows] for values in plan.forces))
    return dataclasses.replace(record, **_of_rows(record, rows), plan=plan)


def cued(record: TrialRecord) -> TrialRecord:
    """Return the trials that have something to reach for: not those in which no cue comes."""
    comes = record.plan.onset < record.distance.shape[1]
    return record if comes.all() else chosen(record, comes)


def since(record: TrialRecord, step: int) -> TrialRecord:
    """Return the same trials from the beginning of ``step`` on, as if they started there; the plan stays."""
    values = {name: getattr(record, name) for name in (*_PER_STEP, *_PER_MOMENT)}
    later = {name: array[:, step:] for name, array in values.items() if array is not None}
    return dataclasses.replace(record, **later)


def over_reaches(record: TrialRecord, measure: Callable[[TrialRecord], ArrayLike]) -> NDArray[np.float64]:
    """Measure each trial from its onset on, the cue or the jump; NaN where no cue comes.

    Args:
        record: n trials.
        measure: from trials that all begin at their onset to a number each.

    Returns:
        (n,).
    """
    onset, length = record.plan.onset, record.distance.shape[1]
    if not onset.any():
        return np.asarray(measure(record), dtype=np.float64)
    values = np.full(len(onset), np.nan)
    for step in np.unique(onset[onset < length]):
        rows = onset == step
        values[rows] = measure(since(chosen(record, rows), int(step)))
    return values


def _of_rows(record: TrialRecord | TrialPlan, rows: NDArray[np.bool_]) -> dict[str, Any]:
    values = {field.name: getattr(record, field.name) for field in dataclasses.fields(record)}
    return {name: value[rows] for name, value in values.items() if isinstance(value, np.ndarray)}
