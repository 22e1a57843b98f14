"""The derivative of an arm's step: from the gradients of what a step gives to those of what it takes.

Reverse mode: a loss depends on joint', hand' and muscle' of t + 1, and its gradients with respect to these are known;
multiplied by the transposed Jacobian of the step they become gradients with respect to joint, activation, force,
excitation and load at t. The motion's part is Warp's (``wp.grad``), the muscles' is written out: it costs a fifth of
letting Warp differentiate the step whole, which carries adjoints of parameters and intermediate copies that nobody
reads. Names: ``x_by_y`` is ∂x/∂y, ``d_x`` is the gradient of the loss with respect to x.

The functions that return structs are made by a function of the precision, as Warp's structs cannot be generic; the
others take either precision, as in ``physics.py``.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from bilateral_rl.envs.arm.hand_force import hand_force
from bilateral_rl.envs.arm.muscles import muscle_torque
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
    arm_types,
    geometry,
    hand,
    next_joint,
)


class ArmAdjoint(NamedTuple):
    """The adjoint of an arm's step in one precision, for kernels that are not differentiated further.

    A step maps joint, activation and force at t, excitation and load to joint', hand' and muscle' at t + 1.
    ``linearize`` gathers what of it does not depend on the gradient; ``pull_back`` then takes one gradient back, and
    may be called for several, one a stream.
    """

    Slopes: Any
    """Struct, what ``linearize`` returns."""
    StepGradients: Any
    """Struct, what ``pull_back`` returns."""
    linearize: Any
    pull_back: Any
    pull_back_in_field: Any
    """As ``pull_back``, under a force on the hand that depends on its motion, :func:`hand_force`."""


@functools.cache
def arm_adjoint(real: Any) -> ArmAdjoint:
    """Return the adjoint in precision ``real`` (``wp.float32`` or ``wp.float64``)."""
    _, vec2, vec4, vec6, rows, Parameters = arm_types(real)
    mat22 = wp.types.matrix((2, 2), real)

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
    class StepGradients:
        """Gradients of a loss with respect to what a step takes."""

        joint: vec4
        activation: vec6
        force: vec6
        excitation: vec6
        load: vec2

    @wp.func
    def linearize(p: Parameters, joint: vec4, activation: vec6, excitation: vec6, muscle_next: rows) -> Slopes:
        """Return the slopes at a step from ``joint`` and ``activation`` under ``excitation`` to ``muscle_next``."""
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
            if force_length > p.min_active_force_length:  # else on the floor of the parabola, whose slope is 0
                slopes.force_length_by_length[m] = -real(2.0) * (length - real(1.0)) / (p.active_width * p.active_width)
            slopes.active_by_activation[m] = active[0]
            slopes.active_by_force_length[m] = active[1]
            slopes.active_by_velocity[m] = active[2]
        return slopes

    @wp.func
    def pull_back_muscles(
        p: Parameters,
        slopes: Slopes,
        joint: vec4,
        muscle_next: rows,
        d_muscle_next: rows,
        d_joint_by_motion: vec4,
        d_force: vec6,
        d_load: vec2,
    ) -> StepGradients:
        """Return the gradients of a step from those by its motion, adding what goes through the muscles.

        Each column of muscle' depends on its own activation and excitation, and on joint by its path. Backwards through
        ``muscle_column``, from the last row to the first: what a row puts into later rows is added.
        """
        result = StepGradients()
        result.force = d_force
        result.load = d_load
        d_joint = vec4(d_joint_by_motion)
        for m in range(N_MUSCLES):
            optimal = p.optimal_muscle_length[m]
            d_total = p.max_isometric_force[m] * d_muscle_next[FORCE, m]  # of active + passive
            d_active = d_muscle_next[ACTIVE_FORCE, m] + d_total
            d_force_length = d_muscle_next[ACTIVE_LENGTH, m] + d_active * slopes.active_by_force_length[m]
            d_length = (
                (d_muscle_next[PASSIVE, m] + d_total) * slopes.passive_by_length[m]
                + d_force_length * slopes.force_length_by_length[m]
            ) / optimal + d_muscle_next[LENGTH, m]
            d_velocity = d_muscle_next[VELOCITY, m] + d_active * slopes.active_by_velocity[m] / (
                p.normalized_max_velocity * optimal
            )
            if muscle_next[LENGTH, m] <= real(0.0):  # slack: nothing left to shorten
                d_length = real(0.0)
            d_activation = d_muscle_next[ACTIVATION, m] + d_active * slopes.active_by_activation[m]
            result.activation[m] = d_activation * slopes.activation_by_activation[m]
            result.excitation[m] = d_activation * slopes.activation_by_excitation[m]
            # Moment arm a = ∂length/∂φ and velocity = Σ a φ̇: ∂velocity/∂φ = 2 · quadratic · φ̇ and ∂velocity/∂φ̇ = a.
            path = geometry(p, joint, m)
            d_joint += vec4(
                d_length * path[2] + real(2.0) * d_velocity * joint[2] * p.path_quadratic_shoulder[m],
                d_length * path[3] + real(2.0) * d_velocity * joint[3] * p.path_quadratic_elbow[m],
                d_velocity * path[2],
                d_velocity * path[3],
            )
        result.joint = d_joint
        return result

    @wp.func
    def pull_back(
        p: Parameters,
        slopes: Slopes,
        joint: vec4,
        force: vec6,
        load: vec2,
        muscle_next: rows,
        d_joint_next: vec4,
        d_muscle_next: rows,
        d_hand_next: vec4,
    ) -> StepGradients:
        """Return the gradients with respect to what a step takes, from those with respect to what it gives."""
        # The motion: joint' and hand' depend on joint, force and load; gradients of parameters and weights are unused.
        _p, d_joint, d_force, d_load, _w_joint, _w_hand = wp.grad(weighted_motion)(
            p, joint, force, load, d_joint_next, d_hand_next
        )
        return pull_back_muscles(p, slopes, joint, muscle_next, d_muscle_next, d_joint, d_force, d_load)

    @wp.func
    def pull_back_in_field(
        p: Parameters,
        slopes: Slopes,
        joint: vec4,
        force: vec6,
        offset: vec2,
        velocity_gain: mat22,
        position_gain: mat22,
        muscle_next: rows,
        d_joint_next: vec4,
        d_muscle_next: rows,
        d_hand_next: vec4,
    ) -> StepGradients:
        """Return what ``pull_back`` does where the load is offset + B v − K x of the hand before the step."""
        _p, d_joint, d_force, d_offset, _b, _k, _w_joint, _w_hand = wp.grad(weighted_motion_in_field)(
            p, joint, force, offset, velocity_gain, position_gain, d_joint_next, d_hand_next
        )
        return pull_back_muscles(p, slopes, joint, muscle_next, d_muscle_next, d_joint, d_force, d_offset)

    return ArmAdjoint(Slopes, StepGradients, linearize, pull_back, pull_back_in_field)


@wp.func
def weighted_motion(p: Any, joint: Any, force: Any, load: Any, joint_weight: Any, hand_weight: Any) -> Any:
    """Return the weighted sum of joint state and hand one step on: its gradient is the weights' pulled back."""
    joint_next = next_joint(p, joint, muscle_torque(p, joint, force), load)
    return wp.dot(joint_weight, joint_next) + wp.dot(hand_weight, hand(p, joint_next))


@wp.func
def weighted_motion_in_field(
    p: Any,
    joint: Any,
    force: Any,
    offset: Any,
    velocity_gain: Any,
    position_gain: Any,
    joint_weight: Any,
    hand_weight: Any,
) -> Any:
    """Return ``weighted_motion`` under the force on the hand that its motion before the step makes."""
    load = hand_force(hand(p, joint), offset, velocity_gain, position_gain)
    return weighted_motion(p, joint, force, load, joint_weight, hand_weight)


@wp.func
def activation_slopes(p: Any, activation: Any, excitation: Any) -> Any:
    """Return the partial derivatives (2,) of ``next_activation`` by activation and excitation.

    Zero where a clamp of ``next_activation`` holds its argument or its result.
    """
    zero = type(activation)(0.0)
    one = type(activation)(1.0)
    u = wp.clamp(excitation, p.min_activation, one)
    a = wp.clamp(activation, p.min_activation, one)
    scale = type(activation)(0.5) + type(activation)(1.5) * a
    rises = u > a
    tau = wp.where(rises, p.tau_activation * scale, p.tau_deactivation / scale)
    tau_slope = wp.where(rises, type(activation)(1.5) / scale, -type(activation)(1.5) / scale)  # ∂τ/∂a over τ
    change = p.timestep * (u - a) / tau
    new = activation + change
    if new < p.min_activation or new > one:
        return wp.vector(zero, zero)
    by_activation = type(activation)(1.0)
    by_excitation = type(activation)(0.0)
    if activation >= p.min_activation and activation <= one:
        by_activation -= p.timestep / tau + change * tau_slope
    if excitation >= p.min_activation and excitation <= one:
        by_excitation = p.timestep / tau
    return wp.vector(by_activation, by_excitation)


@wp.func
def force_slopes(p: Any, activation: Any, force_length: Any, length: Any, velocity: Any) -> Any:
    """Return the partial derivatives (3,) of ``active_force_velocity`` by activation, force-length and velocity.

    By length it has none but the jump of ``a`` at the optimal length. Quotients n/d are derived as (n' − (n/d) d')/d.
    """
    zero = type(activation)(0.0)
    one = type(activation)(1.0)
    two = type(activation)(2.0)
    tiny = type(activation)(MIN_DENOMINATOR)
    above = length > one
    a = p.hill_a * wp.where(above, force_length, one)
    a_slope = wp.where(above, p.hill_a, zero)
    span = p.low_activation_origin - p.low_activation
    lowered = one - p.low_activation_drop * (activation - p.low_activation) / span
    low = activation < p.low_activation
    b = p.hill_b * wp.where(low, lowered * lowered, one)
    b_slope = wp.where(low, -two * p.hill_b * lowered * p.low_activation_drop / span, zero)
    isometric = force_length * activation
    if velocity < zero:
        distance = b - velocity
        force = (velocity * activation * a + isometric * b) / distance
        if force < zero:
            return wp.vector(zero, zero, zero)
        return wp.vector(
            (velocity * a + force_length * b + (isometric - force) * b_slope) / distance,
            (velocity * activation * a_slope + activation * b) / distance,
            (activation * a + force) / distance,
        )
    # Lengthening: force = gain · isometric + slope · velocity − pole · rise / (pole + velocity), with
    # pole = rise / steepness.
    slope = p.lengthening_asymptote_slope
    gain = p.lengthening_force
    stiffness = p.lengthening_slope_ratio * activation * (force_length + a) / b
    steepness = stiffness - slope
    by_steepness = type(activation)(1.0)
    if wp.abs(steepness) < tiny:  # held there by the guard
        steepness = tiny
        by_steepness = zero
    rise = (gain - one) * isometric
    pole = rise / steepness
    denominator = pole + velocity
    if wp.abs(denominator) < tiny:
        denominator = tiny
    share = pole / denominator
    stiffness_by_activation = p.lengthening_slope_ratio * (force_length + a) / b - stiffness * b_slope / b
    stiffness_by_force_length = p.lengthening_slope_ratio * activation * (one + a_slope) / b
    rise_by_activation = (gain - one) * force_length
    rise_by_force_length = (gain - one) * activation
    pole_by_activation = (rise_by_activation - by_steepness * pole * stiffness_by_activation) / steepness
    pole_by_force_length = (rise_by_force_length - by_steepness * pole * stiffness_by_force_length) / steepness
    by_pole = rise / denominator * (one - share)
    return wp.vector(
        gain * force_length - share * rise_by_activation - by_pole * pole_by_activation,
        gain * activation - share * rise_by_force_length - by_pole * pole_by_force_length,
        slope + share * rise / denominator,
    )
