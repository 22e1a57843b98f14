"""Settings of trials of two arms: where the shoulders are, the spring between the hands, and who does what."""

from __future__ import annotations

from dataclasses import field
from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from bilateral_rl.envs.quantities import STRICT, NotNegative, Positive
from bilateral_rl.envs.refusals import refusing_in_a_sentence

Roles = Literal["drawn", "dominant_reaches", "non_dominant_reaches"]
OF_ROLES = ("two_arms.roles", "two_arms.reach")
"""Settings that have no effect on a task of two arms that does not draw by them who reaches, and how far."""


@refusing_in_a_sentence
@dataclass(frozen=True, config=STRICT)
class SpringSettings:
    """A spring, with a damper, between the two hands.

    Raises:
        ValueError: an unknown name, or a number outside its range.
    """

    stiffness: NotNegative = 0.0
    """Force on either hand by the change since the start of what is between them (N/m); 0 for no spring."""
    damping: NotNegative = 0.0
    """Force on either hand by the velocity of the other one relative to it (N·s/m); 0 for no damper."""
    kind: Literal["vector", "distance"] = "vector"
    """What it holds: "vector", the vector from hand to hand, which it had at the start; "distance", its length alone,
    so that the hands may turn about each other freely."""


@refusing_in_a_sentence
@dataclass(frozen=True, config=STRICT)
class TwoArmSettings:
    """What trials of two arms have beyond those of one.

    Raises:
        ValueError: an unknown name, or a number outside its range.
    """

    shoulder_distance: Positive = 0.36
    """Distance of the shoulders, which lie to both sides of the body's midline, x = 0 (m)."""
    spring: SpringSettings = field(default_factory=SpringSettings)
    """What ties the hands together."""
    roles: Roles = "drawn"
    """Which hand reaches, where the other one is to keep its place: drawn anew in each trial, or always the same."""
    reach: tuple[Annotated[Positive, Field(lt=1)], Annotated[Positive, Field(lt=1)]] = (0.1, 0.2)
    """Least and greatest distance of the target from the start of the hand that reaches (m)."""

    def __post_init__(self) -> None:
        if self.reach[0] > self.reach[1]:
            raise ValueError(f"reach must be [least, greatest], got {list(self.reach)}")
