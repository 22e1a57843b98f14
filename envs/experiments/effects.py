"""What a file says and no trial would show. A test may set a share or a size to 0; in a file it is a slip."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from bilateral_rl.envs.experiments.assignment import Assignment, Cues
from bilateral_rl.envs.experiments.experiment import Experiment
from bilateral_rl.envs.experiments.forces import Directions, Forces

_OF_ONE_TASK = ("roles", "reach")
"""Settings of two arms that an experiment has no use for, as it says itself who does what."""


def without_effect(experiment: Experiment) -> Iterator[tuple[str, str]]:
    """Yield the fields of an experiment that act in none of its trials, each with a sentence that says so."""
    for within, assignment in experiment.assignments.items():
        for name, sentence in _of_assignment(assignment):
            yield within + name, sentence
    two_arms = experiment.trial.get("two_arms")
    if two_arms is not None and experiment.arms is None:
        yield "trial.two_arms", "has no effect on one arm: give arms, or leave it out."
    for name in _OF_ONE_TASK:
        if isinstance(two_arms, Mapping) and name in two_arms:
            yield f"trial.two_arms.{name}", "has no effect where arms says what each arm does: leave it out."


def _of_assignment(assignment: Assignment) -> Iterator[tuple[str, str]]:
    if assignment.timeline is not None:
        yield from _of_timeline(assignment.timeline)
    if assignment.forces is not None:
        yield from _of_forces(assignment.forces)


def _of_timeline(cues: Cues) -> Iterator[tuple[str, str]]:
    if cues.no_go_share == 1:
        yield "timeline.no_go_share", "must be below 1, as no trial would have a target to reach for."
    if cues == Cues():
        yield "timeline", "says nothing: give go, no_go_share or jump, or leave it out."
    if cues.jump is not None:
        yield from _at_0("timeline.jump.share", cues.jump.share)
        yield from _at_0("timeline.jump.offset", *(cues.jump.offset or [(1.0, 1.0)]))


def _of_forces(forces: Forces) -> Iterator[tuple[str, str]]:
    if forces == Forces():
        yield "forces", "says nothing: give a force, or leave it out."
    if not isinstance(forces.load, str | None):
        yield from _at_0("forces.load", *forces.load)
    if forces.has_field:
        yield from _of_field(forces)
    if forces.pulse is not None:
        pulse = forces.pulse.force
        yield from _at_0("forces.pulse.share", forces.pulse.share)
        if isinstance(pulse, Directions):
            yield from _at_0("forces.pulse.force.size", pulse.size)
        else:
            yield from _at_0("forces.pulse.force", *pulse)
    if forces.channel is not None:
        yield from _at_0("forces.channel.share", forces.channel.share)
        yield from _at_0("forces.channel.stiffness", forces.channel.stiffness, forces.channel.damping)


def _of_field(forces: Forces) -> Iterator[tuple[str, str]]:
    if forces.curl is not None:
        yield from _at_0("forces.curl", forces.curl)
    if forces.velocity_field is not None:
        yield from _at_0("forces.velocity_field", *forces.velocity_field)
    if forces.elastic_field is not None:
        yield from _at_0("forces.elastic_field.stiffness", *forces.elastic_field.stiffness)
    channel = 0.0 if forces.channel is None else forces.channel.share
    if channel + forces.field_off_share >= 1:
        yield (
            "forces",
            "would have no trial with its field: give channel.share and field_off_share less than 1 together, got "
            f"{channel:g} and {forces.field_off_share:g}.",
        )


def _at_0(name: str, *values: float | tuple[float, float]) -> Iterator[tuple[str, str]]:
    numbers = [number for value in values for number in (value if isinstance(value, tuple) else (value,))]
    if not any(numbers):
        yield name, "has no effect at 0: leave it out, or give another number."
