"""What a metric is, and a metric of a goal, which is one for each radius."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from bilateral_rl.analysis.goals import from_centimeters, in_centimeters
from bilateral_rl.analysis.trial_parts import chosen
from bilateral_rl.analysis.trial_records import TrialRecord

Better = Literal["higher", "lower"] | None
IN = "_in_"
"""What stands between the name of a metric and the condition of the trials that it is of."""
_CONDITION_WORDS = {
    "field": "in the field", "null": "without a field", "channel": "in the channel", "no_go": "without a cue",
    "jump": "with a jump", "pulse": "with a pulse",
}  # fmt: skip
"""By the conditions of :data:`~bilateral_rl.analysis.trial_plans.CONDITIONS`."""


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
    """What a task must have for it to mean something: "reach" or "hold", and names of
    :data:`~bilateral_rl.envs.tasks.FEATURES`."""
    better: Better
    """Which values are better; None if neither."""
    definition: str
    """One sentence, with its source."""
    value: Callable[[TrialRecord], float]
    """Computes the value of a seed from all its trials; NaN where no trial has one."""
    condition: str | None = None
    """The condition whose trials alone count; None for all."""

    def within(self, condition: str) -> Metric:
        """Return the same metric of the trials in a condition alone: ``final_error_in_null``."""

        def value(record: TrialRecord) -> float:
            rows = record.plan.has(condition)
            return self.value(chosen(record, rows)) if rows.any() else float("nan")

        label = f"{self.label}, {_CONDITION_WORDS[condition]}"
        definition = f"{self.definition} Of the trials {_CONDITION_WORDS[condition]} alone."
        name = f"{self.name}{IN}{condition}"
        return dataclasses.replace(
            self, name=name, label=label, definition=definition, value=value, condition=condition
        )


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
