"""One thread a trial: arm and network in a closed loop over the steps, and its adjoint."""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from bilateral_rl.bptt.network_kernels import NetworkShape, network_functions
from bilateral_rl.envs.arm.adjoint import arm_adjoint
from bilateral_rl.envs.arm.muscles import muscle_functions
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import ACTIVATION, FORCE, LENGTH, VELOCITY, arm_physics
from bilateral_rl.envs.reward import loss_terms

HAND, TARGET = 2 * N_MUSCLES, 2 * N_MUSCLES + 2
"""Where an observation holds the hand's and the target's x and y; lengths and velocities of the muscles come first."""


@functools.cache
def rollout_kernels(real: Any, shape: NetworkShape) -> SimpleNamespace:
    """The kernels ``roll`` and ``roll_adjoint`` and the structs they take, in precision ``real``."""
    physics, muscles, adjoint = arm_physics(real), muscle_functions(real), arm_adjoint(real)
    network, loss = network_functions(real, shape), loss_terms(real)
    Parameters, vec2, vec4, vec6, rows = physics.Parameters, physics.vec2, physics.vec4, physics.vec6, muscles.rows
    Weights, Activity, Deltas, vec_in, vec_terms = (
        network.Weights,
        network.Activity,
        network.Deltas,
        network.vec_in,
        loss.terms,
    )
    hand_state, next_joint = physics.hand, physics.next_joint
    muscle_torque, muscles_at, activate = muscles.muscle_torque, muscles.muscles_at, muscles.activate
    proprioception, step_terms = muscles.proprioception, loss.step_terms
    linearize, pull_back = adjoint.linearize, adjoint.pull_back
    excite, excite_adjoint = network.excite, network.excite_adjoint

    @wp.struct
    class Trials:
        """Of ``S`` networks with ``B`` trials each, ``n = S * B``."""

        start: wp.array(dtype=vec2)  # (n,) angles (rad), at rest
        target: wp.array(dtype=vec2)  # (n,) m
        load: wp.array(dtype=vec2)  # (n,) N

    @wp.struct
    class Trajectories:
        """After each of ``T`` steps; sample ``k`` is step ``k % T`` of trial ``k // T``."""

        joint: wp.array(dtype=vec4)  # (n * T,)
        muscle: wp.array(dtype=rows)  # (n * T,)
        hand: wp.array(dtype=vec2)  # (n * T,) m
        excitation: wp.array(dtype=vec6)  # (n * T,) the step's command
        terms: wp.array(dtype=vec_terms)  # (n * T,) the step's loss terms

    @wp.struct
    class Gradients:
        """Of each stream's loss; all but ``terms`` are empty for losses that look at nothing else."""

        terms: wp.array(dtype=vec_terms)  # (streams,) with respect to every step's terms
        joint: wp.array2d(dtype=vec4)  # (streams, n * T)
        muscle: wp.array2d(dtype=rows)  # (streams, n * T)
        hand: wp.array2d(dtype=vec2)  # (streams, n * T)

    @wp.struct
    class Carried:
        """Gradients with respect to the state, on their way back through the steps."""

        joint: wp.array2d(dtype=vec4)  # (streams, n)
        muscle: wp.array2d(dtype=rows)  # (streams, n)
        hand: wp.array2d(dtype=vec4)  # (streams, n)

    @wp.func
    def at_rest(p: Parameters, start: vec2) -> vec4:
        return vec4(start[0], start[1], real(0.0), real(0.0))

    @wp.func
    def resting_muscles(p: Parameters, joint: vec4) -> rows:
        activation = vec6()
        for m in range(N_MUSCLES):
            activation[m] = p.min_activation
        return muscles_at(p, joint, activation)

    @wp.func
    def weighted_terms(error: vec2, excitation: vec6, weight: vec_terms) -> real:
        return wp.dot(weight, step_terms(error, excitation))

    @wp.kernel(module="unique", enable_backward=False)
    def roll(
        p: Parameters, w: Weights, trials: Trials, batch: int, n_steps: int, first: int, a: Activity, out: Trajectories
    ) -> None:
        trial = first + wp.tid()
        s = trial // batch
        target = trials.target[trial]
        load = trials.load[trial]
        joint = at_rest(p, trials.start[trial])
        muscle = resting_muscles(p, joint)
        position = hand_state(p, joint)
        for t in range(n_steps):
            k = trial * n_steps + t
            observation = vec_in()
            felt = proprioception(p, muscle)
            for i in range(2 * N_MUSCLES):
                observation[i] = felt[i]
            for axis in range(2):
                observation[HAND + axis] = position[axis]
                observation[TARGET + axis] = target[axis]
            excitation = excite(w, a, s, k, observation)
            there = next_joint(p, joint, muscle_torque(p, joint, muscle[FORCE]), load)
            muscle = muscles_at(p, joint, activate(p, muscle[ACTIVATION], excitation))
            joint = there
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
        g: Gradients,
        d: Deltas,
        c: Carried,
    ) -> None:
        trial = first + wp.tid()
        s = trial // batch
        n_streams = g.terms.shape[0]
        start = at_rest(p, trials.start[trial])
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
            slopes = linearize(p, joint, muscle[ACTIVATION], excitation, muscle_next)
            for stream in range(n_streams):
                of_error, of_command, _weight = wp.grad(weighted_terms)(error, excitation, g.terms[stream])
                of_joint = c.joint[stream, trial]
                of_muscle = c.muscle[stream, trial]
                of_hand = c.hand[stream, trial] + vec4(of_error[0], of_error[1], real(0.0), real(0.0))
                if g.joint.shape[1] > 0:
                    of_joint = of_joint + g.joint[stream, k]
                    of_muscle = of_muscle + g.muscle[stream, k]
                    seen = g.hand[stream, k]
                    of_hand = of_hand + vec4(seen[0], seen[1], real(0.0), real(0.0))
                pulled = pull_back(
                    p, slopes, joint, muscle[FORCE], trials.load[trial], muscle_next, of_joint, of_muscle, of_hand
                )
                of_seen = excite_adjoint(w, a, d, s, k, stream, trial, excitation, pulled.excitation + of_command)
                of_state = rows()
                for m in range(N_MUSCLES):
                    optimal = p.optimal_muscle_length[m]
                    of_state[ACTIVATION, m] = pulled.activation[m]
                    of_state[FORCE, m] = pulled.force[m]
                    of_state[LENGTH, m] = of_seen[m] / optimal
                    of_state[VELOCITY, m] = of_seen[N_MUSCLES + m] / (p.normalized_max_velocity * optimal)
                c.joint[stream, trial] = pulled.joint
                c.muscle[stream, trial] = of_state
                c.hand[stream, trial] = vec4(of_seen[HAND], of_seen[HAND + 1], real(0.0), real(0.0))

    return SimpleNamespace(
        roll=roll, roll_adjoint=roll_adjoint, Trials=Trials, Trajectories=Trajectories, Gradients=Gradients,
        Carried=Carried, physics=physics, network=network, rows=rows, vec_terms=vec_terms,
    )  # fmt: skip
