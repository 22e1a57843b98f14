"""The schema of what one arm does in an experiment: where its hand starts and goes, when, and against what."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Literal

from pydantic import Discriminator, Tag
from pydantic.dataclasses import dataclass

from bilateral_rl.envs.experiments.forces import ForceChannel, Forces
from bilateral_rl.envs.experiments.numbers import Points, Share, Steps, form
from bilateral_rl.envs.experiments.places import Place
from bilateral_rl.envs.quantities import STRICT
from bilateral_rl.envs.refusals import refusing_in_a_sentence

Condition = Literal["field", "null", "channel"]

Target = Annotated[
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


@refusing_in_a_sentence
@dataclass(frozen=True, config=STRICT)
class Assignment:
    """What one arm does: what an experiment of one arm says by itself, and one of two arms of each of them.

    Raises:
        ValueError: an unknown name, or values that make none.
    """

    start: Place
    """Where the hand starts, at rest."""
    target: Target
    """Where it is to go; "start": it is to stay."""
    timeline: Cues | None = None
    """When targets are shown, and jump; null: the target is there from the start."""
    forces: Forces | None = None
    """What acts on the hand from outside."""

    def __post_init__(self) -> None:
        check_effects_of_staying(self.target, self.timeline, self.forces)

    @property
    def stays(self) -> bool:
        """Whether the hand is to stay where it starts."""
        return self.target == "start"

    @property
    def has_field(self) -> bool:
        """Whether there is a velocity or an elastic field, which a hand can adapt to."""
        return self.forces is not None and self.forces.has_field

    def forces_in(self, condition: Condition) -> Forces:
        """Return the forces with one condition in all trials, as :meth:`Experiment.with_condition` says."""
        forces = self.forces or Forces()
        channel = forces.channel
        if condition == "channel" and not self.stays:
            channel = dataclasses.replace(channel or ForceChannel(), share=1.0)
        elif channel is not None:
            channel = dataclasses.replace(channel, share=0.0)
        without = condition == "null" or (condition == "channel" and self.stays)
        return dataclasses.replace(forces, channel=channel, field_off_share=float(without and forces.has_field))


def check_effects_of_staying(target: Place | str | None, timeline: Cues | None, forces: Forces | None) -> None:
    """Raise a ValueError for cues and walls that a hand which is to stay has no use for."""
    if target != "start":
        return
    if timeline is not None and timeline.jump is None:
        raise ValueError("timeline has no effect where the target is the start and does not jump: leave it out")
    if forces is not None and forces.channel is not None:
        raise ValueError("forces.channel needs a target that is not the start: its walls lead there")
