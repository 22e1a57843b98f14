"""The structs that a rollout's kernels take: trials, senses, trajectories, and gradients on their way back."""

import functools
from typing import Any, NamedTuple

import warp as wp

from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import arm_types
from bilateral_rl.envs.losses import FURTHER_TERMS, PAPER_TERMS

N_SENSED = 2 * N_MUSCLES + 2
"""Numbers of an observation that are sensed: lengths and velocities of the muscles, the hand's x and y."""
N_NOISE = N_SENSED + N_MUSCLES
"""Normal numbers of a step: for what is sensed, and for the excitations."""
HAND = 2 * N_MUSCLES
"""Where the view of an arm holds the x and y of its hand; lengths and velocities of its muscles come first."""


class View(NamedTuple):
    """Where the view of an arm holds the rest, and how long it is; an observation is the view of every arm."""

    other_hand: int
    target: int
    other_target: int
    size: int

    @classmethod
    def of(cls, arms: int) -> "View":
        """Return the view of one of ``arms`` arms; with one, there is no other hand."""
        target = HAND + 2 * arms
        return cls(HAND + 2, target, target + 2, target + 2 * arms)


def n_terms(further: bool) -> int:
    """Return how many terms a step's loss has, with or without the further ones."""
    return len(PAPER_TERMS) + (len(FURTHER_TERMS) if further else 0)


class RolloutStructs(NamedTuple):
    """Structs of a rollout in one precision, and the vectors in them; arrays that a rollout does not need are empty."""

    mat22: Any
    vec_felt: Any
    """(12,): what is sensed of the muscles."""
    vec_sensed: Any
    """(14,): and of the hand."""
    vec_terms: Any
    """(3,) or (6,): terms of a step's loss."""
    Trials: Any
    Senses: Any
    Trajectories: Any
    UpstreamGradients: Any
    CarriedGradients: Any


@functools.cache
def rollout_structs(real: Any, further_losses: bool) -> RolloutStructs:
    """Return the structs in precision ``real`` (``wp.float32`` or ``wp.float64``)."""
    _, vec2, vec4, vec6, rows, _ = arm_types(real)
    mat22 = wp.types.matrix((2, 2), real)
    vec_felt = wp.types.vector(2 * N_MUSCLES, real)
    vec_sensed = wp.types.vector(N_SENSED, real)
    vec_noise = wp.types.vector(N_NOISE, real)
    vec_terms = wp.types.vector(n_terms(further_losses), real)

    @wp.struct
    class Trials:
        """Trials of ``S`` networks with ``B`` each, ``m = S * B``; trial ``i`` is one of network ``i // B``.

        Everything but the spring is of ``n = m * arms`` hands; hand ``i`` is of trial ``i // arms``.
        """

        start: wp.array(dtype=vec2)  # (n,) angles (rad), at rest
        target: wp.array(dtype=vec2)  # (n,) m
        load: wp.array(dtype=vec2)  # (n,) N
        # Of trials with a timeline: steps, and where the target jumps to.
        go: wp.array(dtype=wp.int32)  # (n,)
        jump: wp.array(dtype=wp.int32)  # (n,)
        jump_target: wp.array(dtype=vec2)  # (n,) m
        # Of trials with forces: offset + B v − K x, and a pulse in the steps of its window.
        offset: wp.array(dtype=vec2)  # (n,) N
        velocity_gain: wp.array(dtype=mat22)  # (n,) N·s/m
        position_gain: wp.array(dtype=mat22)  # (n,) N/m
        pulse: wp.array(dtype=vec2)  # (n,) N
        pulse_window: wp.array2d(dtype=wp.int32)  # (n, 2)
        # Of trials of two arms: the spring between the hands.
        stiffness: wp.array(dtype=real)  # (m,) N/m
        damping: wp.array(dtype=real)  # (m,) N·s/m
        shoulder_distance: real  # m

    @wp.struct
    class Senses:
        """Noise, delays, and the bounds of an observation."""

        noise: wp.array(dtype=vec_noise)  # (n * T,) already scaled
        felt_delay: wp.int32  # steps
        seen_delay: wp.int32  # steps
        low: vec_sensed
        high: vec_sensed

    @wp.struct
    class Trajectories:
        """What is so after each of ``T`` steps; sample ``k`` is step ``k % T`` of hand ``k // T``."""

        joint: wp.array(dtype=vec4)  # (n * T,)
        muscle: wp.array(dtype=rows)  # (n * T,)
        hand: wp.array(dtype=vec2)  # (n * T,) m
        excitation: wp.array(dtype=vec6)  # (n * T,) the step's command, without motor noise
        terms: wp.array(dtype=vec_terms)  # (n * T,) the step's loss terms

    @wp.struct
    class UpstreamGradients:
        """Gradients of each stream's loss by itself, where back-propagation begins; empty but for ``terms`` if none."""

        terms: wp.array(dtype=vec_terms)  # (streams,) with respect to every step's terms
        joint: wp.array2d(dtype=vec4)  # (streams, n * T)
        muscle: wp.array2d(dtype=rows)  # (streams, n * T)
        hand: wp.array2d(dtype=vec2)  # (streams, n * T)

    @wp.struct
    class CarriedGradients:
        """Gradients on their way back through the steps, with respect to what lies between two steps.

        What was sensed is remembered for as long as it takes: the ring's slot ``t % slots`` holds the gradient with
        respect to what was observed before step t.
        """

        joint: wp.array2d(dtype=vec4)  # (streams, n)
        muscle: wp.array2d(dtype=rows)  # (streams, n)
        hand: wp.array2d(dtype=vec4)  # (streams, n)
        excitation: wp.array2d(dtype=vec6)  # (streams, n) by the change of excitations since the step before
        command: wp.array2d(dtype=vec6)  # (streams, n) by the command of the step at hand
        pull: wp.array2d(dtype=vec4)  # (streams, n) by the other hand before the step at hand, through the spring
        felt: wp.array3d(dtype=vec_felt)  # (streams, n, delay + 1)
        seen: wp.array3d(dtype=vec2)  # (streams, n, delay + 1)

    return RolloutStructs(
        *(mat22, vec_felt, vec_sensed, vec_terms),
        *(Trials, Senses, Trajectories, UpstreamGradients, CarriedGradients),
    )
