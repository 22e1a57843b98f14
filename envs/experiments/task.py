"""The trials of an experiment, each drawn from uniform numbers of its own."""

from __future__ import annotations

from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.draws import springs
from bilateral_rl.envs.experiments.assignment import Assignment, Cues
from bilateral_rl.envs.experiments.checks import check_experiment
from bilateral_rl.envs.experiments.drawn_assignments import CHOICES, NUMBERS, Parts, draw_assignment
from bilateral_rl.envs.experiments.drawn_places import chosen_index, number_listed
from bilateral_rl.envs.experiments.exchanged import exchanged, of_both_arms
from bilateral_rl.envs.experiments.experiment import Experiment
from bilateral_rl.envs.experiments.forces import Forces
from bilateral_rl.envs.experiments.standing import standing_arms
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.task import FEATURES, HandForces, Task, Trials

Float64 = NDArray[np.float64]
_ENDS = np.cumsum([0, *NUMBERS.values()]).tolist()
_SLICES = dict(zip(NUMBERS, pairwise(_ENDS), strict=True))


class ExperimentTask(Task):
    """The task that an experiment describes.

    Args:
        experiment: as data.

    Attributes:
        experiment: as given.
    """

    def __init__(self, experiment: Experiment) -> None:
        if not isinstance(experiment, Experiment):
            raise TypeError(f"experiment must be an Experiment, got {type(experiment).__name__}.")
        self.experiment = experiment
        self.id = experiment.name
        self.description = experiment.description
        self.judged_by = experiment.measure
        self.trial = experiment.trial
        self.n_arms: Literal[1, 2] = 1 if experiment.arms is None else 2
        # Of two arms the first says whether they exchange what they do.
        self.n_uniform = self.n_arms * _ENDS[-1] + self.n_arms - 1
        self._assignments = tuple(experiment.assignments.values())
        forces = [assignment.forces or Forces() for assignment in self._assignments]
        self.has_load = any(of.load == "drawn" for of in forces)
        self.has_timeline = any(assignment.timeline is not None for assignment in self._assignments)
        self.has_forces = any(of.has_field or of.pulse is not None or of.channel is not None for of in forces)

    def trials(self, uniform: NDArray[np.float64], settings: TrialSettings) -> Trials:
        arms = standing_arms(self.n_arms, settings)
        drawn = [
            draw_assignment(assignment, self._parts(uniform, of), arm, settings)
            for of, (assignment, arm) in enumerate(zip(self._assignments, arms, strict=True))
        ]
        trials = drawn[0] if self.n_arms == 1 else of_both_arms(*drawn)
        trials = trials._replace(
            timeline=trials.timeline if self.has_timeline else None, forces=trials.forces if self.has_forces else None
        )
        if self.n_arms == 1:
            return trials
        return exchanged(trials, self._exchanges(uniform))._replace(spring=springs(len(uniform), settings))

    def check(self, settings: TrialSettings) -> None:
        check_experiment(self.experiment, settings)

    def is_symmetric(self, settings: TrialSettings) -> bool:
        return self.n_arms == 2 and self.experiment.exchange == 0.5

    @property
    def roles(self) -> frozenset[str]:
        if self.n_arms == 1:
            return super().roles
        return frozenset("hold" if assignment.target == "start" else "reach" for assignment in self._assignments)

    @property
    def features(self) -> frozenset[str]:
        return frozenset(name for name in FEATURES if any(name in _features(one) for one in self._assignments))

    @property
    def mixes(self) -> tuple[str, ...]:
        of_arms = [_mixes(assignment) for assignment in self._assignments]
        return tuple(name for name in ("field", "null", "channel") if any(name in of for of in of_arms))

    def target_indices(self, uniform: NDArray[np.float64], settings: TrialSettings) -> NDArray[np.int32]:
        of_arms, before = np.full((len(uniform), self.n_arms), -1, dtype=np.int32), 0
        for of, assignment in enumerate(self._assignments):
            n = None if isinstance(assignment.target, str) else number_listed(assignment.target)
            if n is not None:
                of_arms[:, of] = before + chosen_index(self._parts(uniform, of)["target"][:, 0], n)
                before += n
        if self.n_arms == 1:
            return of_arms[:, 0]
        return np.where(self._exchanges(uniform)[:, None], of_arms[:, ::-1], of_arms)

    def field(self, uniform: NDArray[np.float64], settings: TrialSettings) -> HandForces | None:
        return ExperimentTask(self.experiment.with_condition("field")).trials(uniform, settings).forces

    def _parts(self, uniform: Float64, arm: int) -> Parts:
        """Return the numbers of each part of an arm's trials: times and conditions are those of the first arm."""
        own = CHOICES if not self.experiment.paired else ()
        return {name: self._part(uniform, name, arm if name in own else 0) for name in NUMBERS}

    def _part(self, uniform: Float64, name: str, arm: int) -> Float64:
        first, last = _SLICES[name]
        begin = self.n_arms - 1 + self.n_arms * first + arm * (last - first)
        return uniform[:, begin : begin + last - first]

    def _exchanges(self, uniform: Float64) -> NDArray[np.bool_]:
        """Return in which trials (n,) the arms exchange what they do."""
        return np.asarray(uniform[:, 0] < self.experiment.exchange)


def _features(assignment: Assignment) -> set[str]:
    cues, forces = assignment.timeline or Cues(), assignment.forces or Forces()
    has = {
        "cue": cues.go != (0, 0) or cues.no_go_share > 0,
        "jump": cues.jump is not None,
        "field": forces.has_field,
        "pulse": forces.pulse is not None,
        "channel": forces.channel is not None and forces.channel.share > 0,
    }
    return {name for name in FEATURES if has[name]}


def _mixes(assignment: Assignment) -> tuple[str, ...]:
    """Return the conditions of an arm's trials that differ in the forces on its hand."""
    forces = assignment.forces or Forces()
    in_channel = forces.channel.share if forces.channel is not None else 0.0
    off = forces.field_off_share if forces.has_field else 1.0 - in_channel
    shares = {"field": 1.0 - off - in_channel, "null": off, "channel": in_channel}
    there = tuple(name for name, share in shares.items() if share > 1e-9)  # more than the rounding of their sum
    return there if len(there) > 1 else ()
