"""Trials hand by hand: how straight each reach was, and how steadily each hand kept its place.

A *hand* is the dominant or the non-dominant one; its *role* is to "reach", or to "hold" where its goal is its start.
A study of two arms asks which hand does which of both better (Woytowicz, Westlake, Whitall & Sainburg 2018,
doi:10.1152/jn.00878.2017).
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from bilateral_rl.analysis import kinematics
from bilateral_rl.analysis.kinematics import NEAR
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.policies.lesions import INTACT, LESIONS
from bilateral_rl.vocabulary import Side

JUDGED_AT = 0.05
"""Radius of the goal (m) by which the speed to it is told."""
OF_REACHES = (
    "max_deviation_m", "direction_error_rad", "path_ratio", "extent", "reached_2cm", "completion_3cm", "completion_5cm",
    "speed_to_goal_m_per_step",
)  # fmt: skip
"""Columns that mean something for hands that reach."""
OF_HOLDS = ("rms_error_m", "drift_m")
"""Columns that mean something for hands that hold."""
OF_BOTH = ("steps_1cm", "steps_2cm", "steps_5cm", "final_error_m")
"""Columns that mean something for every hand."""
MEASURES = (*OF_REACHES, *OF_BOTH[:3], *OF_HOLDS, OF_BOTH[3])
"""The columns of :func:`hand_table` after ``trial``, ``hand`` and ``role``."""


def hand_table(record: TrialRecord, near: float | None = NEAR) -> pd.DataFrame:
    """Return a row a hand of each trial.

    Args:
        record: the trials, of one arm or two.
        near: how near to the target (m) a hand's reach is over as far as its straightness is judged; None to judge it
            over the whole trial.

    Returns:
        Columns ``trial``, ``hand`` and ``role``; of hands that reach, ``max_deviation_m``, ``direction_error_rad``
        (positive to the left of the straight way in the arm's own frame, in which both arms are alike),
        ``path_ratio``, ``extent`` (how far along the straight way the hand gets, as a share of it: an undershoot looks
        straight), ``reached_2cm``, ``completion_3cm`` and ``completion_5cm`` (0 or 1), ``speed_to_goal_m_per_step`` (of
        completed reaches at 5 cm); of all hands ``steps_1cm``, ``steps_2cm`` and ``steps_5cm`` within the target, and
        ``final_error_m``; of hands that hold ``rms_error_m`` and ``drift_m``. NaN where a measure means nothing.
    """
    hand, target = record.hand, record.target
    within = {centimeters: record.measures(centimeters / 100) for centimeters in (1, 2, 3, 5)}
    values = {
        "max_deviation_m": kinematics.perpendicular_deviation(hand, target, near),
        "direction_error_rad": kinematics.initial_direction(hand, target, near),
        "path_ratio": kinematics.path_length_ratio(hand, target, near),
        "extent": kinematics.extent(hand, target),
        "reached_2cm": within[2].time_in_goal > 0,
        "completion_3cm": within[3].goal_completion,
        "completion_5cm": within[5].goal_completion,
        "speed_to_goal_m_per_step": within[round(100 * JUDGED_AT)].speed_to_goal,
        **{f"steps_{centimeters}cm": within[centimeters].time_in_goal for centimeters in (1, 2, 5)},
        "rms_error_m": kinematics.rms_error(hand, target),
        "drift_m": kinematics.drift(hand),
        "final_error_m": record.distance[:, -1],
    }
    role = record.plan.role
    meant = dict.fromkeys(OF_REACHES, role == "reach") | dict.fromkeys(OF_HOLDS, role == "hold")
    table = pd.DataFrame({"trial": record.plan.trial, "hand": record.plan.hand, "role": role})
    for name in MEASURES:
        table[name] = np.where(meant.get(name, True), np.asarray(values[name], dtype=np.float64), np.nan)
    return table


def contralesional_hand(lesion: str) -> Side | None:
    """Return the hand opposite to the hemisphere that a lesion keeps from the muscles; None where it keeps neither.

    A hemisphere has the name of the hand that it guides, across the body.

    Args:
        lesion: "intact", or the name of a lesion.
    """
    return None if lesion == INTACT else LESIONS[lesion].output_of
