"""Parts of a rollout's step that depend on its features, as Warp functions: target, force and loss terms."""

import functools
from typing import Any, NamedTuple

import warp as wp

from bilateral_rl.bptt.features import Features
from bilateral_rl.bptt.rollout_structs import n_terms, rollout_structs
from bilateral_rl.envs.arm.hand_force import is_within
from bilateral_rl.envs.arm.physics import arm_types
from bilateral_rl.envs.arm.physics import hand as hand_state
from bilateral_rl.envs.reward import further_terms, step_terms


class StepFunctions(NamedTuple):
    """Warp functions; ``hand`` is a hand's index, ``t`` a step of its trial."""

    at_rest: Any
    """The joint state at rest at two angles."""
    seen_target: Any
    """The target that is seen before a step, and by which the step is judged."""
    steady_force: Any
    """What of the force on the hand in a step does not depend on its motion: load, pulse, offsets of fields."""
    within: Any
    """Whether the error of a step counts, as a factor."""
    all_terms: Any
    """All six terms of a step's loss."""


@functools.cache
def step_functions(real: Any, features: Features) -> StepFunctions:
    """Return the functions in precision ``real``."""
    _, vec2, vec4, vec6, _, Parameters = arm_types(real)
    Trials = rollout_structs(real, features.further_losses).Trials
    vec_terms = wp.types.vector(n_terms(True), real)
    has_timeline, has_forces = features.timeline, features.forces

    @wp.func
    def at_rest(start: vec2) -> vec4:
        """Return the joint state at rest at the angles ``start``."""
        return vec4(start[0], start[1], real(0.0), real(0.0))

    @wp.func
    def seen_target(p: Parameters, trials: Trials, hand: int, t: int) -> vec2:
        """Return where the target is seen before step ``t`` (m): where the hand starts, until the cue comes."""
        if has_timeline:
            if t >= trials.jump[hand]:
                return trials.jump_target[hand]
            if t < trials.go[hand]:
                position = hand_state(p, at_rest(trials.start[hand]))
                return vec2(position[0], position[1])
        return trials.target[hand]

    @wp.func
    def steady_force(trials: Trials, hand: int, t: int) -> vec2:
        """Return the force (N) in step ``t`` on a hand at rest in the origin, but for the spring's."""
        force = trials.load[hand]
        if has_forces:
            force = force + trials.offset[hand]
            if is_within(t, trials.pulse_window[hand, 0], trials.pulse_window[hand, 1]):
                force = force + trials.pulse[hand]
        return force

    @wp.func
    def within(t: int, counts_from: int) -> real:
        """Return 1 in steps whose errors count, else 0."""
        return wp.where(t >= counts_from, real(1.0), real(0.0))

    @wp.func
    def all_terms(
        error: vec2, velocity: vec2, excitation: vec6, change: vec6, relative_force: vec6, counts: real
    ) -> vec_terms:
        """Return all six terms; those of error and speed of the hand are multiplied by ``counts``."""
        papers = step_terms(error, excitation)
        others = further_terms(velocity, change, relative_force)
        return vec_terms(counts * papers[0], counts * papers[1], papers[2], counts * others[0], others[1], others[2])

    return StepFunctions(at_rest, seen_target, steady_force, within, all_terms)
