"""The terms of one step's loss, once, for the environments' reward and for the supervised losses (paper section 4)."""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import arm_physics
from bilateral_rl.vocabulary import LOSS_WEIGHTS, SIDES


@functools.cache
def loss_terms(real: Any) -> SimpleNamespace:
    """The terms in precision ``real``: the vector type ``terms`` and the Warp function ``step_terms``."""
    physics = arm_physics(real)
    vec2, vec6 = physics.vec2, physics.vec6
    terms = wp.types.vector(3, real)

    @wp.func
    def step_terms(error: vec2, excitation: vec6) -> terms:
        """Cartesian 1, Cartesian 2 and muscle activation of one step.

        ``error`` is hand minus target (m) after the step, ``excitation`` the command of the step.
        """
        effort = real(0.0)
        for m in range(N_MUSCLES):
            effort += excitation[m] * excitation[m]
        return terms(
            (wp.abs(error[0]) + wp.abs(error[1])) / real(2.0),
            real(5.0) * (error[0] * error[0] + error[1] * error[1]),
            effort / real(float(N_MUSCLES)),
        )

    return SimpleNamespace(terms=terms, step_terms=step_terms)


weight_rows = wp.types.matrix((2, 3), wp.float32)


def stream_weights() -> Any:
    """(2, 3) matrix for kernels: the weights of the terms in the dominant and in the non-dominant loss."""
    return weight_rows(*(weight for side in SIDES for weight in LOSS_WEIGHTS[side].terms))
