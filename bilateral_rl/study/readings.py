"""Readings of the paper: one way each to fill its gaps, as small YAML files.

The package ships two anchors, ``text`` and ``everything``, and every single deviation from each. A file of one's own is
read just so; it may deviate from any that is shipped.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field
from pydantic.dataclasses import dataclass

from bilateral_rl.analysis.goals import JUDGED_RADII, STUDY_RADII, in_centimeters
from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.claims.criteria import Arrival, Criteria, Depth, ReachMeasure
from bilateral_rl.config.parse import Values, flat, merge
from bilateral_rl.envs.quantities import STRICT, Positive
from bilateral_rl.envs.tasks import HoldPosition, RandomReach
from bilateral_rl.study.reading_files import ReadingFiles, check_reading

ANCHORS = ("text", "everything")
"""The readings from which the others deviate, and those that a study judges by if nothing is said."""
_LESIONS = {"text": "paper", "released": "released"}


def _measured(radius: float) -> float:
    if radius not in STUDY_RADII:
        raise ValueError(f"must be one of {', '.join(map(str, STUDY_RADII))} (m), at which goals are measured")
    return radius


Radius = Annotated[Positive, AfterValidator(_measured)]


@dataclass(frozen=True, config=STRICT)
class Radii:
    """Radius of the goal in each task (m)."""

    random_reach: Radius = JUDGED_RADII[RandomReach.id]
    hold_position: Radius = JUDGED_RADII[HoldPosition.id]


@dataclass(frozen=True, config=STRICT)
class Reading:
    """One way to fill what the paper leaves open.

    Raises:
        ValueError: a name that is none, no reason or source for it, a measure twice, or a task's trainings without
            settings by name.
    """

    name: str
    """Letters, digits, dots and dashes."""
    why: str = ""
    """Why anyone would read the paper so, in a sentence."""
    source: str = ""
    """What that rests on."""
    anchor: str | None = None
    """The reading that it deviates from."""
    training: dict[str, Any] = field(default_factory=dict)
    """Settings of the trainings over those of the study; under the name of a task, those of its trainings alone."""
    protocol: Protocol = field(default_factory=Protocol)
    """What follows a lesion."""
    lesions: Literal["text", "released"] | None = None
    """Whose combined lesions, those of the text or of the released code; None for those of the study's profile."""
    measure: Annotated[tuple[ReachMeasure, ...], Field(min_length=1)] = ("completion",)
    """By what a reach after a lesion is judged: by completion, by speed to the goal, or by both."""
    radii: Radii = field(default_factory=Radii)
    """Radius of the goal by task (m)."""
    arrival: Arrival = "first"
    """Which of the three steps within the goal ends a reach, for its speed."""
    alone: Depth = "deep"
    """Which lesion of the other side leaves a hemisphere to work alone."""

    def __post_init__(self) -> None:
        check_reading(self.name, self.why, self.source)
        if len(set(self.measure)) < len(self.measure):
            raise ValueError("measure names one measure twice")
        for task in JUDGED_RADII:
            if not isinstance(settings := self.training.get(task, {}), Mapping):
                raise ValueError(f"training.{task} must be settings by name, got {settings!r}")

    def training_of(self, task: str) -> Values:
        """Return the settings of the trainings of a task over those of the study."""
        of_all = {name: value for name, value in self.training.items() if name not in JUDGED_RADII}
        return merge(of_all, self.training.get(task, {}))

    def lesion_profile(self, of_study: str) -> str:
        """Return whose combined lesions it has, in a study of that profile."""
        return _LESIONS[self.lesions] if self.lesions else of_study

    @property
    def criteria(self) -> Criteria:
        """What the claims are judged by."""
        radii = dataclasses.asdict(self.radii)
        return Criteria(self.protocol.name, self.measure, radii, self.arrival, self.alone)

    @property
    def choices(self) -> dict[str, str]:
        """What it chooses for each gap, in words; a gap that is filled by the study's own settings says so."""
        protocol, training = self.protocol, {task: dict(flat(self.training_of(task))) for task in JUDGED_RADII}
        penalties = {task: [settings.pop(name, None) for name in _PENALTY] for task, settings in training.items()}
        validation = {task: settings.pop(_VALIDATION, None) for task, settings in training.items()}
        loads = {task: settings.pop(_LOAD, _OWN) for task, settings in training.items()}
        choices = {
            "what adapts": protocol.retrain,
            "epochs after a lesion": str(protocol.epochs),
            "learning rate after a lesion": _number(protocol.learning_rate),
            "optimizer after a lesion": protocol.optimizer,
            "trials after a lesion": protocol.trials,
            "penalty after a lesion": _penalty(protocol.penalty, protocol.penalty_coefficient),
            "unreached weights": "penalized" if protocol.penalize_unreached else "untouched",
            "weight penalty": _by_task({task: _penalty(*penalty) for task, penalty in penalties.items()}),
            "validation trials": _by_task({task: _number(n) for task, n in validation.items()}),
            "load in hold": loads[HoldPosition.id],
            "measure of a reach": " and ".join(self.measure),
            "goal of a reach": f"{in_centimeters(self.radii.random_reach)} cm",
            "goal of a hold": f"{in_centimeters(self.radii.hold_position)} cm",
            "a reach ends at": f"the {self.arrival} step",
            "combined lesions": self.lesions or _OWN,
            "a hemisphere alone": f"{self.alone} lesion of the other",
        }
        others = dict.fromkeys(name for settings in training.values() for name in settings)
        return choices | {
            name: _by_task({task: str(settings.get(name, _OWN)) for task, settings in training.items()})
            for name in others
        }


_OWN = "as in the study"
_PENALTY, _VALIDATION, _LOAD = ("bptt.penalty", "bptt.penalty_coefficient"), "bptt.validation_trials", "trial.load"


FILES = ReadingFiles("readings", Reading, ANCHORS, "the paper")
"""Those that are shipped."""


def load_readings(requested: Sequence[str] = ANCHORS) -> list[Reading]:
    """Load readings of the paper, as :meth:`ReadingFiles.load`."""
    return FILES.load(requested)


def reading_names() -> list[str]:
    """Return the names of the readings of the paper that are shipped, the anchors first."""
    return FILES.names()


def _by_task(words: Mapping[str, str]) -> str:
    """Words on each task's trainings: once if they are the same for all."""
    if len(set(words.values())) == 1:
        return next(iter(words.values()))
    return ", ".join(f"{word} in {task}" for task, word in words.items())


def _number(value: float | None) -> str:
    return _OWN if value is None else f"{value:g}"


def _penalty(kind: str | None, coefficient: float | None) -> str:
    if kind is None and coefficient is None:
        return _OWN
    if coefficient == 0:
        return "none"
    return " ".join(filter(None, [kind, "" if coefficient is None else f"{coefficient:g}"]))
