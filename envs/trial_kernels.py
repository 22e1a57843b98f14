"""One thread a trial, of one arm or two: they start, step, sense and reward, for the environments (forward only)."""

import functools
from typing import Any, NamedTuple

import warp as wp

from bilateral_rl.envs.arm.muscles import activate, muscle_torque, muscles_at, resting_muscles
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import ACTIVATION, FORCE, hand, next_joint
from bilateral_rl.envs.reward import StepWeights, further_terms, step_terms
from bilateral_rl.envs.trial_arrays import (
    N_SENSED,
    Features,
    ForceArrays,
    Parameters,
    TimelineArrays,
    TrialArrays,
    TrialRows,
    rows,
    vec2,
    vec4,
    vec6,
)
from bilateral_rl.envs.trial_forces import moving_force, spring_force, start_forces, start_spring
from bilateral_rl.envs.trial_senses import HAND, N_VIEW, observe, see_hand, see_other_arm, sense


class TrialKernels(NamedTuple):
    """The kernels of one set of features, and the name of the module that holds both."""

    start: wp.Kernel
    """``TrialRows`` begin."""
    step: wp.Kernel
    """One step of every trial that runs."""
    module: str


@wp.func
def hand_position(p: Parameters, joint: vec4) -> vec2:
    """Return hand x, y (m)."""
    cartesian = hand(p, joint)
    return vec2(cartesian[0], cartesian[1])


@wp.func
def at_rest(angles: vec2) -> vec4:
    """Return the joint state at rest at these angles (rad)."""
    return vec4(angles[0], angles[1], 0.0, 0.0)


@wp.func
def start_timeline(p: Parameters, b: TrialRows, s: TrialArrays, t: TimelineArrays, i: int, arm: int) -> None:
    """Let arm ``arm`` see the first target of trial ``i``: where it stands, unless the cue comes at once."""
    t.go[arm] = b.go[i]
    t.jump[arm] = b.jump[i]
    t.goal_target[arm] = hand_position(p, at_rest(b.goal[i]))
    t.jump_target[arm] = hand_position(p, at_rest(b.jump_goal[i]))
    s.target[arm] = s.hand[arm]
    t.onset[arm] = s.distance.shape[1]
    s.start_distance[arm] = 0.0
    follow_timeline(s, t, arm, 0)


@wp.func
def follow_timeline(s: TrialArrays, t: TimelineArrays, arm: int, step: int) -> None:
    """Change the target that arm ``arm`` sees before ``step``, if it is time.

    After the last step it stays: no step would be judged by another.
    """
    if step < s.distance.shape[1] and (step == t.go[arm] or step == t.jump[arm]):
        target = t.goal_target[arm]
        if step == t.jump[arm]:
            target = t.jump_target[arm]
        s.target[arm] = target
        t.onset[arm] = step
        s.start_distance[arm] = wp.length(s.hand[arm] - target)


@wp.func
def relative_force(p: Parameters, muscle: rows) -> vec6:
    """Return muscle forces over the maximal isometric ones."""
    relative = vec6()
    for m in range(N_MUSCLES):
        relative[m] = muscle[FORCE, m] / p.max_isometric_force[m]
    return relative


@functools.cache
def trial_kernels(features: Features) -> TrialKernels:
    """Return the kernels for trials with ``features``; each set is compiled when it is first used."""
    arms, timeline, forces, further, two_delays = features
    numbers = {"two_arms": arms > 1, **features._asdict(), "arms": False}
    name = ".".join(("bilateral_rl.trials", *(field for field, has in numbers.items() if has)))
    view, target_at = (N_VIEW, HAND + 4) if arms > 1 else (0, N_SENSED)
    both, moving_alone = arms > 1, forces and arms == 1

    @wp.kernel(module=name, enable_backward=False)
    def start_trials(
        p: Parameters,
        b: TrialRows,
        trials: wp.array(dtype=wp.int32),
        s: TrialArrays,
        t: TimelineArrays,
        f: ForceArrays,
    ) -> None:
        """Put the arms of ``trials`` at rest at the start postures, with targets where goal postures have the hand."""
        i = wp.tid()
        trial = trials[i]
        s.clock[trial] = 0
        s.vector_return[trial] = vec2(0.0, 0.0)
        for a in range(arms):
            row = i * arms + a
            arm = trial * arms + a
            joint = at_rest(b.start[row])
            position = hand_position(p, joint)
            s.joint[arm] = joint
            s.muscle[arm] = resting_muscles(p, joint)
            s.hand[arm] = position
            s.load[arm] = b.load[row]
            if timeline:
                start_timeline(p, b, s, t, row, arm)
            else:
                target = hand_position(p, at_rest(b.goal[row]))
                s.target[arm] = target
                s.start_distance[arm] = wp.length(position - target)
            if forces:
                start_forces(b, f, row, arm)
            for slot in range(s.sensed.shape[1]):
                sense(p, s, arm, 0, slot)
            observe(s, trial, arm, 0, a * view, a * view + target_at)  # all slots hold the same
        if both:
            start_spring(b, s, f, i, trial)
            see_other_arm(s, trial, f.shoulder_distance)

    @wp.kernel(module=name, enable_backward=False)
    def step_trials(
        p: Parameters,
        weights: StepWeights,
        action: wp.array(dtype=vec6),
        s: TrialArrays,
        t: TimelineArrays,
        f: ForceArrays,
    ) -> None:
        """One step of every trial that runs: actions in [-1, 1] become excitations in [0, 1]. Others stand still."""
        trial = wp.tid()
        clock = s.clock[trial]
        if clock < 0 or clock >= s.distance.shape[1]:  # also what keeps a clock that was tampered with in the arrays
            s.reward[trial] = 0.0
            s.vector_reward[trial] = vec2(0.0, 0.0)
            return
        noise_row = clock % s.noise.shape[1]
        newest = (clock + 1) % s.sensed.shape[1]
        if both:  # before any arm moves, so that the forces of both hands are of the same moment
            for a in range(arms):
                arm = trial * arms + a
                force = s.load[arm]
                if forces:
                    force = force + moving_force(f, arm, clock, hand(p, s.joint[arm]))
                f.force[arm] = force
            pull = spring_force(f, trial, hand(p, s.joint[2 * trial]), hand(p, s.joint[2 * trial + 1]))
            f.force[2 * trial] = f.force[2 * trial] + pull
            f.force[2 * trial + 1] = f.force[2 * trial + 1] + vec2(pull[0], -pull[1])  # the opposite one, mirrored
        loss = vec2(0.0, 0.0)
        for a in range(arms):
            arm = trial * arms + a
            excitation = vec6()
            driven = vec6()
            for m in range(N_MUSCLES):
                excitation[m] = 0.5 * (wp.clamp(action[arm][m], -1.0, 1.0) + 1.0)
                driven[m] = excitation[m] + s.noise[arm, noise_row, N_SENSED + m]
            before = s.joint[arm]
            muscle = s.muscle[arm]
            force = s.load[arm]
            if both:
                force = f.force[arm]
            if moving_alone:  # here, where sines and cosines of the posture are at hand
                force = force + moving_force(f, arm, clock, hand(p, before))
                f.force[arm] = force
            after = next_joint(p, before, muscle_torque(p, before, muscle[FORCE]), force)
            s.joint[arm] = after
            s.muscle[arm] = muscles_at(p, before, activate(p, muscle[ACTIVATION], driven))
            position = hand_position(p, after)
            s.hand[arm] = position

            error = position - s.target[arm]
            terms = step_terms(error, excitation)
            if further:
                change = excitation - s.excitation[arm]
                if clock == 0:
                    change = vec6()
                velocity = hand(p, after)
                others = further_terms(vec2(velocity[2], velocity[3]), change, relative_force(p, s.muscle[arm]))
                if clock < weights.first_counted:
                    terms[0] = 0.0
                    terms[1] = 0.0
                    others[0] = 0.0
                loss += weights.terms * terms + weights.further * others
            else:
                loss += weights.terms * terms
            s.excitation[arm] = excitation
            s.distance[arm, clock] = wp.length(error)
            if timeline:
                follow_timeline(s, t, arm, clock + 1)
            sense(p, s, arm, clock + 1, newest)
            observe(s, trial, arm, newest, a * view, a * view + target_at)
            if two_delays:
                see_hand(s, trial, arm, newest, a * view)
        if both:
            loss = 0.5 * loss  # the terms are means over both arms
            see_other_arm(s, trial, f.shoulder_distance)
        reward = -loss
        s.clock[trial] = clock + 1
        s.vector_reward[trial] = reward
        s.reward[trial] = 0.5 * (reward[0] + reward[1])
        s.vector_return[trial] = s.vector_return[trial] + reward

    return TrialKernels(start_trials, step_trials, name)


def load_kernels(kernels: TrialKernels, device: Any) -> None:
    """Compile (first time) or load both kernels for ``device``."""
    wp.load_module(kernels.module, device=device)
