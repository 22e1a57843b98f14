"""All six muscles of one arm at once, as Warp functions of either precision over the physics of one muscle.

``p``, ``joint`` and precisions are as in ``physics.py``; vectors of six are over the muscles, ``state`` is the (7, 6)
muscle state.
"""

from typing import Any

import warp as wp

from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import LENGTH, N_MUSCLE_ROWS, VELOCITY, geometry, muscle_column, next_activation

N_PROPRIOCEPTION = 2 * N_MUSCLES
"""Numbers that are sensed of the muscles: a length and a velocity of each."""


@wp.func
def muscle_torque(p: Any, joint: Any, force: Any) -> Any:
    """Return the joint torques (2,) (N m) of the muscle forces (6,) (N).

    A muscle pulls towards where it is shorter, against its moment arm: torque = −Σ force · moment arm.
    """
    shoulder = type(joint[0])(0.0)
    elbow = type(joint[0])(0.0)
    for m in range(N_MUSCLES):
        path = geometry(p, joint, m)
        shoulder -= force[m] * path[2]
        elbow -= force[m] * path[3]
    return wp.vector(shoulder, elbow)


@wp.func
def muscles_at(p: Any, joint: Any, activation: Any) -> Any:
    """Return the muscle state (7, 6) at this geometry for these activations (6,)."""
    state = wp.matrix(shape=(N_MUSCLE_ROWS, N_MUSCLES), dtype=type(joint[0]))
    for m in range(N_MUSCLES):
        column = muscle_column(p, m, activation[m], geometry(p, joint, m))
        for row in range(N_MUSCLE_ROWS):
            state[row, m] = column[row]
    return state


@wp.func
def resting_muscles(p: Any, joint: Any) -> Any:
    """Return the muscle state (7, 6) at this geometry with every muscle at its minimal activation."""
    activation = wp.vector(length=N_MUSCLES, dtype=type(joint[0]))
    for m in range(N_MUSCLES):
        activation[m] = p.min_activation
    return muscles_at(p, joint, activation)


@wp.func
def activate(p: Any, activation: Any, excitation: Any) -> Any:
    """Return every muscle's activation (6,) one step on."""
    new = type(activation)()
    for m in range(N_MUSCLES):
        new[m] = next_activation(p, activation[m], excitation[m])
    return new


@wp.func
def proprioception(p: Any, state: Any) -> Any:
    """Return the sensed (12,): muscle lengths (optimal lengths), then velocities (maximal velocities)."""
    sensed = wp.vector(length=N_PROPRIOCEPTION, dtype=type(state[0, 0]))
    for m in range(N_MUSCLES):
        sensed[m] = state[LENGTH, m] / p.optimal_muscle_length[m]
        sensed[N_MUSCLES + m] = state[VELOCITY, m] / (p.normalized_max_velocity * p.optimal_muscle_length[m])
    return sensed
