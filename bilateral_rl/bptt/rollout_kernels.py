"""One thread a trial: arm and network in a closed loop over the steps, and its adjoint."""

import functools
from typing import Any, NamedTuple

import warp as wp

from bilateral_rl.bptt.network_adjoint import network_adjoint
from bilateral_rl.bptt.network_kernels import NetworkShape, NetworkTypes, network_forward, network_types
from bilateral_rl.envs.arm.adjoint import arm_adjoint
from bilateral_rl.envs.arm.muscles import activate, muscle_torque, muscles_at, proprioception, resting_muscles
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import ACTIVATION, FORCE, LENGTH, VELOCITY, arm_types, next_joint
from bilateral_rl.envs.arm.physics import hand as hand_state
from bilateral_rl.envs.reward import step_terms

HAND, TARGET = 2 * N_MUSCLES, 2 * N_MUSCLES + 2
"""Where an observation holds the hand's and the target's x and y; lengths and velocities of the muscles come first."""


class RolloutKernels(NamedTuple):
    """The kernels of a rollout, for a thread a trial, and the structs they take."""

    roll: wp.Kernel
    """Every step of a trial; fills ``Activity`` and ``Trajectories``."""
    roll_adjoint: wp.Kernel
    """Back through the steps of a trial; fills ``Deltas``."""
    network: NetworkTypes
    Trials: Any
    Trajectories: Any
    UpstreamGradients: Any
    CarriedGradients: Any


@functools.cache
def rollout_kernels(real: Any, shape: NetworkShape) -> RolloutKernels:
    """Return the kernels for networks of ``shape`` in precision ``real`` (``wp.float32`` or ``wp.float64``)."""
    _, vec2, vec4, vec6, rows, Parameters = arm_types(real)
    vec_terms = wp.types.vector(3, real)
    network = network_types(real, shape)
    Weights, Activity, Deltas, vec_in = network.Weights, network.Activity, network.Deltas, network.vec_in
    excite, excite_adjoint = network_forward(real, shape), network_adjoint(real, shape)
    adjoint = arm_adjoint(real)
    linearize, pull_back = adjoint.linearize, adjoint.pull_back

    @wp.struct
    class Trials:
        """Trials of ``S`` networks with ``B`` each, ``n = S * B``; trial ``i`` is one of network ``i // B``."""

        start: wp.array(dtype=vec2)  # (n,) angles (rad), at rest
        target: wp.array(dtype=vec2)  # (n,) m
        load: wp.array(dtype=vec2)  # (n,) N

    @wp.struct
    class Trajectories:
        """What is so after each of ``T`` steps; sample ``k`` is step ``k % T`` of trial ``k // T``."""

        joint: wp.array(dtype=vec4)  # (n * T,)
        muscle: wp.array(dtype=rows)  # (n * T,)
        hand: wp.array(dtype=vec2)  # (n * T,) m
        excitation: wp.array(dtype=vec6)  # (n * T,) the step's command
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
        """Gradients with respect to the state between two steps, on their way back through the steps."""

        joint: wp.array2d(dtype=vec4)  # (streams, n)
        muscle: wp.array2d(dtype=rows)  # (streams, n)
        hand: wp.array2d(dtype=vec4)  # (streams, n)

    @wp.func
    def at_rest(start: vec2) -> vec4:
        """Return the joint state at rest at the angles ``start``."""
        return vec4(start[0], start[1], real(0.0), real(0.0))

    @wp.func
    def weighted_terms(error: vec2, excitation: vec6, weight: vec_terms) -> real:
        """Return the weighted sum of a step's terms: its gradient is that of the loss by error and excitation."""
        return wp.dot(weight, step_terms(error, excitation))

    @wp.kernel(module="unique", enable_backward=False)
    def roll(
        p: Parameters, w: Weights, trials: Trials, batch: int, n_steps: int, first: int, a: Activity, out: Trajectories
    ) -> None:
        trial = first + wp.tid()
        s = trial // batch
        target = trials.target[trial]
        load = trials.load[trial]
        joint = at_rest(trials.start[trial])
        muscle = resting_muscles(p, joint)
        position = hand_state(p, joint)
        for t in range(n_steps):
            k = trial * n_steps + t
            observation = vec_in()
            sensed = proprioception(p, muscle)
            for i in range(2 * N_MUSCLES):
                observation[i] = sensed[i]
            for axis in range(2):
                observation[HAND + axis] = position[axis]
                observation[TARGET + axis] = target[axis]
            excitation = excite(w, a, s, k, observation)
            joint_next = next_joint(p, joint, muscle_torque(p, joint, muscle[FORCE]), load)
            muscle = muscles_at(p, joint, activate(p, muscle[ACTIVATION], excitation))
            joint = joint_next
            position = hand_state(p, joint)
            hand = vec2(position[0], position[1])
            out.joint[k] = joint
            out.muscle[k] = muscle
            out.hand[k] = hand
            out.excitation[k] = excitation
            out.terms[k] = step_terms(hand - target, excitation)

    @wp.kernel(module="unique", enable_backward=False)
    def roll_adjoint(
        p: Parameters,
        w: Weights,
        trials: Trials,
        batch: int,
        n_steps: int,
        first: int,
        a: Activity,
        out: Trajectories,
        g: UpstreamGradients,
        d: Deltas,
        c: CarriedGradients,
    ) -> None:
        trial = first + wp.tid()
        s = trial // batch
        n_streams = g.terms.shape[0]
        start = at_rest(trials.start[trial])
        for stream in range(n_streams):
            c.joint[stream, trial] = vec4()
            c.muscle[stream, trial] = rows()
            c.hand[stream, trial] = vec4()
            d.combination[stream, trial, 0] = real(0.0)
            d.combination[stream, trial, 1] = real(0.0)
        for back in range(n_steps):
            t = n_steps - 1 - back
            k = trial * n_steps + t
            joint = start
            muscle = rows()
            if t > 0:
                joint = out.joint[k - 1]
                muscle = out.muscle[k - 1]
            else:
                muscle = resting_muscles(p, joint)
            muscle_next = out.muscle[k]
            excitation = out.excitation[k]
            error = out.hand[k] - trials.target[trial]
            # What does not depend on the stream is worked out once for both.
            slopes = linearize(p, joint, muscle[ACTIVATION], excitation, muscle_next)
            for stream in range(n_streams):
                # The loss sees this step's end by its terms, by the next step (carried) and, maybe, by itself.
                d_error, d_command, _weight = wp.grad(weighted_terms)(error, excitation, g.terms[stream])
                d_joint = c.joint[stream, trial]
                d_muscle = c.muscle[stream, trial]
                d_hand = c.hand[stream, trial] + vec4(d_error[0], d_error[1], real(0.0), real(0.0))
                if g.joint.shape[1] > 0:
                    d_joint = d_joint + g.joint[stream, k]
                    d_muscle = d_muscle + g.muscle[stream, k]
                    d_position = g.hand[stream, k]
                    d_hand = d_hand + vec4(d_position[0], d_position[1], real(0.0), real(0.0))
                gradients = pull_back(
                    p, slopes, joint, muscle[FORCE], trials.load[trial], muscle_next, d_joint, d_muscle, d_hand
                )
                d_excitation = gradients.excitation + d_command
                d_observation = excite_adjoint(w, a, d, s, k, stream, trial, excitation, d_excitation)
                # Of the state at the step's start, the arm takes activation and force, the network lengths, velocities
                # and the hand; what the network takes of the target is no state.
                d_state = rows()
                for m in range(N_MUSCLES):
                    optimal = p.optimal_muscle_length[m]
                    d_state[ACTIVATION, m] = gradients.activation[m]
                    d_state[FORCE, m] = gradients.force[m]
                    d_state[LENGTH, m] = d_observation[m] / optimal
                    d_state[VELOCITY, m] = d_observation[N_MUSCLES + m] / (p.normalized_max_velocity * optimal)
                c.joint[stream, trial] = gradients.joint
                c.muscle[stream, trial] = d_state
                c.hand[stream, trial] = vec4(d_observation[HAND], d_observation[HAND + 1], real(0.0), real(0.0))

    return RolloutKernels(roll, roll_adjoint, network, Trials, Trajectories, UpstreamGradients, CarriedGradients)
