"""The trials of an experiment, each drawn from its arm's own uniform numbers."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.experiments.checks import check_experiment
from bilateral_rl.envs.experiments.drawn_places import chosen_index, draw_postures, number_listed
from bilateral_rl.envs.experiments.experiment import Experiment, TargetJump
from bilateral_rl.envs.experiments.forces import Directions, ForcePulse, Forces
from bilateral_rl.envs.kinematics import hand_position, inverse_kinematics
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.tasks import FEATURES, NEVER, HandForces, Task, Timeline, Trials, draw_loads

Float64 = NDArray[np.float64]
_NUMBERS = {
    "start": 2, "target": 2, "load": 2, "go": 1, "no_go": 1, "jumps": 1, "jump_at": 1, "jump_to": 2,
    "pulsed": 1, "pulse_at": 1, "pulse": 1, "condition": 1,
}  # fmt: skip
"""How many uniform numbers each part of a trial takes, in their order. All are drawn whether a part is there or not, so
that experiments which differ in one part have the same trials but for that part."""
_ENDS = np.cumsum([0, *_NUMBERS.values()]).tolist()
_SLICES = {name: slice(*ends) for name, ends in zip(_NUMBERS, pairwise(_ENDS), strict=True)}


class ExperimentTask(Task):
    """The task that an experiment describes.

    Args:
        experiment: as data.

    Attributes:
        experiment: as given.
    """

    n_uniform = _ENDS[-1]

    def __init__(self, experiment: Experiment) -> None:
        if not isinstance(experiment, Experiment):
            raise TypeError(f"experiment must be an Experiment, got {type(experiment).__name__}.")
        forces = experiment.forces
        self.experiment = experiment
        self.id = experiment.name
        self.description = experiment.description
        self.judged_by = experiment.measure
        self.trial = experiment.trial
        self.has_load = forces is not None and forces.load == "drawn"
        self.has_timeline = experiment.timeline is not None
        self.has_forces = forces is not None and (
            forces.has_field or forces.pulse is not None or forces.channel is not None
        )

    def trials(self, uniform: NDArray[np.float64], settings: TrialSettings) -> Trials:
        parts = {name: uniform[:, where] for name, where in _SLICES.items()}
        experiment, arm = self.experiment, settings.arm
        start = draw_postures(experiment.start, parts["start"], arm)
        hand = hand_position(start, arm)
        goal = start
        if not isinstance(experiment.target, str):
            goal = draw_postures(experiment.target, parts["target"], arm, center=hand)
        forces = experiment.forces or Forces()
        timeline = self._timeline(parts, goal, hand, settings)
        return Trials(
            start=_single(start),
            goal=_single(goal),
            load=_load(forces, parts["load"], settings),
            timeline=timeline,
            forces=self._forces(forces, parts, timeline, hand, hand_position(goal, arm)),
        )

    def check(self, settings: TrialSettings) -> None:
        check_experiment(self.experiment, settings)

    @property
    def features(self) -> frozenset[str]:
        cues, forces = self.experiment.timeline, self.experiment.forces or Forces()
        has = {
            "cue": cues is not None and (cues.go != (0, 0) or cues.no_go_share > 0),
            "jump": cues is not None and cues.jump is not None,
            "field": forces.has_field,
            "pulse": forces.pulse is not None,
            "channel": forces.channel is not None and forces.channel.share > 0,
        }
        return frozenset(name for name in FEATURES if has[name])

    @property
    def mixes(self) -> tuple[str, ...]:
        forces = self.experiment.forces or Forces()
        in_channel = forces.channel.share if forces.channel is not None else 0.0
        off = forces.field_off_share if forces.has_field else 1.0 - in_channel
        shares = {"field": 1.0 - off - in_channel, "null": off, "channel": in_channel}
        there = tuple(name for name, share in shares.items() if share > 1e-9)  # more than the rounding of their sum
        return there if len(there) > 1 else ()

    def target_indices(self, uniform: NDArray[np.float64], settings: TrialSettings) -> NDArray[np.int32]:
        target = self.experiment.target
        n = None if isinstance(target, str) else number_listed(target)
        if n is None:
            return super().target_indices(uniform, settings)
        return chosen_index(uniform[:, _SLICES["target"]][:, 0], n).astype(np.int32)

    def field(self, uniform: NDArray[np.float64], settings: TrialSettings) -> HandForces | None:
        return ExperimentTask(self.experiment.with_condition("field")).trials(uniform, settings).forces

    def _timeline(
        self, parts: dict[str, Float64], goal: Float64, hand: Float64, settings: TrialSettings
    ) -> Timeline | None:
        cues = self.experiment.timeline
        if cues is None:
            return None
        n = len(goal)
        comes = parts["no_go"][:, 0] >= cues.no_go_share
        go = np.where(comes, _steps(cues.go, parts["go"]), NEVER)
        jump, jump_goal = np.full(n, NEVER), goal
        if cues.jump is not None:
            jumps = comes & (parts["jumps"][:, 0] < cues.jump.share)
            jump = np.where(jumps, go + _steps(cues.jump.at, parts["jump_at"]), NEVER)
            jump_goal = self._jump_goal(cues.jump, parts["jump_to"], goal, hand, settings)
        return Timeline(go.astype(np.int32), jump.astype(np.int32), _single(jump_goal))

    def _jump_goal(
        self, jump: TargetJump, uniform: Float64, goal: Float64, hand: Float64, settings: TrialSettings
    ) -> Float64:
        if jump.target is not None:
            return draw_postures(jump.target, uniform, settings.arm, center=hand)
        offsets = np.array(jump.offset)
        positions = hand_position(goal, settings.arm) + offsets[chosen_index(uniform[:, 0], len(offsets))]
        target = self.experiment.target
        elbow = "positive" if isinstance(target, str) else target.elbow
        return inverse_kinematics(positions, settings.arm, elbow)

    def _forces(
        self, forces: Forces, parts: dict[str, Float64], timeline: Timeline | None, hand: Float64, target: Float64
    ) -> HandForces | None:
        if not self.has_forces:
            return None
        n = len(hand)
        condition = parts["condition"][:, 0]
        channel = forces.channel
        in_channel = condition < (0.0 if channel is None else channel.share)
        off = condition < (0.0 if channel is None else channel.share) + forces.field_off_share
        on = ~off[:, None, None]
        elastic = forces.elastic_field
        center = np.zeros((n, 2))
        if elastic is not None:
            places = {"start": hand, "target": target}
            center = places[elastic.center] if isinstance(elastic.center, str) else np.tile(elastic.center, (n, 1))
        walls = np.zeros((n, 2)) if channel is None else in_channel[:, None] * [channel.stiffness, channel.damping]
        pulse, window = _pulse(forces.pulse, parts, np.zeros(n, dtype=np.int32) if timeline is None else timeline.go)
        return HandForces(
            velocity_gain=_single(on * np.array(forces.velocity_matrix)),
            position_gain=_single(on * (np.zeros((2, 2)) if elastic is None else np.array(elastic.stiffness))),
            center=_single(center),
            pulse=_single(pulse),
            pulse_window=window,
            walls=_single(walls),
        )


def _load(forces: Forces, uniform: Float64, settings: TrialSettings) -> NDArray[np.float32]:
    if forces.load is None:
        return np.zeros((len(uniform), 2), dtype=np.float32)
    if isinstance(forces.load, str):
        return draw_loads(uniform, settings)
    loads = np.array(forces.load)
    return _single(loads[chosen_index(uniform[:, 0], len(loads))])


def _pulse(
    pulse: ForcePulse | None, parts: dict[str, Float64], go: NDArray[np.int32]
) -> tuple[Float64, NDArray[np.int32]]:
    """Return the pulses (n, 2) (N) and their windows (n, 2), which lie past the trial where there is none."""
    n = len(go)
    if pulse is None:
        return np.zeros((n, 2)), np.full((n, 2), NEVER, dtype=np.int32)
    forces = _around(pulse.force) if isinstance(pulse.force, Directions) else np.array(pulse.force)
    comes = (go < NEVER) & (parts["pulsed"][:, 0] < pulse.share)
    first = np.where(comes, go + _steps(pulse.at, parts["pulse_at"]), NEVER)
    window = np.stack([first, np.where(comes, first + pulse.steps, NEVER)], axis=1)
    chosen = forces[chosen_index(parts["pulse"][:, 0], len(forces))]
    return np.where(comes[:, None], chosen, 0.0), window.astype(np.int32)


def _around(directions: Directions) -> Float64:
    angles = 2 * np.pi * np.arange(directions.directions) / directions.directions
    return np.asarray(directions.size * np.stack([np.cos(angles), np.sin(angles)], axis=1))


def _steps(bounds: tuple[int, int], uniform: Float64) -> NDArray[np.intp]:
    first, last = bounds
    return first + chosen_index(uniform[:, 0], last - first + 1)


def _single(values: Float64) -> NDArray[np.float32]:
    return np.asarray(values, dtype=np.float32)
