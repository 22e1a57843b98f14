"""The schema of where hands start and go, in experiments."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Discriminator, Tag
from pydantic.dataclasses import dataclass

from bilateral_rl.envs.experiments.numbers import (
    LONGEST_LIST,
    Count,
    Grid,
    Point,
    Points,
    form,
)
from bilateral_rl.envs.quantities import STRICT, Number, Positive
from bilateral_rl.envs.refusals import refusing_in_a_sentence

Elbow = Literal["positive", "negative"]


@refusing_in_a_sentence
@dataclass(frozen=True, config=STRICT)
class Region:
    """A box, of which ``grid`` takes evenly spaced points alone, or a disk; uniform.

    Raises:
        ValueError: neither or both of them, or numbers that make none.
    """

    low: Point | None = None
    """Lowest corner of a box."""
    high: Point | None = None
    """Highest corner of a box."""
    grid: Grid | None = None
    """Draw from so many by so many points of the box, its corners among them; null for the whole box."""
    center: Point | None = None
    """Center of a disk (m)."""
    radius: Positive | None = None
    """Radius of a disk (m)."""

    def __post_init__(self) -> None:
        box, disk = (self.low, self.high), (self.center, self.radius)
        if None in box and box != (None, None):
            raise ValueError("a box needs both low and high")
        if None in disk and disk != (None, None):
            raise ValueError("a disk needs both center and radius")
        if (box == (None, None)) == (disk == (None, None)):
            raise ValueError("a region is either a box, of low and high, or a disk, of center and radius")
        if self.grid is not None and self.low is None:
            raise ValueError("a grid needs a box, of low and high")
        if self.grid is not None and self.grid[0] * self.grid[1] > LONGEST_LIST:
            raise ValueError(
                f"grid must not have more than {LONGEST_LIST:,} points, got {self.grid[0] * self.grid[1]:,}"
            )
        if self.low is not None and self.high is not None:
            for low, high in zip(self.low, self.high, strict=True):
                if low > high:
                    raise ValueError(f"low must not be above high, got {low:g} and {high:g}")


@refusing_in_a_sentence
@dataclass(frozen=True, config=STRICT)
class CenterOut:
    """Places evenly spaced on a circle, one of which is drawn.

    Raises:
        ValueError: a number outside its range.
    """

    number: Count = 8
    """How many."""
    radius: Positive = 0.1
    """Radius of the circle (m)."""
    center: Point | None = None
    """Center of the circle (m); null for the hand at the start."""
    first_angle: Number = 0.0
    """Direction of the first place from the center, counterclockwise from x (degrees)."""


_Joints = Annotated[
    Annotated[Literal["uniform"], Tag("<word>")]
    | Annotated[Points, Tag("<list>")]
    | Annotated[Region, Tag("<settings>")],
    Discriminator(form),
]
_Hand = Annotated[Annotated[Points, Tag("<list>")] | Annotated[Region, Tag("<settings>")], Discriminator(form)]


@refusing_in_a_sentence
@dataclass(frozen=True, config=STRICT)
class Place:
    """A distribution of postures, by exactly one of ``joints``, ``hand`` and ``center_out``.

    Raises:
        ValueError: none or several of them, or numbers that make no place.
    """

    joints: _Joints | None = None
    """Angles of shoulder and elbow (rad): "uniform" over the joints' range, a posture, a list of them, or a box."""
    hand: _Hand | None = None
    """Positions of the hand (m): one, a list of them, a box or a disk. The origin is the one arm's shoulder, or midway
    between those of two."""
    center_out: CenterOut | None = None
    """Positions of the hand on a circle."""
    elbow: Elbow = "positive"
    """Which of the two postures with a given hand: that with a positive or a negative angle of the elbow."""

    def __post_init__(self) -> None:
        given = [name for name in ("joints", "hand", "center_out") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(
                f"give exactly one of joints, hand and center_out, got {' and '.join(given) or 'none of them'}"
            )
        if self.joints is not None and self.elbow == "negative":
            raise ValueError("elbow chooses a posture of a hand position, and joints are postures: leave it out")
        if isinstance(self.joints, Region) and self.joints.radius is not None:
            raise ValueError("joints may be in a box, of low and high, not in a disk")
