"""The terms of one step's loss, once, for the environments' reward and for the supervised losses (paper section 4)."""

from dataclasses import dataclass
from typing import Any

import warp as wp

from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import arm_physics


@dataclass(frozen=True)
class LossWeights:
    """Weights of a step's terms in one loss; without the weight penalty, which is a loss on parameters."""

    cartesian_1: float
    """Of the mean absolute error of the hand (m)."""
    cartesian_2: float
    """Of ten times the mean squared error of the hand (m²)."""
    activation: float
    """Of the mean squared muscle excitation."""


DOMINANT_WEIGHTS = LossWeights(cartesian_1=0.0, cartesian_2=5.0, activation=2.0)
NON_DOMINANT_WEIGHTS = LossWeights(cartesian_1=5.0, cartesian_2=0.0, activation=0.0)

_real = wp.float32
_physics = arm_physics(_real)
vec2, vec6 = _physics.vec2, _physics.vec6
terms = wp.types.vector(3, _real)
weight_rows = wp.types.matrix((2, 3), _real)


@wp.func
def step_terms(error: vec2, excitation: vec6) -> terms:
    """Cartesian 1, Cartesian 2 and muscle activation of one step.

    ``error`` is hand minus target (m) after the step, ``excitation`` the command of the step.
    """
    effort = _real(0.0)
    for m in range(N_MUSCLES):
        effort += excitation[m] * excitation[m]
    return terms(
        (wp.abs(error[0]) + wp.abs(error[1])) / _real(2.0),
        _real(5.0) * (error[0] * error[0] + error[1] * error[1]),
        effort / _real(float(N_MUSCLES)),
    )


def stream_weights() -> Any:
    """(2, 3) matrix for kernels: the weights of the terms in the dominant and in the non-dominant loss."""
    rows = [(w.cartesian_1, w.cartesian_2, w.activation) for w in (DOMINANT_WEIGHTS, NON_DOMINANT_WEIGHTS)]
    return weight_rows(*rows[0], *rows[1])
