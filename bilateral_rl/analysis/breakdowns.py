"""Trials taken apart: what is measured by target, condition, hand and role, and before and after the cue."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from bilateral_rl.analysis.kinematics import hand_speed
from bilateral_rl.analysis.metric import ROLES, Metric, Role, mean
from bilateral_rl.analysis.metrics import measure
from bilateral_rl.analysis.trial_parts import chosen
from bilateral_rl.analysis.trial_plans import CONDITIONS, NULL_FIELD
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.io.errors import UserError
from bilateral_rl.vocabulary import SIDES

BREAKDOWNS = ("target", "condition", "phase", "hand", "role", "hand,role")
"""What trials can be taken apart by; by hand and role, those of two arms."""


def breakdown(record: TrialRecord, by: str, metrics: Sequence[Metric]) -> pd.DataFrame:
    """Return a row for each target, condition, phase, hand, or role, or each hand in each role.

    Args:
        record: the trials.
        by: what they are taken apart by.
        metrics: the columns, by name; phases have their own.

    Returns:
        Columns ``target`` (its index), of two arms ``hand``, and ``target_angle_deg`` (in the frame of the body), or
        ``condition``, or ``phase``, or ``hand`` and ``role``; ``trials``, how many, of two arms how many hands; and the
        measures.

    Raises:
        UserError: anything else, trials whose targets are no list, or hands of one arm.
    """
    check_breakdown(by)
    if by == "phase":
        return pd.DataFrame(list(_phases(record)))
    groups = {"target": _targets, "condition": _conditions}.get(by, partial(_hands, by.split(",")))(record)
    rows = [labels | {"trials": int(rows.sum())} | measure(chosen(record, rows), metrics) for labels, rows in groups]
    return pd.DataFrame(rows)


def check_breakdown(by: str) -> None:
    """Raise a UserError unless trials can be taken apart by this."""
    if by not in BREAKDOWNS:
        raise UserError(
            f"--by must be one of {', '.join(BREAKDOWNS[:-1])}, or '{BREAKDOWNS[-1]}' for both, got {by!r}."
        )


def _targets(record: TrialRecord) -> Iterator[tuple[dict[str, object], NDArray[np.bool_]]]:
    """Of two arms hand by hand: what one does in exchange for the other is mirrored."""
    index, way = record.plan.target_index, (record.plan.goal - record.plan.start).astype(np.float64)
    if (index < 0).all():
        raise UserError(
            "The targets of this task are no list, so that nothing can be told by target: leave --by target out."
        )
    for number, hand in itertools.product(np.unique(index[index >= 0]), SIDES[: record.n_arms]):
        rows = (index == number) & (record.plan.hand == hand)
        if rows.any():
            x, y = way[rows].mean(axis=0) * (1 if hand == SIDES[0] else -1, 1)  # in the frame of the body
            whose = {"hand": hand} if record.n_arms > 1 else {}
            angle = float(np.degrees(np.arctan2(y, x)) % 360)
            yield {"target": int(number)} | whose | {"target_angle_deg": angle}, rows


def _conditions(record: TrialRecord) -> Iterator[tuple[dict[str, object], NDArray[np.bool_]]]:
    def order(condition: str) -> list[int]:
        return [CONDITIONS.index(part) for part in condition.split("+")]

    for condition in sorted(set(record.plan.condition.tolist()), key=order):
        yield {"condition": NULL_FIELD if condition == "null" else condition}, record.plan.condition == condition


def _hands(labels: Sequence[str], record: TrialRecord) -> Iterator[tuple[dict[str, object], NDArray[np.bool_]]]:
    if record.n_arms == 1:
        raise UserError(f"--by {','.join(labels)} tells two hands apart, and this task is of one arm: leave it out.")
    values = {"hand": (record.plan.hand, SIDES), "role": (record.plan.role, ROLES)}
    for words in itertools.product(*(values[label][1] for label in labels)):
        of_words = [values[label][0] == word for label, word in zip(labels, words, strict=True)]
        rows = np.logical_and.reduce(of_words)
        if rows.any():
            yield dict(zip(labels, words, strict=True)), rows


def _phases(record: TrialRecord) -> Iterator[dict[str, object]]:
    """Before the cue a hold; from the cue on a reach, or a hold that goes on where the target is the start."""
    after = np.arange(record.distance.shape[1]) >= record.plan.go[:, None]
    for phase, steps in (("hold", ~after), *_after_the_cue(record, after)):
        if steps.any():
            yield {"phase": phase, "trials": int(steps.any(axis=1).sum()), **_of_phase(record, steps)}


def _after_the_cue(record: TrialRecord, steps: NDArray[np.bool_]) -> Iterator[tuple[Role, NDArray[np.bool_]]]:
    """Yield what hands do in the steps (n, T) after the cue; where one arm reaches in any trial, that is a reach."""
    role = record.plan.role
    if record.n_arms == 1:
        role = np.full(len(role), "hold" if (role == "hold").all() else "reach")
    return ((name, steps & (role == name)[:, None]) for name in ROLES)


def _of_phase(record: TrialRecord, steps: NDArray[np.bool_]) -> dict[str, float]:
    """Means over the trials of what is measured in some of their steps (n, T)."""
    speed = hand_speed(record.hand, record.arm.timestep)
    effort = (record.excitation.astype(np.float64) ** 2).sum(axis=2)
    force = np.linalg.norm(record.force.astype(np.float64), axis=2)
    return {
        "error_cm": mean(_over(record.distance.astype(np.float64), steps), 100),
        "speed_cm_per_s": mean(_over(speed, steps), 100),
        "peak_speed_cm_per_s": mean(np.where(steps.any(axis=1), np.where(steps, speed, 0.0).max(axis=1), np.nan), 100),
        "effort_per_s": mean(_over(effort, steps)),
        "force_N": mean(_over(force, steps)),
    }


def _over(values: NDArray[np.float64], steps: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(n,): means of (n, T) values over some of the steps; NaN where there are none."""
    number = steps.sum(axis=1)
    total = np.where(steps, values, 0.0).sum(axis=1)
    return np.asarray(np.divide(total, number, out=np.full(len(total), np.nan), where=number > 0))
