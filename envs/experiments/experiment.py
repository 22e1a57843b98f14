"""The schema of an experiment: starts, targets, cues and forces as data, which can be read without anything numerical.

:mod:`bilateral_rl.envs.experiments.files` reads it from YAML, and :mod:`bilateral_rl.envs.experiments.task` draws its
trials.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from dataclasses import field
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Discriminator, Field, Tag
from pydantic.dataclasses import dataclass

from bilateral_rl.envs.experiments.forces import ForceChannel, Forces
from bilateral_rl.envs.experiments.numbers import Points, Share, Steps, form
from bilateral_rl.envs.experiments.places import Place
from bilateral_rl.envs.quantities import STRICT
from bilateral_rl.envs.refusals import refusing_in_a_sentence
from bilateral_rl.envs.task_specs import TASK_SPECS

Condition = Literal["field", "null", "channel"]
LONGEST_NAME, LONGEST_TEXT = 60, 1_000

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
