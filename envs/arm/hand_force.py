"""Forces on the hand that depend on its motion, as Warp functions of either precision."""

from typing import Any

import warp as wp


@wp.func
def hand_force(hand: Any, offset: Any, velocity_gain: Any, position_gain: Any) -> Any:
    """Return the force (2,) (N) on a hand of position and velocity ``hand`` (4,): offset + B v − K x.

    ``offset`` (2,) (N) holds everything that depends on neither, ``velocity_gain`` B (2, 2) is in N·s/m and
    ``position_gain`` K (2, 2) in N/m. Elastic fields around any center and the walls of a channel are of this form:
    K (x₀ − x) is K x₀ − K x.
    """
    position = type(offset)(hand[0], hand[1])
    velocity = type(offset)(hand[2], hand[3])
    return offset + velocity_gain * velocity - position_gain * position


@wp.func
def is_within(step: int, first: int, last: int) -> bool:
    """Whether ``step`` lies in the window from ``first`` on and before ``last``."""
    return step >= first and step < last
