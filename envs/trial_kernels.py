"""One thread a trial, of one arm or two: they start, step, sense and reward, for the environments (forward only)."""

import functools
from typing import Any, NamedTuple

import warp as wp

from bilateral_rl.envs.arm.hand_force import hand_force, is_within
from bilateral_rl.envs.arm.hand_spring import distance_spring, seen_from_other_arm, vector_spring
from bilateral_rl.envs.arm.muscles import activate, muscle_torque, muscles_at, proprioception, resting_muscles
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

HAND = 2 * N_MUSCLES
"""Where the own hand stands in what an arm sees."""
N_VIEW = HAND + 8
"""Numbers that each of two arms sees: its muscles, then x and y of its hand, the other's, its target, the other's."""


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
def sense(p: Parameters, s: TrialArrays, arm: int, clock: int, slot: int) -> None:
    """Write what arm ``arm`` senses after ``clock`` steps into ``slot`` of its ring."""
    sensed_now = proprioception(p, s.muscle[arm])
    row = clock % s.noise.shape[1]
    for k in range(2 * N_MUSCLES):
        s.sensed[arm, slot, k] = sensed_now[k] + s.noise[arm, row, k]
    for axis in range(2):
        s.sensed[arm, slot, 2 * N_MUSCLES + axis] = s.hand[arm][axis] + s.noise[arm, row, 2 * N_MUSCLES + axis]


@wp.func
def slot_before(s: TrialArrays, newest: int, steps: int) -> int:
    """Return the slot of the ring that was written ``steps`` before ``newest``; a remainder would take longer."""
    slot = newest - steps
    if slot < 0:
        slot += s.sensed.shape[1]
    return slot


@wp.func
def observe(s: TrialArrays, trial: int, arm: int, newest: int, first: int, targets: int) -> None:
    """Write what arm ``arm`` sees of itself, kept within its space, from the ring whose slot ``newest`` is the last.

    In the observation of its trial it begins at ``first``, and its target stands at ``targets``.
    """
    slot = slot_before(s, newest, s.muscle_delay)
    for k in range(N_SENSED):
        seen = s.sensed[arm, slot, k]
        s.observation[trial, first + k] = wp.clamp(seen, s.observation_low[first + k], s.observation_high[first + k])
    for axis in range(2):
        s.observation[trial, targets + axis] = s.target[arm][axis]


@wp.func
def see_hand(s: TrialArrays, trial: int, arm: int, newest: int, first: int) -> None:
    """Write the seen hand anew, which lags by a delay of its own."""
    slot = slot_before(s, newest, s.hand_delay)
    for k in range(2 * N_MUSCLES, N_SENSED):
        seen = s.sensed[arm, slot, k]
        s.observation[trial, first + k] = wp.clamp(seen, s.observation_low[first + k], s.observation_high[first + k])


@wp.func
def see_other_arm(s: TrialArrays, trial: int, shoulder_distance: float) -> None:
    """Show either arm the hand and the target of the other one, as that sees them, in its own frame."""
    for arm in range(2):
        for thing in range(2):  # hand, target
            at = HAND + 4 * thing
            x = s.observation[trial, (1 - arm) * N_VIEW + at]
            s.observation[trial, arm * N_VIEW + at + 2] = -x - shoulder_distance
            s.observation[trial, arm * N_VIEW + at + 3] = s.observation[trial, (1 - arm) * N_VIEW + at + 1]


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
def start_forces(b: TrialRows, f: ForceArrays, i: int, arm: int) -> None:
    """Take over the forces of trial ``i``."""
    f.force[arm] = b.load[i]
    f.offset[arm] = b.offset[i]
    f.velocity_gain[arm] = b.velocity_gain[i]
    f.position_gain[arm] = b.position_gain[i]
    f.pulse[arm] = b.pulse[i]
    f.pulse_window[arm] = b.pulse_window[i]


@wp.func
def moving_force(f: ForceArrays, arm: int, step: int, cartesian: vec4) -> vec2:
    """Return the force (N) beside the load on a hand of position and velocity ``cartesian`` in ``step``."""
    force = hand_force(cartesian, f.offset[arm], f.velocity_gain[arm], f.position_gain[arm])
    window = f.pulse_window[arm]
    if is_within(step, window[0], window[1]):
        force += f.pulse[arm]
    return force


@wp.func
def start_spring(b: TrialRows, s: TrialArrays, f: ForceArrays, i: int, trial: int) -> None:
    """Take over the spring of trial ``i``, at rest where the hands start."""
    f.stiffness[trial] = b.stiffness[i]
    f.damping[trial] = b.damping[i]
    own, other = s.hand[2 * trial], s.hand[2 * trial + 1]
    seen = seen_from_other_arm(vec4(other[0], other[1], 0.0, 0.0), f.shoulder_distance)
    f.rest[trial] = vec2(seen[0] - own[0], seen[1] - own[1])
    for arm in range(2):
        f.force[2 * trial + arm] = s.load[2 * trial + arm]


@wp.func
def spring_force(f: ForceArrays, trial: int, own: vec4, other: vec4) -> vec2:
    """Return the force (N) of the spring on the dominant hand, each hand in its own arm's frame."""
    seen = seen_from_other_arm(other, f.shoulder_distance)
    stiffness, damping = f.stiffness[trial], f.damping[trial]
    if f.of_distance:
        return distance_spring(own, seen, f.rest[trial], stiffness, damping)
    return vector_spring(own, seen, f.rest[trial], stiffness, damping)


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
    both, moving = arms > 1, forces or arms > 1

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
        if moving:  # before any arm moves, so that the forces of both hands are of the same moment
            for a in range(arms):
                arm = trial * arms + a
                force = s.load[arm]
                if forces:
                    force = force + moving_force(f, arm, clock, hand(p, s.joint[arm]))
                f.force[arm] = force
        if both:
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
            if moving:
                force = f.force[arm]
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
