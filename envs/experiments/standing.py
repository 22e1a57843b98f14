"""Arms and where they stand: one at the origin, or two at the sides of the body, in whose frame places are given."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.arm.parameters import ArmParameters
from bilateral_rl.envs.experiments.places import Elbow
from bilateral_rl.envs.kinematics import UnreachableError, hand_position, inverse_kinematics
from bilateral_rl.envs.settings import TrialSettings

Float64 = NDArray[np.float64]


class StandingArm(NamedTuple):
    """An arm in the frame in which places and forces are given."""

    physics: ArmParameters
    """Whose joints and links."""
    shoulder: float = 0.0
    """Where the shoulder is along x (m)."""
    outward: float = 1.0
    """1 or -1: the direction along x that points away from the other arm, as x of the arm's own frame does."""

    def hand_position(self, postures: NDArray[Any]) -> Float64:
        """Return the hand's positions (…, 2) (m) at postures (…, 2) (rad)."""
        return hand_position(postures, self.physics) * (self.outward, 1.0) + (self.shoulder, 0.0)

    def postures(self, positions: Float64, elbow: Elbow) -> Float64:
        """Return the postures (…, 2) (rad) with the hand at positions (…, 2) (m).

        Raises:
            UnreachableError: positions that the arm cannot take.
        """
        own = (positions - (self.shoulder, 0.0)) * (self.outward, 1.0)
        try:
            return inverse_kinematics(own, self.physics, elbow)
        except UnreachableError as error:
            there = error.position * (self.outward, 1.0) + (self.shoulder, 0.0)
            where = f"; the shoulder lies at [{self.shoulder:.4g}, 0] m" if self.shoulder else ""
            raise UnreachableError(there, error.reason + where) from None


def standing_arms(n_arms: int, settings: TrialSettings) -> tuple[StandingArm, ...]:
    """Return the one arm, or the dominant and the non-dominant one."""
    if n_arms == 1:
        return (StandingArm(settings.arm),)
    side = settings.two_arms.shoulder_distance / 2
    return StandingArm(settings.arm, side, 1.0), StandingArm(settings.arm, -side, -1.0)
