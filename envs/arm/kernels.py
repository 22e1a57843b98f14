"""One thread an arm: the kernels that batch the physics for the differentiable :class:`~bilateral_rl.envs.arm.Arm`."""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import ACTIVATION, FORCE, N_MUSCLE_ROWS, arm_physics


@functools.cache
def muscle_functions(real: Any) -> SimpleNamespace:
    """Warp functions over all six muscles of one arm, for kernels of precision ``real``.

    ``muscle_torque`` reads an arm's muscle state, ``write_muscles`` writes one row of it per quantity.
    """
    physics = arm_physics(real)
    Parameters, vec2, vec4, vec6 = physics.Parameters, physics.vec2, physics.vec4, physics.vec6
    geometry, muscle_column, next_activation = physics.geometry, physics.muscle_column, physics.next_activation
    rows = wp.types.matrix((N_MUSCLE_ROWS, N_MUSCLES), real)

    @wp.func
    def muscle_torque(p: Parameters, joint: vec4, force: vec6) -> vec2:
        """Joint torques (N m) of the muscle forces (N); a muscle pulls its joint against its moment arm."""
        shoulder = real(0.0)
        elbow = real(0.0)
        for m in range(N_MUSCLES):
            path = geometry(p, joint, m)
            shoulder -= force[m] * path[2]
            elbow -= force[m] * path[3]
        return vec2(shoulder, elbow)

    @wp.func
    def muscles_at(p: Parameters, joint: vec4, activation: vec6) -> rows:
        """The muscle state at this geometry for these activations."""
        state = rows()
        for m in range(N_MUSCLES):
            column = muscle_column(p, m, activation[m], geometry(p, joint, m))
            for row in range(N_MUSCLE_ROWS):
                state[row, m] = column[row]
        return state

    @wp.func
    def activate(p: Parameters, activation: vec6, excitation: vec6) -> vec6:
        """Every muscle's activation one step on."""
        new = vec6()
        for m in range(N_MUSCLES):
            new[m] = next_activation(p, activation[m], excitation[m])
        return new

    return SimpleNamespace(rows=rows, muscle_torque=muscle_torque, muscles_at=muscles_at, activate=activate)


@functools.cache
def arm_kernels(real: Any) -> SimpleNamespace:
    """The kernels ``rest`` (minimal activation) and ``step`` (state in, state out), differentiable, in ``real``."""
    physics, muscles = arm_physics(real), muscle_functions(real)
    Parameters, vec2, vec4, vec6, rows = physics.Parameters, physics.vec2, physics.vec4, physics.vec6, muscles.rows
    hand, next_joint = physics.hand, physics.next_joint
    muscle_torque, muscles_at, activate = muscles.muscle_torque, muscles.muscles_at, muscles.activate

    @wp.kernel(module="unique")
    def rest(
        p: Parameters,
        joint: wp.array(dtype=vec4),
        muscle: wp.array(dtype=rows),
        cartesian: wp.array(dtype=vec4),
    ) -> None:
        arm = wp.tid()
        activation = vec6()
        for m in range(N_MUSCLES):
            activation[m] = p.min_activation
        muscle[arm] = muscles_at(p, joint[arm], activation)
        cartesian[arm] = hand(p, joint[arm])

    @wp.kernel(module="unique")
    def step(
        p: Parameters,
        joint: wp.array(dtype=vec4),
        muscle: wp.array(dtype=rows),
        excitation: wp.array(dtype=vec6),
        load: wp.array(dtype=vec2),
        joint_next: wp.array(dtype=vec4),
        muscle_next: wp.array(dtype=rows),
        cartesian_next: wp.array(dtype=vec4),
    ) -> None:
        arm = wp.tid()
        here = joint[arm]
        state = muscle[arm]
        there = next_joint(p, here, muscle_torque(p, here, state[FORCE]), load[arm])
        joint_next[arm] = there
        muscle_next[arm] = muscles_at(p, here, activate(p, state[ACTIVATION], excitation[arm]))
        cartesian_next[arm] = hand(p, there)

    return SimpleNamespace(rest=rest, step=step, physics=physics, muscles=muscles)
