"""What the arms of a rollout sense, with noise and delays, and how it becomes an observation, as Warp functions."""

import functools
from typing import Any, NamedTuple

import warp as wp

from bilateral_rl.bptt.features import Features
from bilateral_rl.bptt.network_kernels import NetworkShape, network_types
from bilateral_rl.bptt.rollout_structs import HAND, N_SENSED, View, rollout_structs
from bilateral_rl.bptt.step_kernels import step_functions
from bilateral_rl.envs.arm.hand_spring import seen_from_other_arm
from bilateral_rl.envs.arm.muscles import proprioception, resting_muscles
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import arm_types
from bilateral_rl.envs.arm.physics import hand as hand_state


class SenseFunctions(NamedTuple):
    """Warp functions; ``hand`` is a hand's index, ``t`` a step of its trial."""

    sense: Any
    """What an arm senses before a step."""
    show: Any
    """An observation with what an arm senses, and its target, in the views of all arms."""
    by_sensed: Any
    """The gradient by what an arm senses, from that by the observation."""
    sensed_later: Any
    """The gradient by what is so before a step, from that by what is sensed then."""
    driven: Any
    """What drives the muscles in a step."""


@functools.cache
def sense_functions(real: Any, shape: NetworkShape, features: Features) -> SenseFunctions:
    """Return the functions in precision ``real``, for networks of ``shape``."""
    _, vec2, vec4, vec6, _, Parameters = arm_types(real)
    structs = rollout_structs(real, features.further_losses)
    Trials, Senses, Trajectories = structs.Trials, structs.Senses, structs.Trajectories
    CarriedGradients, vec_felt, vec_sensed = structs.CarriedGradients, structs.vec_felt, structs.vec_sensed
    vec_in = network_types(real, shape).vec_in
    at_rest = step_functions(real, features).at_rest
    has_senses, arms = features.senses, features.arms
    other_hand, target_at, other_target, size = View.of(arms)

    @wp.func
    def sense(
        p: Parameters,
        trials: Trials,
        senses: Senses,
        out: Trajectories,
        hand: int,
        t: int,
        n_steps: int,
        felt_now: vec_felt,
        position: vec4,
    ) -> vec_sensed:
        """Return what the arm of a hand senses before step ``t``; ``felt_now`` and ``position`` are the present ones.

        Before the trial it sensed its start, with the noise of the first step.
        """
        felt = vec_felt(felt_now)
        seen = vec2(position[0], position[1])
        felt_at = wp.max(t - senses.felt_delay, 0)
        seen_at = wp.max(t - senses.seen_delay, 0)
        if has_senses:
            start = at_rest(trials.start[hand])
            started = hand_state(p, start)
            muscle = resting_muscles(p, start)
            seen = vec2(started[0], started[1])
            if felt_at > 0:
                muscle = out.muscle[hand * n_steps + felt_at - 1]
            if seen_at > 0:
                seen = out.hand[hand * n_steps + seen_at - 1]
            felt = proprioception(p, muscle)
        sensed = vec_sensed()
        for i in range(HAND):
            sensed[i] = felt[i]
        for axis in range(2):
            sensed[HAND + axis] = seen[axis]
        if has_senses:
            for i in range(N_SENSED):
                row = hand * n_steps + felt_at
                if i >= HAND:
                    row = hand * n_steps + seen_at
                sensed[i] = wp.clamp(sensed[i] + senses.noise[row][i], senses.low[i], senses.high[i])
        return sensed

    @wp.func
    def show(observation: vec_in, trials: Trials, arm: int, sensed: vec_sensed, target: vec2) -> vec_in:
        """Return the observation with what arm ``arm`` senses, and its target, in its own view and in the other arm's.

        The other arm sees hand and target in its own frame.
        """
        shown = vec_in(observation)
        for i in range(N_SENSED):
            shown[arm * size + i] = sensed[i]
        for axis in range(2):
            shown[arm * size + target_at + axis] = target[axis]
        if arms > 1:
            other = (arms - 1 - arm) * size
            mirrored_hand = seen_from_other_arm(
                vec4(sensed[HAND], sensed[HAND + 1], real(0.0), real(0.0)), trials.shoulder_distance
            )
            mirrored_target = seen_from_other_arm(
                vec4(target[0], target[1], real(0.0), real(0.0)), trials.shoulder_distance
            )
            for axis in range(2):
                shown[other + other_hand + axis] = mirrored_hand[axis]
                shown[other + other_target + axis] = mirrored_target[axis]
        return shown

    @wp.func
    def by_sensed(d_observation: vec_in, arm: int) -> vec_sensed:
        """Return the gradient by what arm ``arm`` senses, which both arms see of its hand."""
        result = vec_sensed()
        for i in range(N_SENSED):
            result[i] = d_observation[arm * size + i]
        if arms > 1:
            other = (arms - 1 - arm) * size + other_hand
            result[HAND] = result[HAND] - d_observation[other]
            result[HAND + 1] = result[HAND + 1] + d_observation[other + 1]
        return result

    @wp.func
    def sensed_later(
        senses: Senses,
        c: CarriedGradients,
        stream: int,
        hand: int,
        t: int,
        n_steps: int,
        sensed: vec_sensed,
        d_sensed: vec_sensed,
    ) -> vec_sensed:
        """Return the gradient by what is so before step ``t``, which will be sensed in a delay.

        The gradient by what is sensed before that step belongs to what was so a delay ago, and waits in a ring. What is
        held at the bounds of an observation has none.
        """
        felt_slots = senses.felt_delay + 1
        seen_slots = senses.seen_delay + 1
        d_felt = vec_felt()
        d_seen = vec2()
        for i in range(N_SENSED):
            if sensed[i] > senses.low[i] and sensed[i] < senses.high[i]:
                if i < HAND:
                    d_felt[i] = d_sensed[i]
                else:
                    d_seen[i - HAND] = d_sensed[i]
        c.felt[stream, hand, t % felt_slots] = d_felt
        c.seen[stream, hand, t % seen_slots] = d_seen
        result = vec_sensed()
        if t + senses.felt_delay < n_steps:
            for i in range(HAND):
                result[i] = c.felt[stream, hand, (t + senses.felt_delay) % felt_slots][i]
        if t + senses.seen_delay < n_steps:
            for axis in range(2):
                result[HAND + axis] = c.seen[stream, hand, (t + senses.seen_delay) % seen_slots][axis]
        return result

    @wp.func
    def driven(senses: Senses, k: int, excitation: vec6) -> vec6:
        """Return what drives the muscles of a hand in its sample ``k``: the command, with noise where there is any."""
        result = vec6(excitation)
        if has_senses:
            for m in range(N_MUSCLES):
                result[m] = excitation[m] + senses.noise[k][N_SENSED + m]
        return result

    return SenseFunctions(sense, show, by_sensed, sensed_later, driven)
