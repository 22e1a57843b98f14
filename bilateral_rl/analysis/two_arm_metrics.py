"""The metrics by which the hands of two arms are told apart, as data: how straight and how far they go, how they drift.

What a hand does about its target is no part of how straight it went there, so reaches are judged until the hand first
comes within 2 cm of it; an undershoot looks straight, so its extent stands beside. Woytowicz, Westlake, Whitall &
Sainburg 2018 (doi:10.1152/jn.00878.2017) tell the hands apart so.
"""

from __future__ import annotations

import numpy as np

from bilateral_rl.analysis import kinematics
from bilateral_rl.analysis.kinematics import NEAR
from bilateral_rl.analysis.metric import Metric, mean
from bilateral_rl.analysis.trial_parts import over_reaches

TWO_ARMS = "two_arms"
"""What these metrics need of a task."""
_REACH, _HOLD = ("reach", TWO_ARMS), ("hold", TWO_ARMS)
_UNTIL = "until the hand first comes within 2 cm of the target"

# fmt: off
TRIAL_METRICS: tuple[Metric, ...] = (
    Metric("perpendicular_deviation_until_2cm", "Perpendicular deviation on the way", "cm",
           _REACH, "lower",
           f"Largest distance of the hand from the line through start and target, {_UNTIL} "
           "(Atkeson & Hollerbach 1985, doi:10.1523/JNEUROSCI.05-09-02318.1985).",
           lambda record: mean(over_reaches(
               record, lambda reach: kinematics.perpendicular_deviation(reach.hand, reach.target, NEAR)), 100)),
    Metric("path_length_ratio_until_2cm", "Path length ratio on the way", "", _REACH, "lower",
           f"Length of the hand's path over the straight distance that it had to go, {_UNTIL}; 1 is straight, less "
           "fell short (Coderre et al. 2010, doi:10.1177/1545968309356091).",
           lambda record: mean(over_reaches(
               record, lambda reach: kinematics.path_length_ratio(reach.hand, reach.target, NEAR)))),
    Metric("initial_direction_error_until_2cm", "Initial direction error on the way", "deg", _REACH,
           "lower",
           f"Angle between the directions from the start to the target and to the hand at peak speed, {_UNTIL} "
           "(Krakauer et al. 2000, doi:10.1523/JNEUROSCI.20-23-08916.2000).",
           lambda record: mean(over_reaches(
               record, lambda reach: kinematics.initial_direction_error(reach.hand, reach.target, NEAR)),
               np.degrees(1.0))),
    Metric("initial_direction_until_2cm", "Initial direction on the way, left is positive", "deg",
           _REACH, None,
           f"Angle from the direction of the target to that of the hand at peak speed, {_UNTIL}, positive to the left "
           "of the way there in the frame of the arm, in which the non-dominant arm is the dominant one's mirror image "
           "(Krakauer et al. 2000, doi:10.1523/JNEUROSCI.20-23-08916.2000).",
           lambda record: mean(over_reaches(
               record, lambda reach: kinematics.initial_direction(reach.hand, reach.target, NEAR)), np.degrees(1.0))),
    Metric("extent", "Extent of the reach", "%", _REACH, None,
           "How far the hand gets along the line from start to target, as a share of the target's distance; less than "
           "100 is an undershoot, which looks straight (ours).",
           lambda record: mean(over_reaches(record, lambda reach: kinematics.extent(reach.hand, reach.target)), 100)),
    Metric("hold_drift", "Drift in hold", "cm", _HOLD, "lower",
           "Distance between the hand's mean positions in the first and in the last fifth of the trial, which leaves "
           "out what shook it in between (after Brown et al. 2003, doi:10.1152/jn.00013.2003).",
           lambda record: mean(over_reaches(record, lambda hold: kinematics.drift(hold.hand)), 100)),
)
# fmt: on
