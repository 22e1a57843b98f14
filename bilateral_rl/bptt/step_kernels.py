"""Parts of a rollout's step that depend on its features, as Warp functions: target, force, senses and loss terms."""

import functools
from typing import Any, NamedTuple

import warp as wp

from bilateral_rl.bptt.features import Features
from bilateral_rl.bptt.network_kernels import NetworkShape, network_types
from bilateral_rl.bptt.rollout_structs import HAND, N_SENSED, TARGET, n_terms, rollout_structs
from bilateral_rl.envs.arm.hand_force import is_within
from bilateral_rl.envs.arm.muscles import proprioception, resting_muscles
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import arm_types
from bilateral_rl.envs.arm.physics import hand as hand_state
from bilateral_rl.envs.reward import further_terms, step_terms


class StepFunctions(NamedTuple):
    """Warp functions; ``trial`` is a trial's index, ``t`` a step of it."""

    at_rest: Any
    """The joint state at rest at two angles."""
    seen_target: Any
    """The target that is seen before a step, and by which the step is judged."""
    steady_force: Any
    """What of the force on the hand in a step does not depend on its motion: load, pulse, offsets of fields."""
    observe: Any
    """The observation before a step."""
    sensed_later: Any
    """The gradient by what is so before a step, from that by what is observed then."""
    driven: Any
    """What drives the muscles in a step."""
    within: Any
    """Whether the error of a step counts, as a factor."""
    all_terms: Any
    """All six terms of a step's loss."""


@functools.cache
def step_functions(real: Any, shape: NetworkShape, features: Features) -> StepFunctions:
    """Return the functions in precision ``real``, for networks of ``shape``."""
    _, vec2, vec4, vec6, rows, Parameters = arm_types(real)
    structs = rollout_structs(real, features.further_losses)
    Trials, Senses, Trajectories = structs.Trials, structs.Senses, structs.Trajectories
    CarriedGradients, vec_felt = structs.CarriedGradients, structs.vec_felt
    network = network_types(real, shape)
    Activity, vec_in = network.Activity, network.vec_in
    vec_terms = wp.types.vector(n_terms(True), real)
    has_timeline, has_forces, _, has_senses, _ = features

    @wp.func
    def at_rest(start: vec2) -> vec4:
        """Return the joint state at rest at the angles ``start``."""
        return vec4(start[0], start[1], real(0.0), real(0.0))

    @wp.func
    def seen_target(p: Parameters, trials: Trials, trial: int, t: int) -> vec2:
        """Return where the target is seen before step ``t`` (m): where the hand starts, until the cue comes."""
        if has_timeline:
            if t >= trials.jump[trial]:
                return trials.jump_target[trial]
            if t < trials.go[trial]:
                position = hand_state(p, at_rest(trials.start[trial]))
                return vec2(position[0], position[1])
        return trials.target[trial]

    @wp.func
    def steady_force(trials: Trials, trial: int, t: int) -> vec2:
        """Return the force (N) in step ``t`` on a hand at rest in the origin."""
        force = trials.load[trial]
        if has_forces:
            force = force + trials.offset[trial]
            if is_within(t, trials.pulse_window[trial, 0], trials.pulse_window[trial, 1]):
                force = force + trials.pulse[trial]
        return force

    @wp.func
    def observe(
        p: Parameters,
        trials: Trials,
        senses: Senses,
        out: Trajectories,
        trial: int,
        t: int,
        n_steps: int,
        muscle: rows,
        position: vec4,
        target: vec2,
    ) -> vec_in:
        """Return what is seen before step ``t``; ``muscle`` and ``position`` are the present ones.

        Before the trial the arm sensed its start, with the noise of the first step.
        """
        observation = vec_in()
        felt = rows(muscle)
        seen = vec2(position[0], position[1])
        if has_senses:
            felt_at = wp.max(t - senses.felt_delay, 0)
            seen_at = wp.max(t - senses.seen_delay, 0)
            start = at_rest(trials.start[trial])
            started = hand_state(p, start)
            felt = resting_muscles(p, start)
            seen = vec2(started[0], started[1])
            if felt_at > 0:
                felt = out.muscle[trial * n_steps + felt_at - 1]
            if seen_at > 0:
                seen = out.hand[trial * n_steps + seen_at - 1]
        sensed = proprioception(p, felt)
        for i in range(2 * N_MUSCLES):
            observation[i] = sensed[i]
        for axis in range(2):
            observation[HAND + axis] = seen[axis]
            observation[TARGET + axis] = target[axis]
        if has_senses:
            for i in range(N_SENSED):
                row = trial * n_steps + felt_at
                if i >= HAND:
                    row = trial * n_steps + seen_at
                observation[i] = wp.clamp(observation[i] + senses.noise[row][i], senses.low[i], senses.high[i])
        return observation

    @wp.func
    def sensed_later(
        senses: Senses,
        a: Activity,
        c: CarriedGradients,
        stream: int,
        trial: int,
        t: int,
        n_steps: int,
        d_observation: vec_in,
    ) -> vec_in:
        """Return the gradient by what is so before step ``t``, which will be observed in a delay.

        The gradient by what is observed before that step belongs to what was so a delay ago, and waits in a ring. What
        is held at the bounds of an observation has none.
        """
        k = trial * n_steps + t
        felt_slots = senses.felt_delay + 1
        seen_slots = senses.seen_delay + 1
        d_felt = vec_felt()
        d_seen = vec2()
        for i in range(N_SENSED):
            if a.observation[k][i] > senses.low[i] and a.observation[k][i] < senses.high[i]:
                if i < HAND:
                    d_felt[i] = d_observation[i]
                else:
                    d_seen[i - HAND] = d_observation[i]
        c.felt[stream, trial, t % felt_slots] = d_felt
        c.seen[stream, trial, t % seen_slots] = d_seen
        result = vec_in()
        if t + senses.felt_delay < n_steps:
            for i in range(HAND):
                result[i] = c.felt[stream, trial, (t + senses.felt_delay) % felt_slots][i]
        if t + senses.seen_delay < n_steps:
            for axis in range(2):
                result[HAND + axis] = c.seen[stream, trial, (t + senses.seen_delay) % seen_slots][axis]
        return result

    @wp.func
    def driven(senses: Senses, k: int, excitation: vec6) -> vec6:
        """Return what drives the muscles: the command, with noise where there is any."""
        result = vec6(excitation)
        if has_senses:
            for m in range(N_MUSCLES):
                result[m] = excitation[m] + senses.noise[k][N_SENSED + m]
        return result

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

    return StepFunctions(at_rest, seen_target, steady_force, observe, sensed_later, driven, within, all_terms)
