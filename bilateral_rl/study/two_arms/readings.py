"""Readings of the study of two arms: one way each to decide what its design leaves open, as small YAML files.

The package ships ``default`` and single deviations from it: those in what is done after the training, or in what is
judged, and those that need other trainings.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any

from pydantic.dataclasses import dataclass

from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.claims.two_arms.criteria import HandCriteria, Judged, Steadiness, Straightness
from bilateral_rl.config.parse import Values, flat, merge
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.envs.quantities import STRICT
from bilateral_rl.study.plan import TASKS_OF
from bilateral_rl.study.reading_files import ReadingFiles, check_reading

TASKS = TASKS_OF["two_arms"]
_OWN = "as in the study"
_SPRING = "trial.two_arms.spring.stiffness"
_TRAINED = {
    "network.ipsilateral_share": "ipsilateral share",
    "network.trained_combination": "combination weights are trained",
    "network.units": "units of a layer",
    "bptt.penalty_coefficient": "λ of the weight penalty",
    _SPRING: "spring in training (N/m)",
}
"""Settings of trainings that shipped readings differ in, in words."""
_STRAIGHT: dict[Straightness, str] = {
    "perpendicular_deviation": "the maximal perpendicular deviation",
    "initial_direction_error": "the initial direction error",
    "path_length_ratio": "the path length ratio",
}
_STEADY: dict[Steadiness, str] = {
    "hold_rms_error": "the RMS error",
    "hold_drift": "the drift",
    "time_in_goal_1cm": "the steps within 1 cm",
    "time_in_goal_2cm": "the steps within 2 cm",
    "time_in_goal_5cm": "the steps within 5 cm",
}
_PART: dict[Judged, str] = {"until_2cm": "until within 2 cm of the target", "whole": "over the whole trial"}


@dataclass(frozen=True, config=STRICT)
class HandReading:
    """One way to decide what the study of two arms leaves open.

    Raises:
        ValueError: a name that is none, no reason or source for it, or a task's trainings without settings by name.
    """

    name: str
    """Letters, digits, dots and dashes."""
    why: str = ""
    """Why anyone would decide so, in a sentence."""
    source: str = ""
    """What that rests on."""
    anchor: str | None = None
    """The reading that it deviates from."""
    training: dict[str, Any] = field(default_factory=dict)
    """Settings of the trainings over those of the study; under the name of a task, those of its trainings alone."""
    callosum: Protocol = field(default_factory=lambda: Protocol("output"))
    """What follows the cut of the callosum (B5)."""
    deep: Protocol = field(default_factory=lambda: Protocol("none"))
    """What follows a deep lesion (B6)."""
    straightness: Straightness = "perpendicular_deviation"
    """By what a reach is called straight."""
    judged: Judged = "until_2cm"
    """Which part of a reach is judged: until the hand first comes within 2 cm of the target, or all of the trial."""
    steadiness: Steadiness = "hold_rms_error"
    """By what a hold is called stable."""

    def __post_init__(self) -> None:
        check_reading(self.name, self.why, self.source)
        for task in TASKS:
            if not isinstance(settings := self.training.get(task, {}), Mapping):
                raise ValueError(f"training.{task} must be settings by name, got {settings!r}")

    def training_of(self, task: str) -> Values:
        """Return the settings of the trainings of a task over those of the study."""
        of_all = {name: value for name, value in self.training.items() if name not in TASKS}
        return merge(of_all, self.training.get(task, {}))

    def criteria(self, config: TrainConfig) -> HandCriteria:
        """Return what the claims are judged by, of networks that learned to reach and hold by ``config``."""
        return HandCriteria(
            self.straightness,
            self.judged,
            self.steadiness,
            spring=spring_of(config),
            callosum=self.callosum.name,
            deep=self.deep.name,
            has_path=config.network.ipsilateral_share != 0,
        )

    @property
    def choices(self) -> dict[str, str]:
        """What it chooses for each gap, in words; a gap that is filled by the study's own settings says so."""
        training = {task: dict(flat(self.training_of(task))) for task in TASKS}
        choices = {
            "after the cut of the callosum": self.callosum.words,
            "after a deep lesion": self.deep.words,
            "straight by": _STRAIGHT[self.straightness],
            "reaches judged": _PART[self.judged],
            "stable by": _STEADY[self.steadiness],
        }
        names = dict.fromkeys([*_TRAINED, *(name for settings in training.values() for name in settings)])
        return choices | {_TRAINED.get(name, name): _by_task(name, training) for name in names}


def spring_of(config: TrainConfig) -> float:
    """Return the stiffness of the spring between the hands in the trials of a training (N/m)."""
    return float(config.trial.two_arms.spring.stiffness)


def _by_task(name: str, training: Mapping[str, Values]) -> str:
    """What is set, once if it is the same in every task that sets it."""
    words = {task: str(settings[name]).lower() for task, settings in training.items() if name in settings}
    if not words:
        return _OWN
    if len(set(words.values())) == 1 and (len(words) == len(TASKS) or name == _SPRING):
        return next(iter(words.values()))
    return ", ".join(f"{word} in {task}" for task, word in words.items())


HAND_FILES = ReadingFiles("readings/two_arms", HandReading, ("default",), "the study of two arms")
"""Those that are shipped."""


def usual_readings() -> list[str]:
    """Return the names of the readings that a study judges by if nothing is said: all that share the trainings."""
    return [reading.name for reading in HAND_FILES.load(HAND_FILES.names()) if not reading.training]
