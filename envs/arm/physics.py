"""The arm's equations, once, as Warp functions in a chosen precision.

Scalar code for one arm: the kernels that batch it are in ``kernels.py`` and ``envs/trial_kernels.py``. The order
inside a step is the paper's (section 2): the geometry *at t* gives the torques and, with the excitation, the muscle
state of t+1; velocity is integrated with the acceleration and position with the *old* velocity.
"""

import functools
from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp

from bilateral_rl.envs.arm.parameters import N_MUSCLES, ArmParameters
from bilateral_rl.envs.arm.warp_start import start_warp

# Rows of the muscle state, an array (n, 7, 6) or, in Warp, (n, 7) of six-vectors.
ACTIVATION, LENGTH, VELOCITY, PASSIVE, ACTIVE_LENGTH, ACTIVE_FORCE, FORCE = range(7)
N_MUSCLE_ROWS = 7

# A lengthening muscle's force is a quotient whose denominator can cross zero only at lengths that the joint limits
# exclude; the guard keeps values and gradients finite for other parameters.
MIN_DENOMINATOR = 1e-6


@functools.cache
def arm_physics(real: Any) -> SimpleNamespace:
    """The physics in precision ``real`` (``wp.float32`` or ``wp.float64``).

    Returns:
        A namespace with the vector types ``vec2``, ``vec4`` (angles and velocities) and ``vec6`` (muscles), the struct
        ``Parameters`` and the Warp functions ``hand``, ``geometry``, ``muscle_column``, ``next_activation`` and
        ``next_joint``; their derivatives are in ``adjoint.py``.
    """
    vec2 = wp.types.vector(2, real)
    vec4 = wp.types.vector(4, real)
    vec6 = wp.types.vector(N_MUSCLES, real)
    column = wp.types.vector(N_MUSCLE_ROWS, real)

    @wp.struct
    class Parameters:
        """``ArmParameters`` as the kernels see them; same names, same units."""

        timestep: real
        link_mass: vec2
        link_center_of_mass: vec2
        link_inertia: vec2
        link_length: vec2
        joint_lower_limit: vec2
        joint_upper_limit: vec2
        max_isometric_force: vec6
        tendon_length: vec6
        optimal_muscle_length: vec6
        normalized_slack_muscle_length: real
        normalized_max_velocity: real
        min_activation: real
        tau_activation: real
        tau_deactivation: real
        path_offset: vec6
        path_linear_shoulder: vec6
        path_linear_elbow: vec6
        path_quadratic_shoulder: vec6
        path_quadratic_elbow: vec6
        path_reference_angle: vec2
        active_width: real
        min_active_force_length: real
        hill_a: real
        hill_b: real
        low_activation: real
        low_activation_origin: real
        low_activation_drop: real
        lengthening_force: real
        lengthening_slope_ratio: real
        lengthening_asymptote_slope: real

    @wp.func
    def hand(p: Parameters, joint: vec4) -> vec4:
        """Hand x, y (m) and their velocities (m/s)."""
        upper_x = p.link_length[0] * wp.cos(joint[0])
        upper_y = p.link_length[0] * wp.sin(joint[0])
        fore_x = p.link_length[1] * wp.cos(joint[0] + joint[1])
        fore_y = p.link_length[1] * wp.sin(joint[0] + joint[1])
        forearm_rate = joint[2] + joint[3]
        return vec4(
            upper_x + fore_x,
            upper_y + fore_y,
            -upper_y * joint[2] - fore_y * forearm_rate,
            upper_x * joint[2] + fore_x * forearm_rate,
        )

    @wp.func
    def geometry(p: Parameters, joint: vec4, m: int) -> vec4:
        """Musculotendon length (m), velocity (m/s), moment arm at shoulder and elbow (m) of muscle ``m``."""
        shoulder = joint[0] - p.path_reference_angle[0]
        elbow = joint[1] - p.path_reference_angle[1]
        arm_shoulder = p.path_linear_shoulder[m] + real(2.0) * p.path_quadratic_shoulder[m] * shoulder
        arm_elbow = p.path_linear_elbow[m] + real(2.0) * p.path_quadratic_elbow[m] * elbow
        length = (
            p.path_offset[m]
            + (p.path_linear_shoulder[m] + p.path_quadratic_shoulder[m] * shoulder) * shoulder
            + (p.path_linear_elbow[m] + p.path_quadratic_elbow[m] * elbow) * elbow
        )
        return vec4(length, joint[2] * arm_shoulder + joint[3] * arm_elbow, arm_shoulder, arm_elbow)

    @wp.func
    def next_activation(p: Parameters, activation: real, excitation: real) -> real:
        """First-order activation dynamics, faster on than off (Thelen 2003, eq. 1-2)."""
        u = wp.clamp(excitation, p.min_activation, real(1.0))
        a = wp.clamp(activation, p.min_activation, real(1.0))
        scale = real(0.5) + real(1.5) * a
        tau = wp.where(u > a, p.tau_activation * scale, p.tau_deactivation / scale)
        return wp.clamp(activation + p.timestep * (u - a) / tau, p.min_activation, real(1.0))

    @wp.func
    def active_force_velocity(
        p: Parameters, activation: real, force_length: real, length: real, velocity: real
    ) -> real:
        """Active force over maximal isometric force; length and velocity in optimal lengths and vmax.

        Kistemaker et al. 2010: Hill's hyperbola when shortening; when lengthening, a hyperbola with slanted
        asymptote that meets it at zero velocity with ``lengthening_slope_ratio`` times its slope.
        """
        a = p.hill_a * wp.where(length > real(1.0), force_length, real(1.0))
        fall = (activation - p.low_activation) / (p.low_activation_origin - p.low_activation)
        lowered = real(1.0) - p.low_activation_drop * fall
        b = p.hill_b * wp.where(activation < p.low_activation, lowered * lowered, real(1.0))
        isometric = force_length * activation
        if velocity < real(0.0):
            return wp.max((velocity * activation * a + isometric * b) / (b - velocity), real(0.0))
        slope = p.lengthening_asymptote_slope
        asymptote = p.lengthening_force * isometric
        rise = (p.lengthening_force - real(1.0)) * isometric
        steepness = p.lengthening_slope_ratio * activation * (force_length + a) / b - slope
        if wp.abs(steepness) < real(MIN_DENOMINATOR):
            steepness = real(MIN_DENOMINATOR)
        pole = rise / steepness
        denominator = pole + velocity
        if wp.abs(denominator) < real(MIN_DENOMINATOR):
            denominator = real(MIN_DENOMINATOR)
        force = (asymptote + slope * velocity) * (pole + velocity) - pole * rise
        return wp.max(force / denominator, real(0.0))

    @wp.func
    def active_force_length(p: Parameters, length: real) -> real:
        """Share of the active force left at ``length`` (optimal lengths): a parabola with a floor."""
        off_optimal = (length - real(1.0)) / p.active_width
        return wp.max(real(1.0) - off_optimal * off_optimal, p.min_active_force_length)

    @wp.func
    def passive_force_length(p: Parameters, length: real) -> real:
        """Passive force over maximal isometric force at ``length`` (optimal lengths): a parabola past slack."""
        stretch = wp.max(length - p.normalized_slack_muscle_length, real(0.0))
        scale = real(1.0) + p.active_width - p.normalized_slack_muscle_length
        return stretch * stretch / (scale * scale)

    @wp.func
    def muscle_column(p: Parameters, m: int, activation: real, path: vec4) -> column:
        """Muscle ``m``'s state, the seven rows in order, from its activation and its ``geometry``."""
        optimal = p.optimal_muscle_length[m]
        length = wp.max(path[0] - p.tendon_length[m], real(0.0))
        normalized_length = length / optimal
        passive = passive_force_length(p, normalized_length)
        force_length = active_force_length(p, normalized_length)
        normalized_velocity = path[1] / (p.normalized_max_velocity * optimal)
        active = active_force_velocity(p, activation, force_length, normalized_length, normalized_velocity)
        force = (active + passive) * p.max_isometric_force[m]
        return column(activation, length, path[1], passive, force_length, active, force)

    @wp.func
    def acceleration(p: Parameters, joint: vec4, torque: vec2) -> vec2:
        """Angular acceleration (rad/s²) of the two-link arm in the horizontal plane under joint torques (N m)."""
        second_moment = p.link_mass[1] * p.link_center_of_mass[1] * p.link_center_of_mass[1] + p.link_inertia[1]
        coupling = p.link_mass[1] * p.link_length[0] * p.link_center_of_mass[1]
        coupling_cos = coupling * wp.cos(joint[1])
        coupling_sin = coupling * wp.sin(joint[1])
        inertia_11 = (
            p.link_mass[0] * p.link_center_of_mass[0] * p.link_center_of_mass[0]
            + p.link_inertia[0]
            + p.link_mass[1] * p.link_length[0] * p.link_length[0]
            + second_moment
            + real(2.0) * coupling_cos
        )
        inertia_12 = second_moment + coupling_cos
        rhs_1 = torque[0] + coupling_sin * (real(2.0) * joint[2] + joint[3]) * joint[3]
        rhs_2 = torque[1] - coupling_sin * joint[2] * joint[2]
        determinant = inertia_11 * second_moment - inertia_12 * inertia_12
        return vec2(
            (second_moment * rhs_1 - inertia_12 * rhs_2) / determinant,
            (inertia_11 * rhs_2 - inertia_12 * rhs_1) / determinant,
        )

    @wp.func
    def stop_at_limit(position: real, velocity: real, lower: real, upper: real) -> real:
        """The velocity, or zero where the joint is at or past a limit and moving out."""
        outward = (position <= lower and velocity < real(0.0)) or (position >= upper and velocity > real(0.0))
        return wp.where(outward, real(0.0), velocity)

    @wp.func
    def next_joint(p: Parameters, joint: vec4, muscle_torque: vec2, load: vec2) -> vec4:
        """Joint state one Euler step on, under muscle torques (N m) and a load on the hand (N)."""
        here = hand(p, joint)
        fore_x = p.link_length[1] * wp.cos(joint[0] + joint[1])
        fore_y = p.link_length[1] * wp.sin(joint[0] + joint[1])
        torque = muscle_torque + vec2(load[1] * here[0] - load[0] * here[1], load[1] * fore_x - load[0] * fore_y)
        change = acceleration(p, joint, torque)
        shoulder = joint[0] + p.timestep * joint[2]
        elbow = joint[1] + p.timestep * joint[3]
        lower = p.joint_lower_limit
        upper = p.joint_upper_limit
        return vec4(
            wp.clamp(shoulder, lower[0], upper[0]),
            wp.clamp(elbow, lower[1], upper[1]),
            stop_at_limit(shoulder, joint[2] + p.timestep * change[0], lower[0], upper[0]),
            stop_at_limit(elbow, joint[3] + p.timestep * change[1], lower[1], upper[1]),
        )

    return SimpleNamespace(
        real=real, vec2=vec2, vec4=vec4, vec6=vec6, Parameters=Parameters, hand=hand, geometry=geometry,
        muscle_column=muscle_column, next_activation=next_activation, next_joint=next_joint,
    )  # fmt: skip


def kernel_parameters(parameters: ArmParameters, real: Any) -> Any:
    """``parameters`` as the struct that kernels of precision ``real`` take."""
    start_warp()
    physics = arm_physics(real)
    struct = physics.Parameters()
    for name, value in parameters.to_dict().items():
        if isinstance(value, list):
            value = (physics.vec2 if len(value) == 2 else physics.vec6)(*np.asarray(value, dtype=np.float64))
        setattr(struct, name, value)
    return struct
