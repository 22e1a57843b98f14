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

from pydantic import AfterValidator, Field
from pydantic.dataclasses import dataclass

from bilateral_rl.envs.experiments.assignment import Assignment, Condition, Cues, Target, check_effects_of_staying
from bilateral_rl.envs.experiments.forces import Forces
from bilateral_rl.envs.experiments.numbers import Share
from bilateral_rl.envs.experiments.places import Place
from bilateral_rl.envs.quantities import STRICT
from bilateral_rl.envs.refusals import refusing_in_a_sentence
from bilateral_rl.envs.task_specs import TASK_SPECS
from bilateral_rl.vocabulary import SIDES

LONGEST_NAME, LONGEST_TEXT = 60, 1_000
_OF_ONE_ARM = ("start", "target", "timeline", "forces")
"""What an experiment of one arm says by itself: the fields of an :class:`Assignment`."""


@refusing_in_a_sentence
@dataclass(frozen=True, config=STRICT)
class Arms:
    """What each of two arms does, with places and forces in the frame of the body, whose midline is x = 0.

    Raises:
        ValueError: an unknown name, or values that make no experiment.
    """

    dominant: Assignment
    """What the dominant arm does, the right one."""
    non_dominant: Assignment
    """What the non-dominant arm does."""


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
    start: Place | None = None
    """Where the hand starts, at rest; to be given of one arm."""
    target: Target | None = None
    """Where it is to go; "start": it is to stay; to be given of one arm."""
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
    arms: Arms | None = None
    """What each of two arms does, in place of start, target, timeline and forces; null for one arm."""
    exchange: Share = 0.0
    """Of two arms: share of trials in which each does, mirrored about the midline, what is said of the other."""
    paired: bool = False
    """Of two arms: whether both take the same of their lists of starts, targets, loads and pulses, the first with the
    first, rather than each its own. When cues, jumps and pulses come, and which trials are catch trials, is common."""
    trial: dict[str, Any] = field(default_factory=dict)
    """Settings of trials where nobody says otherwise."""

    def __post_init__(self) -> None:
        own = {name: getattr(self, name) for name in _OF_ONE_ARM}
        if self.arms is None:
            for name in ("start", "target"):
                if own[name] is None:
                    raise ValueError(f"{name} must be given")
            for name in ("exchange", "paired"):
                if getattr(self, name):
                    raise ValueError(f"{name} has no effect on one arm: give arms, or leave it out")
            check_effects_of_staying(self.target, self.timeline, self.forces)
        elif given := [name for name, value in own.items() if value is not None]:
            raise ValueError(f"{given[0]} must stand under arms.dominant and arms.non_dominant: each arm has its own")

    @property
    def assignments(self) -> dict[str, Assignment]:
        """What each arm does, the dominant one first, by where a file says it: "arms.dominant."; "" of one arm."""
        if self.arms is not None:
            return {f"arms.{name}.": getattr(self.arms, name) for name in SIDES}
        assert self.start is not None
        assert self.target is not None
        return {"": Assignment(self.start, self.target, self.timeline, self.forces)}

    @property
    def measure(self) -> Literal["goal_completion", "time_in_goal"]:
        """What says how well it is done."""
        return self.judged_by or ("time_in_goal" if self.stays else "goal_completion")

    @property
    def stays(self) -> bool:
        """Whether no hand has another target than its start."""
        return all(assignment.stays for assignment in self.assignments.values())

    @property
    def has_field(self) -> bool:
        """Whether there is a velocity or an elastic field, which a hand can adapt to."""
        return any(assignment.has_field for assignment in self.assignments.values())

    def with_condition(self, condition: Condition) -> Experiment:
        """Return the experiment with one condition in all trials, which are otherwise the same.

        Args:
            condition: "field" for the forces as they are, "null" without velocity and elastic field, and "channel" for
                a channel in place of them, that of the experiment or one of the usual stiffness. Of two arms, each
                hand that is to go somewhere is in a channel.

        Raises:
            ValueError: another condition, or a channel where each target is the start.
        """
        if condition not in ("field", "null", "channel"):
            raise ValueError(f"unknown condition {condition!r}; choose from field, null, channel.")
        if condition == "channel" and self.stays:
            raise ValueError("forces.channel needs a target that is not the start: its walls lead there.")
        of_arms = [dataclasses.replace(one, forces=one.forces_in(condition)) for one in self.assignments.values()]
        if self.arms is None:
            return dataclasses.replace(self, forces=of_arms[0].forces)
        return dataclasses.replace(self, arms=Arms(*of_arms))


def is_complete(values: object) -> bool:
    """Whether nested dictionaries hold a whole experiment, and not a few changes of one."""
    if not isinstance(values, Mapping) or "name" not in values:
        return False
    arms = values.get("arms")
    if arms is None:
        return _says_where(values)
    return isinstance(arms, Mapping) and all(_says_where(arms.get(name)) for name in SIDES)


def _says_where(values: object) -> bool:
    return isinstance(values, Mapping) and {"start", "target"} <= values.keys()
