"""The spring between the hands of a rollout's trials, and its adjoint, as Warp functions."""

import functools
from typing import Any, NamedTuple

import warp as wp

from bilateral_rl.bptt.features import Features
from bilateral_rl.bptt.rollout_structs import rollout_structs
from bilateral_rl.envs.arm import hand_spring
from bilateral_rl.envs.arm.hand_spring import seen_from_other_arm
from bilateral_rl.envs.arm.physics import arm_types


class SpringFunctions(NamedTuple):
    """Warp functions; hands are (4,), position and velocity, each in the own frame of its arm."""

    spring_force: Any
    """The force on a hand."""
    spring_slopes: Any
    """Its partial derivatives by the other hand's position and velocity, both in the own hand's frame."""
    back_to_other_hand: Any
    """The gradient by the other hand, in that one's own frame, from that by the force."""


@functools.cache
def spring_functions(real: Any, features: Features) -> SpringFunctions:
    """Return the functions in precision ``real``, of the kind of spring that ``features`` say."""
    _, vec2, vec4, _, _, _ = arm_types(real)
    structs = rollout_structs(real, features.further_losses)
    Trials, mat22 = structs.Trials, structs.mat22
    force = hand_spring.distance_spring if features.distance_spring else hand_spring.vector_spring
    slopes = hand_spring.distance_spring_slopes if features.distance_spring else hand_spring.vector_spring_slopes

    @wp.func
    def at_start(trials: Trials, own: vec4, other: vec4) -> vec2:
        """Return what the spring holds: the vector from hand to hand at the start."""
        mirrored = seen_from_other_arm(other, trials.shoulder_distance)
        return vec2(mirrored[0] - own[0], mirrored[1] - own[1])

    @wp.func
    def spring_force(
        trials: Trials, trial: int, own: vec4, other: vec4, own_started: vec4, other_started: vec4
    ) -> vec2:
        """Return the force (N) on a hand."""
        return force(
            own,
            seen_from_other_arm(other, trials.shoulder_distance),
            at_start(trials, own_started, other_started),
            trials.stiffness[trial],
            trials.damping[trial],
        )

    @wp.func
    def spring_slopes(
        trials: Trials, trial: int, own: vec4, other: vec4, own_started: vec4, other_started: vec4
    ) -> tuple[mat22, mat22]:
        """Return the partial derivatives of the force by the other hand's position and velocity."""
        by_position, by_velocity = slopes(
            own,
            seen_from_other_arm(other, trials.shoulder_distance),
            at_start(trials, own_started, other_started),
            trials.stiffness[trial],
            trials.damping[trial],
        )
        return by_position, by_velocity

    @wp.func
    def back_to_other_hand(by_position: mat22, by_velocity: mat22, d_force: vec2) -> vec4:
        """Return the gradient by the other hand, mirrored back into its own frame."""
        position = wp.transpose(by_position) * d_force
        velocity = wp.transpose(by_velocity) * d_force
        return vec4(-position[0], position[1], -velocity[0], velocity[1])

    return SpringFunctions(spring_force, spring_slopes, back_to_other_hand)
