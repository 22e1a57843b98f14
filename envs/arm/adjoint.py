"""The derivative of an arm's step: gradients of what a step gives, pulled back to what it takes.

The motion's derivative is Warp's (``wp.grad``), the muscles' is written out: it costs a fifth of letting Warp
differentiate the step whole, which carries adjoints of parameters and intermediate copies that nobody reads.
"""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from bilateral_rl.envs.arm.muscles import muscle_functions
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import (
    ACTIVATION,
    ACTIVE_FORCE,
    ACTIVE_LENGTH,
    FORCE,
    LENGTH,
    MIN_DENOMINATOR,
    PASSIVE,
    VELOCITY,
    arm_physics,
)


@functools.cache
def arm_adjoint(real: Any) -> SimpleNamespace:
    """The adjoint in precision ``real``: Warp structs and functions for kernels that are not differentiated further.

    A step maps joint, activation and force at t, excitation and load to joint', hand' and muscle' at t + 1.
    ``linearize`` gathers what of it does not depend on the gradient; ``pull_back`` then takes one gradient back, and
    may be called for several.
    """
    physics, muscles = arm_physics(real), muscle_functions(real)
    Parameters, vec2, vec4, vec6, rows = physics.Parameters, physics.vec2, physics.vec4, physics.vec6, muscles.rows
    vec3 = wp.types.vector(3, real)
    hand, geometry, next_joint, muscle_torque = (
        physics.hand,
        physics.geometry,
        physics.next_joint,
        muscles.muscle_torque,
    )

    @wp.struct
    class Slopes:
        """Partial derivatives of the six muscles' next state; lengths and velocities are normalized."""

        activation_by_activation: vec6
        activation_by_excitation: vec6
        passive_by_length: vec6
        force_length_by_length: vec6
        active_by_activation: vec6
        active_by_force_length: vec6
        active_by_velocity: vec6

    @wp.struct
    class Pulled:
        """Gradients with respect to what a step takes."""

        joint: vec4
        activation: vec6
        force: vec6
        excitation: vec6
        load: vec2

    @wp.func
    def weighted_motion(
        p: Parameters, joint: vec4, force: vec6, load: vec2, joint_weight: vec4, hand_weight: vec4
    ) -> real:
        """Weighted sum of the joint state and the hand one step on."""
        there = next_joint(p, joint, muscle_torque(p, joint, force), load)
        return wp.dot(joint_weight, there) + wp.dot(hand_weight, hand(p, there))

    @wp.func
    def activation_slopes(p: Parameters, activation: real, excitation: real) -> vec2:
        """Partial derivatives of ``next_activation`` by activation and excitation."""
        u = wp.clamp(excitation, p.min_activation, real(1.0))
        a = wp.clamp(activation, p.min_activation, real(1.0))
        scale = real(0.5) + real(1.5) * a
        rises = u > a
        tau = wp.where(rises, p.tau_activation * scale, p.tau_deactivation / scale)
        tau_slope = wp.where(rises, real(1.5) / scale, -real(1.5) / scale)  # over tau
        change = p.timestep * (u - a) / tau
        new = activation + change
        if new < p.min_activation or new > real(1.0):
            return vec2(real(0.0), real(0.0))
        by_activation = real(1.0)
        by_excitation = real(0.0)
        if activation >= p.min_activation and activation <= real(1.0):
            by_activation -= p.timestep / tau + change * tau_slope
        if excitation >= p.min_activation and excitation <= real(1.0):
            by_excitation = p.timestep / tau
        return vec2(by_activation, by_excitation)

    @wp.func
    def force_slopes(p: Parameters, activation: real, force_length: real, length: real, velocity: real) -> vec3:
        """Partial derivatives of ``active_force_velocity`` by activation, force-length and velocity."""
        above = length > real(1.0)
        a = p.hill_a * wp.where(above, force_length, real(1.0))
        a_slope = wp.where(above, p.hill_a, real(0.0))
        span = p.low_activation_origin - p.low_activation
        lowered = real(1.0) - p.low_activation_drop * (activation - p.low_activation) / span
        low = activation < p.low_activation
        b = p.hill_b * wp.where(low, lowered * lowered, real(1.0))
        b_slope = wp.where(low, -real(2.0) * p.hill_b * lowered * p.low_activation_drop / span, real(0.0))
        isometric = force_length * activation
        if velocity < real(0.0):
            distance = b - velocity
            force = (velocity * activation * a + isometric * b) / distance
            if force < real(0.0):
                return vec3(real(0.0), real(0.0), real(0.0))
            return vec3(
                (velocity * a + force_length * b + (isometric - force) * b_slope) / distance,
                (velocity * activation * a_slope + activation * b) / distance,
                (activation * a + force) / distance,
            )
        slope = p.lengthening_asymptote_slope
        gain = p.lengthening_force
        stiffness = p.lengthening_slope_ratio * activation * (force_length + a) / b
        steepness = stiffness - slope
        by_steepness = real(1.0)
        if wp.abs(steepness) < real(MIN_DENOMINATOR):
            steepness = real(MIN_DENOMINATOR)
            by_steepness = real(0.0)
        rise = (gain - real(1.0)) * isometric
        pole = rise / steepness
        denominator = pole + velocity
        if wp.abs(denominator) < real(MIN_DENOMINATOR):
            denominator = real(MIN_DENOMINATOR)
        share = pole / denominator
        stiffness_by_activation = p.lengthening_slope_ratio * (force_length + a) / b - stiffness * b_slope / b
        stiffness_by_force_length = p.lengthening_slope_ratio * activation * (real(1.0) + a_slope) / b
        rise_by_activation = (gain - real(1.0)) * force_length
        rise_by_force_length = (gain - real(1.0)) * activation
        pole_by_activation = (rise_by_activation - by_steepness * pole * stiffness_by_activation) / steepness
        pole_by_force_length = (rise_by_force_length - by_steepness * pole * stiffness_by_force_length) / steepness
        by_pole = rise / denominator * (real(1.0) - share)
        return vec3(
            gain * force_length - share * rise_by_activation - by_pole * pole_by_activation,
            gain * activation - share * rise_by_force_length - by_pole * pole_by_force_length,
            slope + share * rise / denominator,
        )

    @wp.func
    def linearize(p: Parameters, joint: vec4, activation: vec6, excitation: vec6, muscle_next: rows) -> Slopes:
        """The slopes at a step from ``joint`` and ``activation`` under ``excitation`` to ``muscle_next``."""
        slopes = Slopes()
        for m in range(N_MUSCLES):
            by_activation = activation_slopes(p, activation[m], excitation[m])
            optimal = p.optimal_muscle_length[m]
            length = muscle_next[LENGTH, m] / optimal
            velocity = muscle_next[VELOCITY, m] / (p.normalized_max_velocity * optimal)
            force_length = muscle_next[ACTIVE_LENGTH, m]
            active = force_slopes(p, muscle_next[ACTIVATION, m], force_length, length, velocity)
            slack = p.normalized_slack_muscle_length
            passive_scale = real(1.0) + p.active_width - slack
            slopes.activation_by_activation[m] = by_activation[0]
            slopes.activation_by_excitation[m] = by_activation[1]
            slopes.passive_by_length[m] = (
                real(2.0) * wp.max(length - slack, real(0.0)) / (passive_scale * passive_scale)
            )
            if force_length > p.min_active_force_length:
                slopes.force_length_by_length[m] = -real(2.0) * (length - real(1.0)) / (p.active_width * p.active_width)
            slopes.active_by_activation[m] = active[0]
            slopes.active_by_force_length[m] = active[1]
            slopes.active_by_velocity[m] = active[2]
        return slopes

    @wp.func
    def pull_back(
        p: Parameters,
        slopes: Slopes,
        joint: vec4,
        force: vec6,
        load: vec2,
        muscle_next: rows,
        joint_gradient: vec4,
        muscle_gradient: rows,
        hand_gradient: vec4,
    ) -> Pulled:
        """Gradients with respect to joint, activation, force, excitation and load of a step, from those of its end."""
        result = Pulled()
        _p0, by_joint, by_force, by_load, _w0, _w1 = wp.grad(weighted_motion)(
            p, joint, force, load, joint_gradient, hand_gradient
        )
        result.force = by_force
        result.load = by_load
        for m in range(N_MUSCLES):
            optimal = p.optimal_muscle_length[m]
            of_force = p.max_isometric_force[m] * muscle_gradient[FORCE, m]
            of_active = muscle_gradient[ACTIVE_FORCE, m] + of_force
            of_force_length = muscle_gradient[ACTIVE_LENGTH, m] + of_active * slopes.active_by_force_length[m]
            of_length = (
                (muscle_gradient[PASSIVE, m] + of_force) * slopes.passive_by_length[m]
                + of_force_length * slopes.force_length_by_length[m]
            ) / optimal + muscle_gradient[LENGTH, m]
            of_velocity = muscle_gradient[VELOCITY, m] + of_active * slopes.active_by_velocity[m] / (
                p.normalized_max_velocity * optimal
            )
            if muscle_next[LENGTH, m] <= real(0.0):  # slack: nothing left to shorten
                of_length = real(0.0)
            of_activation = muscle_gradient[ACTIVATION, m] + of_active * slopes.active_by_activation[m]
            result.activation[m] = of_activation * slopes.activation_by_activation[m]
            result.excitation[m] = of_activation * slopes.activation_by_excitation[m]
            path = geometry(p, joint, m)
            by_joint += vec4(
                of_length * path[2] + real(2.0) * of_velocity * joint[2] * p.path_quadratic_shoulder[m],
                of_length * path[3] + real(2.0) * of_velocity * joint[3] * p.path_quadratic_elbow[m],
                of_velocity * path[2],
                of_velocity * path[3],
            )
        result.joint = by_joint
        return result

    return SimpleNamespace(Slopes=Slopes, Pulled=Pulled, linearize=linearize, pull_back=pull_back)
