"""By what a reading judges the hands of two arms, where it is open; the defaults were chosen before any result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from bilateral_rl.analysis.protocols import Protocol

Straightness = Literal["perpendicular_deviation", "initial_direction_error", "path_length_ratio"]
Steadiness = Literal["hold_rms_error", "hold_drift", "time_in_goal_1cm", "time_in_goal_2cm", "time_in_goal_5cm"]
Judged = Literal["until_2cm", "whole"]


@dataclass(frozen=True)
class HandCriteria:
    """What B1 to B6 are judged by."""

    straightness: Straightness = "perpendicular_deviation"
    """By what a reach is called straight."""
    judged: Judged = "until_2cm"
    """Which part of a reach: until the hand first comes within 2 cm of the target, or the whole trial."""
    steadiness: Steadiness = "hold_rms_error"
    """By what a hold is called stable."""
    spring: float = 50.0
    """Stiffness of the spring (N/m) with which the networks learned, and with which B1 to B4 are tested."""
    callosum: str = Protocol("output").name
    """Name of the protocol that follows the cut of the callosum (B5)."""
    deep: str = Protocol("none").name
    """Name of the protocol that follows a deep lesion (B6)."""
    has_path: bool = True
    """Whether each hemisphere also reaches the arm of its own side, so that it acts on both without a callosum."""

    @property
    def tied(self) -> float:
        """Stiffness of the spring (N/m) that B5 sets against none: that of the training, if there was one."""
        return self.spring or HandCriteria.spring

    @property
    def deviation(self) -> str:
        """Name of the measure by which a reach is called straight."""
        return self.straightness + ("_until_2cm" if self.judged == "until_2cm" else "")
