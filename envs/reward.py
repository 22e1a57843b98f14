"""The terms of one step's loss, once, for the environments' reward and for the supervised losses (paper section 4)."""

from typing import Any

import warp as wp

from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.losses import PAPER_TERMS, LossSettings


@wp.func
def step_terms(error: Any, excitation: Any) -> Any:
    """Return a step's terms (3,), Cartesian 1, Cartesian 2 and muscle activation, in either precision.

    ``error`` (2,) is hand minus target (m) after the step, ``excitation`` (6,) the command of the step. A mean over x
    and y is half their sum; Cartesian 2 is ten times the mean square.
    """
    effort = type(error[0])(0.0)
    for m in range(N_MUSCLES):
        effort += excitation[m] * excitation[m]
    return wp.vector(
        (wp.abs(error[0]) + wp.abs(error[1])) / type(error[0])(2.0),
        type(error[0])(5.0) * (error[0] * error[0] + error[1] * error[1]),
        effort / type(error[0])(float(N_MUSCLES)),
    )


@wp.func
def further_terms(hand_velocity: Any, change: Any, relative_force: Any) -> Any:
    """Return a step's further terms (3,): squared hand speed, and means of squared changes and squared forces.

    ``hand_velocity`` (2,) (m/s) and ``relative_force`` (6,), over the maximal isometric ones, are those after the step;
    ``change`` (6,) is that of the excitations since the step before.
    """
    muscles = type(change[0])(float(N_MUSCLES))
    return wp.vector(
        wp.dot(hand_velocity, hand_velocity),
        wp.dot(change, change) / muscles,
        wp.dot(relative_force, relative_force) / muscles,
    )


weight_rows: Any = wp.types.matrix((2, 3), wp.float32)


@wp.struct
class StepWeights:
    """What the terms of a step count in the dominant (first row) and in the non-dominant loss."""

    terms: weight_rows  # of the paper's terms
    further: weight_rows  # of the further terms
    first_counted: wp.int32  # first step in which error and speed of the hand count


def step_weights(losses: LossSettings, trial_length: int) -> Any:
    """Return the weights of ``losses`` in trials of so many steps, for kernels."""
    weights = StepWeights()
    n = len(PAPER_TERMS)
    weights.terms = weight_rows(*(weight for row in losses.weights for weight in row[:n]))
    weights.further = weight_rows(*(weight for row in losses.weights for weight in row[n:]))
    weights.first_counted = wp.int32(0 if losses.last_steps is None else max(trial_length - losses.last_steps, 0))
    return weights
