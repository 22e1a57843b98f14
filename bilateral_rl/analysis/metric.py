"""What a metric is, and a metric of a goal, which is one for each radius."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Container
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from bilateral_rl.analysis.goals import from_centimeters, in_centimeters
from bilateral_rl.analysis.trial_parts import chosen
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.vocabulary import SIDES, Side

Better = Literal["higher", "lower"] | None
IN = "_in_"
"""What stands between the name of a metric and the condition of the trials that it is of."""
OF = "_of_"
"""What stands between the name of a metric and the hand that it is of, perhaps with its role."""
_CONDITION_WORDS = {
    "field": "in the field", "null": "without a field", "channel": "in the channel", "no_go": "without a cue",
    "jump": "with a jump", "pulse": "with a pulse",
}  # fmt: skip
"""By the conditions of :data:`~bilateral_rl.analysis.trial_plans.CONDITIONS`."""


Role = Literal["reach", "hold"]
ROLES: tuple[Role, Role] = ("reach", "hold")
"""What a hand does: "hold" where its goal is where it starts."""
_ROLE_WORDS: dict[Role, str] = {"reach": "that reaches", "hold": "that holds"}


class Part(NamedTuple):
    """Which trials, and which hands in them, a metric is of."""

    condition: str | None = None
    """The condition of the trials; None for any."""
    hand: Side | None = None
    """Whose hand; None for either."""
    role: Role | None = None
    """What the hand does; None for anything. Trials of one arm are not told apart by it: all have the same."""

    def of(self, record: TrialRecord) -> TrialRecord | None:
        """Return these trials of a record; None where there are none."""
        plan, rows = record.plan, np.ones(len(record.target), dtype=np.bool_)
        if self.condition is not None:
            rows &= plan.has(self.condition)
        if self.hand is not None:
            rows &= plan.hand == self.hand
        if self.role is not None and record.n_arms > 1:
            rows &= plan.role == self.role
        if rows.all():
            return record
        return chosen(record, rows) if rows.any() else None


@dataclass(frozen=True)
class Metric:
    """One number that sums up the trials of one seed."""

    name: str
    """What tables and commands call it."""
    label: str
    """Words for axes and reports, without the unit."""
    unit: str
    """Unit of the value; empty for a pure number."""
    needs: tuple[str, ...]
    """What a task must have for it to mean something: "reach" or "hold", names of
    :data:`~bilateral_rl.envs.tasks.FEATURES`, and "two_arms"."""
    better: Better
    """Which values are better; None if neither."""
    definition: str
    """One sentence, with its source."""
    compute: Callable[[TrialRecord], float]
    """Computes the value of a seed from all the trials that count; NaN where none has one."""
    condition: str | None = None
    """The condition whose trials alone count; None for all."""
    hand: Side | None = None
    """The hand that alone counts in trials of two arms; None for both."""
    role: Role | None = None
    """The role in which alone it counts; None for every role that the metric needs."""

    @property
    def part(self) -> Part:
        """The trials, and the hands in them, that count."""
        needed = next((role for role in ROLES if role in self.needs), None)
        return Part(self.condition, self.hand, self.role or needed)

    def value(self, record: TrialRecord) -> float:
        """Return the value of a seed from all its trials; NaN where no trial has one."""
        return self.value_in(self.part.of(record))

    def value_in(self, part: TrialRecord | None) -> float:
        """Return the value of a seed from the trials that count, which :class:`Part` picks."""
        return float("nan") if part is None else self.compute(part)

    def within(self, condition: str) -> Metric:
        """Return the same metric of the trials in a condition alone: ``final_error_in_null``."""
        return dataclasses.replace(
            self,
            name=f"{self.name}{IN}{condition}",
            label=f"{self.label}, {_CONDITION_WORDS[condition]}",
            definition=f"{self.definition} Of the trials {_CONDITION_WORDS[condition]} alone.",
            condition=condition,
        )

    def of(self, hand: Side, role: Role | None = None) -> Metric:
        """Return the same metric of one hand alone, perhaps in one role: ``final_error_of_dominant_hold``."""
        words = f"{hand.replace('_', '-')} hand" + (f" {_ROLE_WORDS[role]}" if role else "")
        return dataclasses.replace(
            self,
            name=f"{self.name}{OF}{hand}" + (f"_{role}" if role else ""),
            label=f"{self.label}, {words}",
            definition=f"{self.definition} Of the {words} alone.",
            hand=hand,
            role=role,
        )


def of_hands(metric: Metric, measured: Container[str]) -> dict[Role | None, dict[Side, Metric]]:
    """Return the same metric of each hand, by role, or of both in one under None: those that were measured.

    Args:
        metric: of both hands.
        measured: names of metrics; those of one arm bring nothing.
    """
    by_role = {role: {hand: metric.of(hand, role) for hand in SIDES} for role in (None, *ROLES)}
    return {
        role: hands for role, hands in by_role.items() if all(of_hand.name in measured for of_hand in hands.values())
    }


@dataclass(frozen=True)
class GoalMetric:
    """A number a trial at a goal, averaged: a metric at each radius of the goal."""

    start: str
    """Beginning of its names, which end with the radius."""
    label: str
    unit: str
    scale: float
    needs: tuple[str, ...]
    definition: str
    of_trials: Callable[[TrialRecord, float], ArrayLike]
    """Returns the number of each trial, (n,), at a radius (m)."""
    better: Better = "higher"

    def at(self, radius: float) -> Metric:
        """Return the metric at a goal of ``radius`` (m), as exact as its name says it."""
        centimeters = in_centimeters(radius)
        named_radius = from_centimeters(centimeters)

        def value(record: TrialRecord) -> float:
            return mean(self.of_trials(record, named_radius), self.scale)

        name, label = f"{self.start}_{centimeters}cm", f"{self.label} {centimeters} cm"
        return Metric(name, label, self.unit, self.needs, self.better, self.definition, value)


def mean(values: ArrayLike, scale: float = 1.0) -> float:
    """``scale`` times the mean of the values that are not NaN; NaN where all are."""
    numbers = np.asarray(values, dtype=np.float64)
    numbers = numbers[~np.isnan(numbers)]
    return scale * float(numbers.mean()) if len(numbers) else float("nan")
