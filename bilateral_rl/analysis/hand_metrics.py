"""What is told of each hand of two arms in each role, as data: a seed's means over its trials, by hand and role.

In long tables of results (:mod:`bilateral_rl.analysis.results`) their names say role, measure and hand, as
``reach_max_deviation_until_2cm_dominant``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import pandas as pd

from bilateral_rl.analysis.hands import hand_means, hand_table
from bilateral_rl.analysis.kinematics import NEAR
from bilateral_rl.analysis.metric import Better, Metric
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.vocabulary import SIDES, Side

Role = Literal["reach", "hold"]
ROLES: tuple[Role, Role] = ("reach", "hold")
COMBINED_LOSS = "combined_loss"
"""Name of the mean over trials and steps of half of the dominant and half of the non-dominant loss, of both arms."""


@dataclass(frozen=True)
class HandMetric:
    """One number that sums up what a hand does in a role."""

    name: str
    """The measure, without role and hand."""
    label: str
    unit: str
    roles: tuple[Role, ...]
    """The roles in which it means something."""
    better: Better
    definition: str
    column: str
    """Its column in :func:`~bilateral_rl.analysis.hands.hand_table`."""
    scale: float = 1.0
    """What a value there is multiplied by."""
    whole: bool = True
    """Whether a reach is judged over its whole trial, or until the hand first comes within 2 cm of the target."""

    def of(self, hand: Side, role: Role) -> Metric:
        """Return the metric of one hand in one role."""
        words = {"reach": "reaches", "hold": "holds"}[role]
        label = f"{self.label}, {hand.replace('_', '-')} hand, {words}"
        name = f"{role}_{self.name}_{hand}"

        def value(record: TrialRecord) -> float:
            return measure_hands(record)[name]

        return Metric(name, label, self.unit, (), self.better, self.definition, value)


_REACH: tuple[Role, ...] = ("reach",)
_HOLD: tuple[Role, ...] = ("hold",)
_ON_ITS_WAY = "until the hand first comes within 2 cm of the target"
_PERPENDICULAR = (
    "Largest distance of the hand from the line through start and target "
    "(Atkeson & Hollerbach 1985, doi:10.1523/JNEUROSCI.05-09-02318.1985)"
)
_DIRECTION = (
    "Angle between the directions from the start to the target and to the hand at peak speed "
    "(Krakauer et al. 2000, doi:10.1523/JNEUROSCI.20-23-08916.2000)"
)
_PATH = (
    "Length of the hand's path over the straight distance that it had to go; 1 is straight "
    "(Coderre et al. 2010, doi:10.1177/1545968309356091)"
)


def _straightness(name: str, label: str, unit: str, definition: str, column: str, scale: float) -> Iterator[HandMetric]:
    """The measure until the hand is near the target, which tells the way from its end, and of the whole trial."""
    way, trial = f"{definition}, {_ON_ITS_WAY}.", f"{definition}, over the whole trial."
    yield HandMetric(f"{name}_until_2cm", label, unit, _REACH, "lower", way, column, scale, whole=False)
    yield HandMetric(name, f"{label}, whole trial", unit, _REACH, "lower", trial, column, scale)


# fmt: off
HAND_METRICS: dict[str, HandMetric] = {metric.name: metric for metric in (
    *_straightness("max_deviation", "Maximal perpendicular deviation", "cm", _PERPENDICULAR, "max_deviation_m", 100),
    *_straightness("direction_error", "Initial direction error", "deg", _DIRECTION, "direction_error_rad",
                   math.degrees(1)),
    *_straightness("path_ratio", "Path length ratio", "", _PATH, "path_ratio", 1),
    HandMetric("extent", "Extent of the reach", "%", _REACH, None,
               "How far along the line from start to target the hand gets; less than 100 is an undershoot, which looks "
               "straight.", "extent", 100),
    HandMetric("completion_3cm", "Goal completion within 3 cm", "%", _REACH, "higher",
               "Share of reaches whose hand comes within 3 cm of the target and stays for three consecutive steps.",
               "completion_3cm", 100),
    HandMetric("completion_5cm", "Goal completion within 5 cm", "%", _REACH, "higher",
               "The same within 5 cm.", "completion_5cm", 100),
    HandMetric("speed_to_goal", "Speed to goal of 5 cm", "cm/step", _REACH, "higher",
               "Distance from start to target over the steps until the goal of 5 cm is reached, in the reaches that "
               "complete it.", "speed_to_goal_m_per_step", 100),
    HandMetric("rms_error", "RMS error in hold", "cm", _HOLD, "lower",
               "Root mean squared distance from the hand to where it is to stay, over all steps.", "rms_error_m", 100),
    HandMetric("drift", "Drift in hold", "cm", _HOLD, "lower",
               "Distance between the hand's mean positions in the first and in the last fifth of the trial.",
               "drift_m", 100),
    *(HandMetric(f"steps_{radius}cm", f"Time within {radius} cm", "steps", ROLES, "higher",
                 f"Steps after which the hand is within {radius} cm of its target.", f"steps_{radius}cm")
      for radius in (1, 2, 5)),
    HandMetric("final_error", "Final error", "cm", ROLES, "lower",
               "Distance from the hand to its target after the last step.", "final_error_m", 100),
)}
# fmt: on
"""By their names."""


def hand_metric(name: str, hand: Side, role: Role) -> Metric:
    """Return the metric of a measure of :data:`HAND_METRICS` of one hand in one role."""
    return HAND_METRICS[name].of(hand, role)


def hand_metric_names() -> list[str]:
    """Return every name that :func:`measure_hands` may give a number."""
    of_hands = (metric.of(hand, role) for metric in HAND_METRICS.values() for role in metric.roles for hand in SIDES)
    return [COMBINED_LOSS, *(metric.name for metric in of_hands)]


def measure_hands(record: TrialRecord) -> dict[str, float]:
    """Return every number by its name: the combined loss, and each measure of each hand in each role that it has.

    A number is the mean over a hand's trials in that role, those left out in which it has no meaning.

    Args:
        record: trials of two arms.
    """
    tables = {whole: _sizes(hand_table(record, None if whole else NEAR)) for whole in (False, True)}
    means = {whole: hand_means(table) for whole, table in tables.items()}
    values = {COMBINED_LOSS: combined_loss(record)}
    for hand, role in means[True].index:
        for metric in (one for one in HAND_METRICS.values() if role in one.roles):
            column = means[metric.whole][metric.column]
            values[metric.of(hand, role).name] = metric.scale * float(column[hand, role])
    return values


def _sizes(table: pd.DataFrame) -> pd.DataFrame:
    """The same with errors of direction that do not cancel each other: to the left and to the right count alike."""
    return table.assign(direction_error_rad=table["direction_error_rad"].abs())


def combined_loss(record: TrialRecord) -> float:
    """Return the mean over trials and steps of half of the dominant and half of the non-dominant loss."""
    return float(-record.vector_return.mean(dtype="float64") / record.distance.shape[1])
