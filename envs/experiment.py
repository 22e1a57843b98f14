"""The schema of an experiment: starts, targets, cues and forces as data, which can be read without anything numerical.

:mod:`bilateral_rl.envs.experiment_files` reads it from YAML, :mod:`bilateral_rl.envs.experiment_task` draws its trials.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from dataclasses import field
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Discriminator, Field, Tag
from pydantic.dataclasses import dataclass

from bilateral_rl.envs.experiment_numbers import (
    LONGEST_LIST,
    Count,
    Grid,
    Matrix,
    Point,
    Points,
    Share,
    Size,
    Steps,
    Stiffness,
    form,
)
from bilateral_rl.envs.quantities import STRICT, Number, Positive
from bilateral_rl.envs.refusals import refusing_in_a_sentence
from bilateral_rl.envs.task_specs import TASK_SPECS

Elbow = Literal["positive", "negative"]
Condition = Literal["field", "null", "channel"]
LONGEST_NAME, LONGEST_TEXT = 60, 1_000


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
    """Positions of the hand (m), the shoulder at the origin: one, a list of them, a box or a disk."""
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


_Target = Annotated[
    Annotated[Literal["start"], Tag("<word>")] | Annotated[Place, Tag("<settings>")], Discriminator(form)
]


@refusing_in_a_sentence
@dataclass(frozen=True, config=STRICT)
class TargetJump:
    """A target that jumps, to a place of its own or by an offset.

    Raises:
        ValueError: neither or both of ``target`` and ``offset``, or a number outside its range.
    """

    at: Steps
    """When it jumps: steps after the go cue, or [first, last] for uniform ones (steps)."""
    target: Place | None = None
    """Where it jumps to."""
    offset: Points | None = None
    """By how much the hand position jumps, [dx, dy] or a list of them (m)."""
    share: Share = 1.0
    """Share of trials in which it jumps."""

    def __post_init__(self) -> None:
        if (self.target is None) == (self.offset is None):
            raise ValueError("give exactly one of target and offset")


@refusing_in_a_sentence
@dataclass(frozen=True, config=STRICT)
class Cues:
    """When targets are shown.

    Raises:
        ValueError: a number outside its range.
    """

    go: Steps = (0, 0)
    """When the target is shown in place of the start, a step or [first, last] for uniform ones (steps)."""
    no_go_share: Share = 0.0
    """Share of trials in which no cue comes, and the target stays at the start: catch trials."""
    jump: TargetJump | None = None
    """A jump of the target after the cue."""


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


def _name(value: str) -> str:
    if not re.fullmatch(rf"[A-Za-z0-9_][\w.-]{{0,{LONGEST_NAME - 1}}}", value, re.ASCII):
        raise ValueError(
            f"must be a word of letters, digits, _, - and . for folders, of at most {LONGEST_NAME}, got {value!r}"
        )
    if value in TASK_SPECS:
        raise ValueError(f"must not be {value}, which is a task of its own")
    return value


Text = Annotated[str, Field(max_length=LONGEST_TEXT)]


@refusing_in_a_sentence
@dataclass(frozen=True, config=STRICT)
class Experiment:
    """An experiment as data: what trials are drawn from, and how they run.

    Raises:
        ValueError: an unknown name, or values that make no experiment.
    """

    name: Annotated[str, AfterValidator(_name)]
    """What commands and run folders call it; in a file, its name by default."""
    start: Place
    """Where the hand starts, at rest."""
    target: _Target
    """Where it is to go; "start": it is to stay."""
    description: Text = ""
    """What the arm is to do, for lists."""
    source: Text = ""
    """Where the paradigm comes from."""
    judged_by: Literal["goal_completion", "time_in_goal"] | None = None
    """What says how well it is done; null: time in the goal where the target is the start, else completion."""
    timeline: Cues | None = None
    """When targets are shown, and jump; null: the target is there from the start."""
    forces: Forces | None = None
    """What acts on the hand from outside."""
    trial: dict[str, Any] = field(default_factory=dict)
    """Settings of trials where nobody says otherwise."""

    def __post_init__(self) -> None:
        if self.target == "start":
            if self.timeline is not None and self.timeline.jump is None:
                raise ValueError("timeline has no effect where the target is the start and does not jump: leave it out")
            if self.forces is not None and self.forces.channel is not None:
                raise ValueError("forces.channel needs a target that is not the start: its walls lead there")

    @property
    def measure(self) -> Literal["goal_completion", "time_in_goal"]:
        """What says how well it is done."""
        return self.judged_by or ("time_in_goal" if self.target == "start" else "goal_completion")

    @property
    def has_field(self) -> bool:
        """Whether there is a velocity or an elastic field, which a hand can adapt to."""
        return self.forces is not None and self.forces.has_field

    def with_condition(self, condition: Condition) -> Experiment:
        """Return the experiment with one condition in all trials, which are otherwise the same.

        Args:
            condition: "field" for the forces as they are, "null" without velocity and elastic field, and "channel" for
                a channel in place of them, that of the experiment or one of the usual stiffness.

        Raises:
            ValueError: another condition, or a channel where the target is the start.
        """
        if condition not in ("field", "null", "channel"):
            raise ValueError(f"unknown condition {condition!r}; choose from field, null, channel.")
        forces = self.forces or Forces()
        channel = forces.channel
        if condition == "channel":
            channel = dataclasses.replace(channel or ForceChannel(), share=1.0)
        elif channel is not None:
            channel = dataclasses.replace(channel, share=0.0)
        off = float(condition == "null" and forces.has_field)
        return dataclasses.replace(self, forces=dataclasses.replace(forces, channel=channel, field_off_share=off))


def is_complete(values: object) -> bool:
    """Whether nested dictionaries hold a whole experiment, and not a few changes of one."""
    return isinstance(values, Mapping) and {"name", "start", "target"} <= values.keys()
