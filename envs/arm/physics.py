"""The arm's equations, once, as Warp functions of either precision.

Scalar code for one arm: the kernels that batch it are in ``kernels.py`` and ``envs/trial_kernels.py``. The order
inside a step is the paper's (section 2): the geometry *at t* gives the torques and, with the excitation, the muscle
state of t+1; velocity is integrated with the acceleration and position with the *old* velocity.

The functions take numbers of float32 or float64 alike (Warp compiles them for what they are called with), so constants
are written ``type(x)(2.0)``: in the precision of x. Only what Warp must know by type is made by a function of the
precision, :func:`arm_types`, as its structs and arrays cannot be generic. Throughout, ``p`` is a ``Parameters``,
``joint`` a vec4 of angles (rad) and angular velocities (rad/s), and ``m`` the index of a muscle.
"""

import dataclasses
import functools
from typing import Any, NamedTuple

import numpy as np
import warp as wp

from bilateral_rl.envs.arm.parameters import N_MUSCLES, ArmParameters
from bilateral_rl.envs.arm.warp_start import start_warp

# Rows of the muscle state, an array (n, 7, 6) or, in Warp, (n,) of 7 × 6 matrices.
ACTIVATION, LENGTH, VELOCITY, PASSIVE, ACTIVE_LENGTH, ACTIVE_FORCE, FORCE = range(7)
N_MUSCLE_ROWS = 7

# A lengthening muscle's force is a quotient whose denominator can cross zero only at lengths that the joint limits
# exclude; the guard keeps values and gradients finite for other parameters.
MIN_DENOMINATOR = 1e-6


class ArmTypes(NamedTuple):
    """Warp's types of an arm in one precision; each is a class, to annotate kernels with and to make values of."""

    real: Any
    """``wp.float32`` or ``wp.float64``."""
    vec2: Any
    """Two numbers: one a joint, or x and y."""
    vec4: Any
    """A joint state, or the hand's position and velocity."""
    vec6: Any
    """Six numbers: one a muscle."""
    rows: Any
    """(7, 6): the muscle state."""
    Parameters: Any
    """Struct of ``ArmParameters``."""


@functools.cache
def arm_types(real: Any) -> ArmTypes:
    """Return the types in precision ``real`` (``wp.float32`` or ``wp.float64``)."""
    vec2 = wp.types.vector(2, real)
    vec4 = wp.types.vector(4, real)
    vec6 = wp.types.vector(N_MUSCLES, real)
    rows = wp.types.matrix((N_MUSCLE_ROWS, N_MUSCLES), real)

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

    return ArmTypes(real, vec2, vec4, vec6, rows, Parameters)


def kernel_parameters(parameters: ArmParameters, real: Any) -> Any:
    """Return ``parameters`` as the struct that kernels of precision ``real`` take."""
    start_warp()
    types = arm_types(real)
    struct = types.Parameters()
    for name, value in dataclasses.asdict(parameters).items():
        if isinstance(value, tuple):
            value = (types.vec2 if len(value) == 2 else types.vec6)(*np.asarray(value, dtype=np.float64))
        setattr(struct, name, value)
    return struct


@wp.func
def hand(p: Any, joint: Any) -> Any:
    """Return hand x, y (m) and their velocities (m/s), a vec4."""
    upper_x = p.link_length[0] * wp.cos(joint[0])
    upper_y = p.link_length[0] * wp.sin(joint[0])
    fore_x = p.link_length[1] * wp.cos(joint[0] + joint[1])
    fore_y = p.link_length[1] * wp.sin(joint[0] + joint[1])
    forearm_rate = joint[2] + joint[3]
    return type(joint)(
        upper_x + fore_x,
        upper_y + fore_y,
        -upper_y * joint[2] - fore_y * forearm_rate,
        upper_x * joint[2] + fore_x * forearm_rate,
    )


@wp.func
def geometry(p: Any, joint: Any, m: int) -> Any:
    """Return the path of muscle ``m``, a vec4: length (m), velocity (m/s), moment arms at shoulder and elbow (m).

    The length is a parabola in each joint's angle φ from the reference, offset + Σ (linear + quadratic · φ) · φ. Its
    slope in φ is the moment arm, linear + 2 · quadratic · φ, negative where flexing the joint shortens the muscle; by
    the chain rule the velocity is Σ moment arm · φ̇.
    """
    two = type(joint[0])(2.0)
    shoulder = joint[0] - p.path_reference_angle[0]
    elbow = joint[1] - p.path_reference_angle[1]
    arm_shoulder = p.path_linear_shoulder[m] + two * p.path_quadratic_shoulder[m] * shoulder
    arm_elbow = p.path_linear_elbow[m] + two * p.path_quadratic_elbow[m] * elbow
    length = (
        p.path_offset[m]
        + (p.path_linear_shoulder[m] + p.path_quadratic_shoulder[m] * shoulder) * shoulder
        + (p.path_linear_elbow[m] + p.path_quadratic_elbow[m] * elbow) * elbow
    )
    return type(joint)(length, joint[2] * arm_shoulder + joint[3] * arm_elbow, arm_shoulder, arm_elbow)


@wp.func
def next_activation(p: Any, activation: Any, excitation: Any) -> Any:
    """Return a muscle's activation one step on: first-order dynamics, faster on than off (Thelen 2003, eq. 1-2)."""
    one = type(activation)(1.0)
    u = wp.clamp(excitation, p.min_activation, one)
    a = wp.clamp(activation, p.min_activation, one)
    scale = type(activation)(0.5) + type(activation)(1.5) * a
    tau = wp.where(u > a, p.tau_activation * scale, p.tau_deactivation / scale)
    return wp.clamp(activation + p.timestep * (u - a) / tau, p.min_activation, one)


@wp.func
def active_force_velocity(p: Any, activation: Any, force_length: Any, length: Any, velocity: Any) -> Any:
    """Return the active force over the maximal isometric force; length and velocity in optimal lengths and vmax.

    Kistemaker et al. 2010: Hill's hyperbola when shortening; when lengthening, a hyperbola with slanted
    asymptote that meets it at zero velocity with ``lengthening_slope_ratio`` times its slope.
    """
    zero = type(activation)(0.0)
    one = type(activation)(1.0)
    tiny = type(activation)(MIN_DENOMINATOR)
    a = p.hill_a * wp.where(length > one, force_length, one)
    fall = (activation - p.low_activation) / (p.low_activation_origin - p.low_activation)
    lowered = one - p.low_activation_drop * fall
    b = p.hill_b * wp.where(activation < p.low_activation, lowered * lowered, one)
    isometric = force_length * activation
    if velocity < zero:
        return wp.max((velocity * activation * a + isometric * b) / (b - velocity), zero)
    slope = p.lengthening_asymptote_slope
    asymptote = p.lengthening_force * isometric
    rise = (p.lengthening_force - one) * isometric
    steepness = p.lengthening_slope_ratio * activation * (force_length + a) / b - slope
    if wp.abs(steepness) < tiny:
        steepness = tiny
    pole = rise / steepness
    denominator = pole + velocity
    if wp.abs(denominator) < tiny:
        denominator = tiny
    force = (asymptote + slope * velocity) * (pole + velocity) - pole * rise
    return wp.max(force / denominator, zero)


@wp.func
def active_force_length(p: Any, length: Any) -> Any:
    """Return the share of the active force left at ``length`` (optimal lengths): a parabola with a floor."""
    one = type(length)(1.0)
    off_optimal = (length - one) / p.active_width
    return wp.max(one - off_optimal * off_optimal, p.min_active_force_length)


@wp.func
def passive_force_length(p: Any, length: Any) -> Any:
    """Return the passive force over maximal isometric force at ``length`` (optimal lengths): a parabola past slack."""
    stretch = wp.max(length - p.normalized_slack_muscle_length, type(length)(0.0))
    scale = type(length)(1.0) + p.active_width - p.normalized_slack_muscle_length
    return stretch * stretch / (scale * scale)


@wp.func
def muscle_column(p: Any, m: int, activation: Any, path: Any) -> Any:
    """Return the state of muscle ``m``, its seven rows in order, from its activation and its ``geometry``."""
    optimal = p.optimal_muscle_length[m]
    length = wp.max(path[0] - p.tendon_length[m], type(activation)(0.0))
    normalized_length = length / optimal
    passive = passive_force_length(p, normalized_length)
    force_length = active_force_length(p, normalized_length)
    normalized_velocity = path[1] / (p.normalized_max_velocity * optimal)
    active = active_force_velocity(p, activation, force_length, normalized_length, normalized_velocity)
    force = (active + passive) * p.max_isometric_force[m]
    return wp.vector(activation, length, path[1], passive, force_length, active, force)


@wp.func
def acceleration(p: Any, joint: Any, torque: Any) -> Any:
    """Return the angular acceleration (rad/s²) of the two-link arm in the horizontal plane under joint torques (N m).

    Solves M(φ) φ̈ = torque − Coriolis and centripetal torques for φ̈, by the inverse of the 2 × 2 inertia matrix M, whose
    lower right entry is ``second_moment``.
    """
    two = type(joint[0])(2.0)
    second_moment = p.link_mass[1] * p.link_center_of_mass[1] * p.link_center_of_mass[1] + p.link_inertia[1]
    coupling = p.link_mass[1] * p.link_length[0] * p.link_center_of_mass[1]
    coupling_cos = coupling * wp.cos(joint[1])
    coupling_sin = coupling * wp.sin(joint[1])
    inertia_11 = (
        p.link_mass[0] * p.link_center_of_mass[0] * p.link_center_of_mass[0]
        + p.link_inertia[0]
        + p.link_mass[1] * p.link_length[0] * p.link_length[0]
        + second_moment
        + two * coupling_cos
    )
    inertia_12 = second_moment + coupling_cos
    rhs_1 = torque[0] + coupling_sin * (two * joint[2] + joint[3]) * joint[3]
    rhs_2 = torque[1] - coupling_sin * joint[2] * joint[2]
    determinant = inertia_11 * second_moment - inertia_12 * inertia_12
    return wp.vector(
        (second_moment * rhs_1 - inertia_12 * rhs_2) / determinant,
        (inertia_11 * rhs_2 - inertia_12 * rhs_1) / determinant,
    )


@wp.func
def stop_at_limit(position: Any, velocity: Any, lower: Any, upper: Any) -> Any:
    """Return the velocity, or zero where the joint is at or past a limit and moving out."""
    zero = type(velocity)(0.0)
    outward = (position <= lower and velocity < zero) or (position >= upper and velocity > zero)
    return wp.where(outward, zero, velocity)


@wp.func
def next_joint(p: Any, joint: Any, muscle_torque: Any, load: Any) -> Any:
    """Return the joint state one Euler step on, under muscle torques (N m) and a load on the hand (N)."""
    position = hand(p, joint)
    fore_x = p.link_length[1] * wp.cos(joint[0] + joint[1])
    fore_y = p.link_length[1] * wp.sin(joint[0] + joint[1])
    # The load's torque is its moment about each joint: the transposed Jacobian of the hand times the load.
    torque = muscle_torque + wp.vector(
        load[1] * position[0] - load[0] * position[1], load[1] * fore_x - load[0] * fore_y
    )
    change = acceleration(p, joint, torque)
    shoulder = joint[0] + p.timestep * joint[2]
    elbow = joint[1] + p.timestep * joint[3]
    lower = p.joint_lower_limit
    upper = p.joint_upper_limit
    return type(joint)(
        wp.clamp(shoulder, lower[0], upper[0]),
        wp.clamp(elbow, lower[1], upper[1]),
        stop_at_limit(shoulder, joint[2] + p.timestep * change[0], lower[0], upper[0]),
        stop_at_limit(elbow, joint[3] + p.timestep * change[1], lower[1], upper[1]),
    )
