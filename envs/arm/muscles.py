"""All six muscles of one arm at once, as Warp functions over the physics of one muscle."""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import LENGTH, N_MUSCLE_ROWS, VELOCITY, arm_physics


@functools.cache
def muscle_functions(real: Any) -> SimpleNamespace:
    """Warp functions over all six muscles of one arm, for kernels of precision ``real``.

    ``muscle_torque`` reads an arm's muscle state, ``muscles_at`` makes one, ``proprioception`` is what is felt of it.
    """
    physics = arm_physics(real)
    Parameters, vec2, vec4, vec6 = physics.Parameters, physics.vec2, physics.vec4, physics.vec6
    geometry, muscle_column, next_activation = physics.geometry, physics.muscle_column, physics.next_activation
    vec12 = wp.types.vector(2 * N_MUSCLES, real)
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

    @wp.func
    def proprioception(p: Parameters, state: rows) -> vec12:
        """Muscle lengths (optimal lengths), then velocities (maximal velocities)."""
        felt = vec12()
        for m in range(N_MUSCLES):
            felt[m] = state[LENGTH, m] / p.optimal_muscle_length[m]
            felt[N_MUSCLES + m] = state[VELOCITY, m] / (p.normalized_max_velocity * p.optimal_muscle_length[m])
        return felt

    return SimpleNamespace(
        rows=rows, proprioception=proprioception, muscle_torque=muscle_torque, muscles_at=muscles_at, activate=activate
    )
