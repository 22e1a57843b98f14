"""One thread an arm: trials that start, step, sense and reward, for the environments (forward only)."""

from typing import Any

import warp as wp

from bilateral_rl.envs.arm.muscles import activate, muscle_torque, muscles_at, proprioception, resting_muscles
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import ACTIVATION, FORCE, arm_types, hand, next_joint
from bilateral_rl.envs.reward import step_terms, weight_rows

_, vec2, vec4, vec6, rows, Parameters = arm_types(wp.float32)

N_SENSED = 2 * N_MUSCLES + 2
"""Numbers that the arm senses: muscle lengths, muscle velocities, hand x and y."""
N_OBSERVED = N_SENSED + 2
"""What a controller sees: the sensed numbers and the target's x and y."""
N_NOISE = N_SENSED + N_MUSCLES
"""Normal numbers a step takes: one per sensed number, one per muscle command."""


@wp.struct
class TrialArrays:
    """State and outputs of ``n`` arms, each with its own clock. T is the trial's length in steps."""

    clock: wp.array(dtype=wp.int32)  # (n,) steps taken; T: in no trial
    joint: wp.array(dtype=vec4)  # (n,)
    muscle: wp.array(dtype=rows)  # (n,)
    hand: wp.array(dtype=vec2)  # (n,) m
    target: wp.array(dtype=vec2)  # (n,) m
    load: wp.array(dtype=vec2)  # (n,) N
    noise: wp.array3d(dtype=wp.float32)  # (n, T + 1, N_NOISE) already scaled; (n, 1, N_NOISE) zeros without noise
    sensed: wp.array3d(dtype=wp.float32)  # (n, delay + 1, N_SENSED) ring of what was sensed last
    observation: wp.array2d(dtype=wp.float32)  # (n, N_OBSERVED)
    observation_low: wp.array(dtype=wp.float32)  # (N_OBSERVED,)
    observation_high: wp.array(dtype=wp.float32)  # (N_OBSERVED,)
    excitation: wp.array(dtype=vec6)  # (n,) command of the last step, in [0, 1], without motor noise
    vector_reward: wp.array(dtype=vec2)  # (n,) dominant, non-dominant
    reward: wp.array(dtype=wp.float32)  # (n,) their mean
    vector_return: wp.array(dtype=vec2)  # (n,) sum of the vector reward since the start
    start_distance: wp.array(dtype=wp.float32)  # (n,) m
    distance: wp.array2d(dtype=wp.float32)  # (n, T) hand to target after each step (m)


@wp.func
def hand_position(p: Parameters, joint: vec4) -> vec2:
    """Return hand x, y (m)."""
    cartesian = hand(p, joint)
    return vec2(cartesian[0], cartesian[1])


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
def observe(s: TrialArrays, arm: int, slot: int) -> None:
    """Write the observation from ``slot`` of the ring, kept within the observation space."""
    for k in range(N_SENSED):
        s.observation[arm, k] = wp.clamp(s.sensed[arm, slot, k], s.observation_low[k], s.observation_high[k])
    for axis in range(2):
        s.observation[arm, N_SENSED + axis] = s.target[arm][axis]


@wp.kernel(module="bilateral_rl.trials", enable_backward=False)
def start_trials(
    p: Parameters,
    s: TrialArrays,
    arms: wp.array(dtype=wp.int32),
    start: wp.array(dtype=vec2),
    goal: wp.array(dtype=vec2),
    load: wp.array(dtype=vec2),
) -> None:
    """Put ``arms`` at rest at the start postures, with targets at the goal postures' hand positions."""
    i = wp.tid()
    arm = arms[i]
    joint = vec4(start[i][0], start[i][1], 0.0, 0.0)
    position = hand_position(p, joint)
    target = hand_position(p, vec4(goal[i][0], goal[i][1], 0.0, 0.0))
    s.clock[arm] = 0
    s.joint[arm] = joint
    s.muscle[arm] = resting_muscles(p, joint)
    s.hand[arm] = position
    s.target[arm] = target
    s.load[arm] = load[i]
    s.vector_return[arm] = vec2(0.0, 0.0)
    s.start_distance[arm] = wp.length(position - target)
    for slot in range(s.sensed.shape[1]):
        sense(p, s, arm, slot)
    observe(s, arm, 0)


@wp.kernel(module="bilateral_rl.trials", enable_backward=False)
def step_trials(p: Parameters, weights: weight_rows, action: wp.array(dtype=vec6), s: TrialArrays) -> None:
    """One step of every arm in a trial: actions in [-1, 1] become excitations in [0, 1]. The others stand still."""
    arm = wp.tid()
    clock = s.clock[arm]
    if clock < 0 or clock >= s.distance.shape[1]:  # also what keeps a clock that was tampered with inside the arrays
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
    after = next_joint(p, before, muscle_torque(p, before, muscle[FORCE]), s.load[arm])
    s.joint[arm] = after
    s.muscle[arm] = muscles_at(p, before, activate(p, muscle[ACTIVATION], driven))
    position = hand_position(p, after)
    s.hand[arm] = position
    s.clock[arm] = clock + 1

    error = position - s.target[arm]
    reward = -(weights * step_terms(error, excitation))
    s.excitation[arm] = excitation
    s.vector_reward[arm] = reward
    s.reward[arm] = 0.5 * (reward[0] + reward[1])
    s.vector_return[arm] = s.vector_return[arm] + reward
    s.distance[arm, clock] = wp.length(error)

    n_slots = s.sensed.shape[1]
    sense(p, s, arm, (clock + 1) % n_slots)
    observe(s, arm, (clock + 2) % n_slots)


def load_kernels(device: Any) -> None:
    """Compile (first time) or load both kernels for ``device``."""
    wp.load_module("bilateral_rl.trials", device=device)
