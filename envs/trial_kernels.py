"""One thread an arm: trials that start, step, sense and reward, for the environments (forward only)."""

import functools
from typing import Any, NamedTuple

import warp as wp

from bilateral_rl.envs.arm.hand_force import hand_force, is_within
from bilateral_rl.envs.arm.muscles import activate, muscle_torque, muscles_at, proprioception, resting_muscles
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import ACTIVATION, FORCE, arm_types, hand, next_joint
from bilateral_rl.envs.reward import StepWeights, further_terms, step_terms

_, vec2, vec4, vec6, rows, Parameters = arm_types(wp.float32)
mat22 = wp.types.matrix((2, 2), wp.float32)
steps2 = wp.types.vector(2, wp.int32)

N_SENSED = 2 * N_MUSCLES + 2
"""Numbers that the arm senses: muscle lengths, muscle velocities, hand x and y."""
N_OBSERVED = N_SENSED + 2
"""What a controller sees: the sensed numbers and the target's x and y."""
N_NOISE = N_SENSED + N_MUSCLES
"""Normal numbers a step takes: one per sensed number, one per muscle command."""


class Features(NamedTuple):
    """What trials have beyond the paper's; without any, kernels are those of its two tasks and cost nothing more."""

    timeline: bool = False
    """A cue to go, or a target that jumps."""
    forces: bool = False
    """Forces on the hand beside the load."""
    further_terms: bool = False
    """Losses beyond the paper's three terms over all steps."""


class TrialKernels(NamedTuple):
    """The kernels of one set of features, and the name of the module that holds both."""

    start: wp.Kernel
    """``TrialRows`` begin on some arms."""
    step: wp.Kernel
    """One step of every arm in a trial."""
    module: str


@wp.struct
class TrialRows:
    """Trials that ``k`` arms begin. What a set of features does not have is empty."""

    start: wp.array(dtype=vec2)  # (k,) rad
    goal: wp.array(dtype=vec2)  # (k,) rad
    load: wp.array(dtype=vec2)  # (k,) N
    # Of a timeline:
    go: wp.array(dtype=wp.int32)  # (k,) steps
    jump: wp.array(dtype=wp.int32)  # (k,) steps
    jump_goal: wp.array(dtype=vec2)  # (k,) rad
    # Of forces:
    offset: wp.array(dtype=vec2)  # (k,) N
    velocity_gain: wp.array(dtype=mat22)  # (k,) N s/m
    position_gain: wp.array(dtype=mat22)  # (k,) N/m
    pulse: wp.array(dtype=vec2)  # (k,) N
    pulse_window: wp.array(dtype=steps2)  # (k,) first step, and first step after it


@wp.struct
class TrialArrays:
    """State and outputs of ``n`` arms, each with its own clock. T is the trial's length in steps."""

    clock: wp.array(dtype=wp.int32)  # (n,) steps taken; T: in no trial
    joint: wp.array(dtype=vec4)  # (n,)
    muscle: wp.array(dtype=rows)  # (n,)
    hand: wp.array(dtype=vec2)  # (n,) m
    target: wp.array(dtype=vec2)  # (n,) m, seen now
    load: wp.array(dtype=vec2)  # (n,) N
    noise: wp.array3d(dtype=wp.float32)  # (n, T + 1, N_NOISE) already scaled; (n, 1, N_NOISE) zeros without noise
    sensed: wp.array3d(dtype=wp.float32)  # (n, longest delay + 1, N_SENSED) ring of what was sensed last
    muscle_delay: wp.int32  # steps
    hand_delay: wp.int32  # steps
    observation: wp.array2d(dtype=wp.float32)  # (n, N_OBSERVED)
    observation_low: wp.array(dtype=wp.float32)  # (N_OBSERVED,)
    observation_high: wp.array(dtype=wp.float32)  # (N_OBSERVED,)
    excitation: wp.array(dtype=vec6)  # (n,) command of the last step, in [0, 1], without motor noise
    vector_reward: wp.array(dtype=vec2)  # (n,) dominant, non-dominant
    reward: wp.array(dtype=wp.float32)  # (n,) their mean
    vector_return: wp.array(dtype=vec2)  # (n,) sum of the vector reward since the start
    start_distance: wp.array(dtype=wp.float32)  # (n,) m, at the onset
    distance: wp.array2d(dtype=wp.float32)  # (n, T) hand to target after each step (m)
    onset: wp.array(dtype=wp.int32)  # (n,) step at which the present target began; T before the cue
    # Of a timeline, empty without one:
    go: wp.array(dtype=wp.int32)  # (n,) step from which on the goal is the target
    jump: wp.array(dtype=wp.int32)  # (n,) step from which on the target is where it jumps to
    goal_target: wp.array(dtype=vec2)  # (n,) m
    jump_target: wp.array(dtype=vec2)  # (n,) m
    # Of forces, empty without them, but that the force is then the load:
    force: wp.array(dtype=vec2)  # (n,) N, all of it in the last step
    offset: wp.array(dtype=vec2)  # (n,) N
    velocity_gain: wp.array(dtype=mat22)  # (n,) N s/m
    position_gain: wp.array(dtype=mat22)  # (n,) N/m
    pulse: wp.array(dtype=vec2)  # (n,) N
    pulse_window: wp.array(dtype=steps2)  # (n,)


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
def sense(p: Parameters, s: TrialArrays, arm: int, slot: int) -> None:
    """Write what arm ``arm`` senses now into ``slot`` of its ring."""
    sensed_now = proprioception(p, s.muscle[arm])
    row = s.clock[arm] % s.noise.shape[1]
    for k in range(2 * N_MUSCLES):
        s.sensed[arm, slot, k] = sensed_now[k] + s.noise[arm, row, k]
    for axis in range(2):
        s.sensed[arm, slot, 2 * N_MUSCLES + axis] = s.hand[arm][axis] + s.noise[arm, row, 2 * N_MUSCLES + axis]


@wp.func
def observe(s: TrialArrays, arm: int, newest: int) -> None:
    """Write the observation, kept within its space, from the ring whose slot ``newest`` was written last."""
    n_slots = s.sensed.shape[1]
    muscles = (newest + n_slots - s.muscle_delay) % n_slots
    seen = (newest + n_slots - s.hand_delay) % n_slots
    for k in range(2 * N_MUSCLES):
        s.observation[arm, k] = wp.clamp(s.sensed[arm, muscles, k], s.observation_low[k], s.observation_high[k])
    for k in range(2 * N_MUSCLES, N_SENSED):
        s.observation[arm, k] = wp.clamp(s.sensed[arm, seen, k], s.observation_low[k], s.observation_high[k])
    for axis in range(2):
        s.observation[arm, N_SENSED + axis] = s.target[arm][axis]


@wp.func
def start_timeline(p: Parameters, b: TrialRows, s: TrialArrays, i: int, arm: int) -> None:
    """Let arm ``arm`` see the first target of trial ``i``: where it stands, unless the cue comes at once."""
    s.go[arm] = b.go[i]
    s.jump[arm] = b.jump[i]
    s.goal_target[arm] = hand_position(p, at_rest(b.goal[i]))
    s.jump_target[arm] = hand_position(p, at_rest(b.jump_goal[i]))
    s.target[arm] = s.hand[arm]
    s.onset[arm] = s.distance.shape[1]
    s.start_distance[arm] = 0.0
    follow_timeline(s, arm, 0)


@wp.func
def follow_timeline(s: TrialArrays, arm: int, step: int) -> None:
    """Change the target that arm ``arm`` sees before ``step``, if it is time.

    After the last step it stays: no step would be judged by another.
    """
    if step < s.distance.shape[1] and (step == s.go[arm] or step == s.jump[arm]):
        target = s.goal_target[arm]
        if step == s.jump[arm]:
            target = s.jump_target[arm]
        s.target[arm] = target
        s.onset[arm] = step
        s.start_distance[arm] = wp.length(s.hand[arm] - target)


@wp.func
def start_forces(b: TrialRows, s: TrialArrays, i: int, arm: int) -> None:
    """Take over the forces of trial ``i``."""
    s.force[arm] = b.load[i]
    s.offset[arm] = b.offset[i]
    s.velocity_gain[arm] = b.velocity_gain[i]
    s.position_gain[arm] = b.position_gain[i]
    s.pulse[arm] = b.pulse[i]
    s.pulse_window[arm] = b.pulse_window[i]


@wp.func
def force_on_hand(s: TrialArrays, arm: int, step: int, cartesian: vec4) -> vec2:
    """Return all forces (N) on a hand of position and velocity ``cartesian`` in ``step``."""
    force = s.load[arm] + hand_force(cartesian, s.offset[arm], s.velocity_gain[arm], s.position_gain[arm])
    window = s.pulse_window[arm]
    if is_within(step, window[0], window[1]):
        force += s.pulse[arm]
    return force


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
    timeline, forces, further = features
    name = ".".join(("bilateral_rl.trials", *(field for field, has in features._asdict().items() if has)))

    @wp.kernel(module=name, enable_backward=False)
    def start_trials(p: Parameters, b: TrialRows, arms: wp.array(dtype=wp.int32), s: TrialArrays) -> None:
        """Put ``arms`` at rest at the start postures, with targets at the goal postures' hand positions."""
        i = wp.tid()
        arm = arms[i]
        joint = at_rest(b.start[i])
        position = hand_position(p, joint)
        s.clock[arm] = 0
        s.joint[arm] = joint
        s.muscle[arm] = resting_muscles(p, joint)
        s.hand[arm] = position
        s.load[arm] = b.load[i]
        s.vector_return[arm] = vec2(0.0, 0.0)
        if timeline:
            start_timeline(p, b, s, i, arm)
        else:
            target = hand_position(p, at_rest(b.goal[i]))
            s.target[arm] = target
            s.start_distance[arm] = wp.length(position - target)
        if forces:
            start_forces(b, s, i, arm)
        for slot in range(s.sensed.shape[1]):
            sense(p, s, arm, slot)
        observe(s, arm, 0)

    @wp.kernel(module=name, enable_backward=False)
    def step_trials(p: Parameters, weights: StepWeights, action: wp.array(dtype=vec6), s: TrialArrays) -> None:
        """One step of every arm in a trial: actions in [-1, 1] become excitations in [0, 1]. Others stand still."""
        arm = wp.tid()
        clock = s.clock[arm]
        if clock < 0 or clock >= s.distance.shape[1]:  # also what keeps a clock that was tampered with in the arrays
            s.reward[arm] = 0.0
            s.vector_reward[arm] = vec2(0.0, 0.0)
            return
        noise_row = clock % s.noise.shape[1]
        excitation = vec6()
        driven = vec6()
        for m in range(N_MUSCLES):
            excitation[m] = 0.5 * (wp.clamp(action[arm][m], -1.0, 1.0) + 1.0)
            driven[m] = excitation[m] + s.noise[arm, noise_row, N_SENSED + m]
        before = s.joint[arm]
        muscle = s.muscle[arm]
        force = s.load[arm]
        if forces:
            force = force_on_hand(s, arm, clock, hand(p, before))
            s.force[arm] = force
        after = next_joint(p, before, muscle_torque(p, before, muscle[FORCE]), force)
        s.joint[arm] = after
        s.muscle[arm] = muscles_at(p, before, activate(p, muscle[ACTIVATION], driven))
        position = hand_position(p, after)
        s.hand[arm] = position
        s.clock[arm] = clock + 1

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
            reward = -(weights.terms * terms + weights.further * others)
        else:
            reward = -(weights.terms * terms)
        s.excitation[arm] = excitation
        s.vector_reward[arm] = reward
        s.reward[arm] = 0.5 * (reward[0] + reward[1])
        s.vector_return[arm] = s.vector_return[arm] + reward
        s.distance[arm, clock] = wp.length(error)
        if timeline:
            follow_timeline(s, arm, clock + 1)

        newest = (clock + 1) % s.sensed.shape[1]
        sense(p, s, arm, newest)
        observe(s, arm, newest)

    return TrialKernels(start_trials, step_trials, name)


def load_kernels(kernels: TrialKernels, device: Any) -> None:
    """Compile (first time) or load both kernels for ``device``."""
    wp.load_module(kernels.module, device=device)
