"""The forces on the hands of trials beside their loads, as Warp functions: fields, walls, pulses, and springs."""

import warp as wp

from bilateral_rl.envs.arm.hand_force import hand_force, is_within
from bilateral_rl.envs.arm.hand_spring import distance_spring, seen_from_other_arm, vector_spring
from bilateral_rl.envs.trial_arrays import ForceArrays, TrialArrays, TrialRows, vec2, vec4


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
