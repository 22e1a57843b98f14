"""The trials of one arm, drawn from what an experiment says of it and from uniform numbers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from bilateral_rl.envs.draws import draw_loads
from bilateral_rl.envs.experiments.assignment import Assignment, Cues, TargetJump
from bilateral_rl.envs.experiments.drawn_places import chosen_index, draw_postures
from bilateral_rl.envs.experiments.forces import Directions, ForcePulse, Forces
from bilateral_rl.envs.experiments.standing import StandingArm
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.task import NEVER, HandForces, Timeline, Trials

Float64 = NDArray[np.float64]
Parts = Mapping[str, Float64]
NUMBERS = {
    "start": 2, "target": 2, "load": 2, "go": 1, "no_go": 1, "jumps": 1, "jump_at": 1, "jump_to": 2,
    "pulsed": 1, "pulse_at": 1, "pulse": 1, "condition": 1,
}  # fmt: skip
"""How many uniform numbers each part of a trial takes, in their order. All are drawn whether a part is there or not, so
that experiments which differ in one part have the same trials but for that part."""
CHOICES = ("start", "target", "load", "jump_to", "pulse")
"""The parts of which places and forces are chosen; the others say when something comes, and whether it does."""


def draw_assignment(assignment: Assignment, parts: Parts, arm: StandingArm, settings: TrialSettings) -> Trials:
    """Return ``n`` trials of one arm, with a timeline and forces in any case, in the frame in which the arm stands.

    Args:
        assignment: what the arm does.
        parts: (n, …) uniform numbers of each of :data:`NUMBERS`.
        arm: whose joints and links, in whose place.
        settings: how trials run.
    """
    start = draw_postures(assignment.start, parts["start"], arm)
    hand = arm.hand_position(start)
    goal = start
    if not isinstance(assignment.target, str):
        goal = draw_postures(assignment.target, parts["target"], arm, center=hand)
    forces = assignment.forces or Forces()
    timeline = _timeline(assignment, parts, goal, hand, arm)
    return Trials(
        start=_single(start),
        goal=_single(goal),
        load=_load(forces, parts["load"], settings),
        timeline=timeline,
        forces=_forces(forces, parts, timeline, hand, arm.hand_position(goal)),
    )


def _timeline(assignment: Assignment, parts: Parts, goal: Float64, hand: Float64, arm: StandingArm) -> Timeline:
    cues = assignment.timeline or Cues()
    n = len(goal)
    comes = parts["no_go"][:, 0] >= cues.no_go_share
    go = np.where(comes, _steps(cues.go, parts["go"]), NEVER)
    jump, jump_goal = np.full(n, NEVER), goal
    if cues.jump is not None:
        jumps = comes & (parts["jumps"][:, 0] < cues.jump.share)
        jump = np.where(jumps, go + _steps(cues.jump.at, parts["jump_at"]), NEVER)
        jump_goal = _jump_goal(assignment, cues.jump, parts["jump_to"], goal, hand, arm)
    return Timeline(go.astype(np.int32), jump.astype(np.int32), _single(jump_goal))


def _jump_goal(
    assignment: Assignment, jump: TargetJump, uniform: Float64, goal: Float64, hand: Float64, arm: StandingArm
) -> Float64:
    if jump.target is not None:
        return draw_postures(jump.target, uniform, arm, center=hand)
    offsets = np.array(jump.offset)
    positions = arm.hand_position(goal) + offsets[chosen_index(uniform[:, 0], len(offsets))]
    target = assignment.target
    return arm.postures(positions, "positive" if isinstance(target, str) else target.elbow)


def _forces(forces: Forces, parts: Parts, timeline: Timeline, hand: Float64, target: Float64) -> HandForces:
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
    pulse, window = _pulse(forces.pulse, parts, timeline.go)
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


def _pulse(pulse: ForcePulse | None, parts: Parts, go: NDArray[np.int32]) -> tuple[Float64, NDArray[np.int32]]:
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
