"""What an experiment asks of the arm and of the length of a trial, which other settings may change."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.draws import springs
from bilateral_rl.envs.experiments.assignment import Assignment, Cues
from bilateral_rl.envs.experiments.drawn_places import check_place, listed_hands, number_listed
from bilateral_rl.envs.experiments.exchanged import mirrored_gains
from bilateral_rl.envs.experiments.experiment import Experiment
from bilateral_rl.envs.experiments.forces import Directions, Forces
from bilateral_rl.envs.experiments.places import Place
from bilateral_rl.envs.experiments.standing import StandingArm, standing_arms
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.stability import check_spring, check_stability
from bilateral_rl.envs.task import HandForces

_APART = 1e-6
"""Positions that are nearer to each other count as one (m)."""
_MOST_PLACES = 10**6
"""Of listed places, far beyond use: each of them is tried."""


class UnfitExperimentError(ValueError):
    """An experiment that cannot run with given settings.

    Attributes:
        field: what of it, such as "timeline.go".
        reason: why not.
    """

    def __init__(self, field: str, reason: str) -> None:
        self.field, self.reason = field, reason
        super().__init__(f"{field}{' ' if reason.startswith('must') else ': '}{reason.rstrip('.')}.")


def check_experiment(experiment: Experiment, settings: TrialSettings) -> None:
    """Raise an :class:`UnfitExperimentError` unless all trials of an experiment can run with ``settings``.

    Of places that are drawn from a region, its rim and a fine grid are tried.
    """
    arms = standing_arms(1 if experiment.arms is None else 2, settings)
    for (within, assignment), arm in zip(experiment.assignments.items(), arms, strict=True):
        try:
            _check_assignment(assignment, arm, settings.trial_length)
        except UnfitExperimentError as error:
            raise UnfitExperimentError(within + error.field, error.reason) from None
    if experiment.paired:
        _check_pairs(*experiment.assignments.values())
    if experiment.arms is not None:
        try:
            check_spring(springs(1, settings), settings.arm)
        except ValueError as error:
            raise UnfitExperimentError("trial.two_arms.spring", str(error)) from None


def _check_pairs(dominant: Assignment, non_dominant: Assignment) -> None:
    """Refuse lists of different lengths, of which one could not take the first with the first."""
    for name, one, other in zip(_LISTED, _lengths(dominant), _lengths(non_dominant), strict=True):
        if one != other and 1 not in (one, other):
            raise UnfitExperimentError("paired", f"needs as many {name} of both arms, got {one} and {other}")


_LISTED = ("starts", "targets", "loads", "places to jump to", "pulses")


def _lengths(assignment: Assignment) -> tuple[int, ...]:
    """Return how many of each of ``_LISTED`` an arm chooses from; 1 where it does not choose from a list."""
    forces, cues = assignment.forces or Forces(), assignment.timeline or Cues()
    target = None if isinstance(assignment.target, str) else number_listed(assignment.target)
    jumps: int | None = None
    if cues.jump is not None:
        jumps = number_listed(cues.jump.target) if cues.jump.target is not None else len(cues.jump.offset or ())
    pulse = None if forces.pulse is None else forces.pulse.force
    loads = None if isinstance(forces.load, str | None) else len(forces.load)
    pulses = None if pulse is None else pulse.directions if isinstance(pulse, Directions) else len(pulse)
    return tuple(n or 1 for n in (number_listed(assignment.start), target, loads, jumps, pulses))


def _check_assignment(assignment: Assignment, arm: StandingArm, length: int) -> None:
    _check_times(assignment, length)
    starts = _check_starts(assignment, arm)
    targets = _check_targets(assignment, arm, starts)
    _check_channel(assignment, starts, targets)
    _check_forces(assignment, arm)


def _check_forces(assignment: Assignment, arm: StandingArm) -> None:
    """Refuse fields and walls in which the time step alone makes the hand swing."""
    forces = assignment.forces
    if forces is None:
        return
    stiffness = np.zeros((2, 2)) if forces.elastic_field is None else np.array(forces.elastic_field.stiffness)
    walls = (0.0, 0.0) if forces.channel is None else (forces.channel.stiffness, forces.channel.damping)
    kinds = ("curl", "velocity_field", "elastic_field")
    field = next((kind for kind in kinds if getattr(forces, kind) is not None), None)
    for name, velocity_gain, position_gain, of_walls in (
        (field, np.array(forces.velocity_matrix), stiffness, (0.0, 0.0)),
        ("channel", np.zeros((2, 2)), np.zeros((2, 2)), walls),
    ):
        own = [gain if arm.outward > 0 else mirrored_gains(gain) for gain in (velocity_gain, position_gain)]
        rows = [gain.astype(np.float32)[None] for gain in own]
        still = np.zeros((1, 2), dtype=np.float32)
        window = np.zeros((1, 2), dtype=np.int32)
        try:
            check_stability(
                HandForces(rows[0], rows[1], still, still, window, np.array([of_walls], dtype=np.float32)),
                arm.physics,
            )
        except ValueError as error:
            frame = "" if arm.outward > 0 else "in the arm's own frame, "
            raise UnfitExperimentError(f"forces.{name}", f"{frame}{error}") from None


def _check_times(assignment: Assignment, length: int) -> None:
    cues, forces = assignment.timeline, assignment.forces
    go = 0 if cues is None else cues.go[1]
    if go >= length:
        raise UnfitExperimentError("timeline.go", f"must come within the trial of {length} steps, got {go}")
    if cues is not None and cues.jump is not None and (last := go + cues.jump.at[1]) >= length:
        raise UnfitExperimentError(
            "timeline.jump.at", f"must come within the trial of {length} steps, got step {last} at the latest"
        )
    pulse = None if forces is None else forces.pulse
    if pulse is not None and (end := go + pulse.at[1] + pulse.steps) > length:
        raise UnfitExperimentError(
            "forces.pulse", f"must end within the trial of {length} steps, got step {end} at the latest"
        )


def _check_starts(assignment: Assignment, arm: StandingArm) -> NDArray[np.float64] | None:
    """Return the positions (k, 2) of the hand at all starts; None where they are drawn from a region."""
    around = assignment.start.center_out
    if around is not None and around.center is None:
        raise UnfitExperimentError("start.center_out.center", "must be given: a start has no start to lie around")
    return _checked(assignment.start, "start", arm, None)


def _check_targets(
    assignment: Assignment, arm: StandingArm, starts: NDArray[np.float64] | None
) -> NDArray[np.float64] | None:
    """Return the positions (k, 2) of all targets; None where they are drawn from a region, or are the start."""
    targets = starts
    if not isinstance(assignment.target, str):
        targets = _checked(assignment.target, "target", arm, starts)
    jump = None if assignment.timeline is None else assignment.timeline.jump
    if jump is None:
        return targets
    if jump.target is not None:
        _checked(jump.target, "timeline.jump.target", arm, starts)
    elif targets is None:
        raise UnfitExperimentError(
            "timeline.jump.offset",
            "needs targets that are listed, as one that is drawn from a region may jump out of reach: give a target",
        )
    elif len(targets) * len(jump.offset or ()) > _MOST_PLACES:
        raise UnfitExperimentError(
            "timeline.jump.offset", f"makes more than {_MOST_PLACES:,} places of all targets: give fewer"
        )
    else:
        elbow = "positive" if isinstance(assignment.target, str) else assignment.target.elbow
        try:
            arm.postures((targets[:, None] + np.array(jump.offset)).reshape(-1, 2), elbow)
        except ValueError as error:
            raise UnfitExperimentError("timeline.jump.offset", str(error)) from None
    return targets


def _checked(
    place: Place, name: str, arm: StandingArm, starts: NDArray[np.float64] | None
) -> NDArray[np.float64] | None:
    around = place.center_out
    if around is not None and around.center is None and starts is None:
        raise UnfitExperimentError(
            f"{name}.center_out", "needs a start that is one posture or a list of them, or a center of its own"
        )
    try:
        check_place(place, arm, starts)
        return listed_hands(place, arm, starts)
    except ValueError as error:
        kind = next(kind for kind in ("joints", "hand", "center_out") if getattr(place, kind) is not None)
        raise UnfitExperimentError(f"{name}.{kind}", str(error)) from None


def _check_channel(
    assignment: Assignment, starts: NDArray[np.float64] | None, targets: NDArray[np.float64] | None
) -> None:
    if assignment.forces is None or assignment.forces.channel is None or starts is None or targets is None:
        return
    around = None if isinstance(assignment.target, str) else assignment.target.center_out
    if around is not None and around.center is None:
        return  # they lie around each start
    if (np.abs(starts[:, None] - targets).max(axis=-1) < _APART).any():
        raise UnfitExperimentError("forces.channel", "needs targets that are not the start: its walls lead there")
