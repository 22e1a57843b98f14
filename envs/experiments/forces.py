"""The schema of what acts on the hand from outside, in experiments."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Discriminator, Tag
from pydantic.dataclasses import dataclass

from bilateral_rl.envs.experiments.numbers import (
    Count,
    Matrix,
    Point,
    Points,
    Share,
    Size,
    Steps,
    Stiffness,
    form,
)
from bilateral_rl.envs.quantities import STRICT, Number
from bilateral_rl.envs.refusals import refusing_in_a_sentence

_Center = Annotated[
    Annotated[Literal["start", "target"], Tag("<word>")] | Annotated[Point, Tag("<list>")], Discriminator(form)
]


@refusing_in_a_sentence
@dataclass(frozen=True, config=STRICT)
class ElasticField:
    """A field of forces K (center − hand).

    Raises:
        ValueError: numbers that are none, or of another shape.
    """

    stiffness: Stiffness
    """K, a number or a matrix of two by two (N/m)."""
    center: _Center
    """Where there is no force: [x, y] (m), or "start" or "target" for the hand's position there."""


@refusing_in_a_sentence
@dataclass(frozen=True, config=STRICT)
class Directions:
    """Forces of one size in evenly spaced directions, the first along x.

    Raises:
        ValueError: a number outside its range.
    """

    size: Size
    """Size of the force (N)."""
    directions: Count = 8
    """How many directions."""


_Pulses = Annotated[Annotated[Points, Tag("<list>")] | Annotated[Directions, Tag("<settings>")], Discriminator(form)]


@refusing_in_a_sentence
@dataclass(frozen=True, config=STRICT)
class ForcePulse:
    """A force on the hand for a few steps.

    Raises:
        ValueError: a number outside its range.
    """

    force: _Pulses
    """[Fx, Fy], a list of them, or a size and a number of directions (N)."""
    at: Steps
    """When it begins: steps after the go cue, or [first, last] for uniform ones (steps)."""
    steps: Count
    """How long it lasts (steps)."""
    share: Share = 1.0
    """Share of trials that have it."""


@refusing_in_a_sentence
@dataclass(frozen=True, config=STRICT)
class ForceChannel:
    """Walls along the straight line from start to target, which show what force the hand exerts on them.

    Scheidt, Reinkensmeyer, Conditt, Rymer & Mussa-Ivaldi 2000 (doi:10.1152/jn.2000.84.2.853).

    Raises:
        ValueError: a number outside its range.
    """

    stiffness: Size = 4000.0
    """Stiffness of the walls (N/m)."""
    damping: Size = 150.0
    """Damping of the walls (N·s/m)."""
    share: Share = 1.0
    """Share of trials that run in a channel, without field."""


_Load = Annotated[Annotated[Literal["drawn"], Tag("<word>")] | Annotated[Points, Tag("<list>")], Discriminator(form)]


@refusing_in_a_sentence
@dataclass(frozen=True, config=STRICT)
class Forces:
    """What acts on the hand from outside.

    Raises:
        ValueError: two velocity fields, or shares that leave nothing to share.
    """

    load: _Load | None = None
    """A constant force, [Fx, Fy], or a list of them, or "drawn", as ``trial.load`` and ``trial.max_load`` say (N)."""
    velocity_field: Matrix | None = None
    """B of a force B v, by the hand's velocity v (N·s/m)."""
    curl: Number | None = None
    """b of a curl field, whose B is b [[0, 1], [−1, 0]] (N·s/m)."""
    elastic_field: ElasticField | None = None
    """A force that depends on the hand's position."""
    pulse: ForcePulse | None = None
    """A force for a few steps."""
    channel: ForceChannel | None = None
    """Trials in a channel, without field."""
    field_off_share: Share = 0.0
    """Share of trials without velocity and elastic field: catch trials."""

    def __post_init__(self) -> None:
        if self.velocity_field is not None and self.curl is not None:
            raise ValueError("curl is a velocity_field by one number: give one of the two")
        if self.field_off_share and not self.has_field:
            raise ValueError("field_off_share needs a field: give velocity_field, curl or elastic_field")
        if self.channel is not None and self.channel.share + self.field_off_share > 1:
            raise ValueError(
                f"channel.share and field_off_share must not be above 1 together, got {self.channel.share:g} and "
                f"{self.field_off_share:g}"
            )

    @property
    def has_field(self) -> bool:
        """Whether there is a velocity or an elastic field."""
        return any(one is not None for one in (self.velocity_field, self.curl, self.elastic_field))

    @property
    def velocity_matrix(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """B (N·s/m), of ``velocity_field`` or ``curl``; zeros without them."""
        if self.velocity_field is not None:
            return self.velocity_field
        curl = self.curl or 0.0
        return (0.0, curl), (-curl, 0.0)
