"""One thread a trial: arm and network in a closed loop over the steps, and its adjoint."""

import functools
from typing import Any, NamedTuple

import warp as wp

from bilateral_rl.bptt.features import Features
from bilateral_rl.bptt.network_adjoint import network_adjoint
from bilateral_rl.bptt.network_kernels import NetworkShape, NetworkTypes, network_forward, network_types
from bilateral_rl.bptt.rollout_structs import HAND, RolloutStructs, rollout_structs
from bilateral_rl.bptt.step_kernels import step_functions
from bilateral_rl.envs.arm.adjoint import arm_adjoint
from bilateral_rl.envs.arm.hand_force import hand_force
from bilateral_rl.envs.arm.muscles import activate, muscle_torque, muscles_at, resting_muscles
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import ACTIVATION, FORCE, LENGTH, VELOCITY, arm_types, next_joint
from bilateral_rl.envs.arm.physics import hand as hand_state
from bilateral_rl.envs.reward import step_terms


class RolloutKernels(NamedTuple):
    """The kernels of a rollout, for a thread a trial, and the structs they take."""

    roll: wp.Kernel
    """Every step of a trial; fills ``Activity`` and ``Trajectories``."""
    roll_adjoint: wp.Kernel
    """Back through the steps of a trial; fills ``Deltas``."""
    network: NetworkTypes
    structs: RolloutStructs


@functools.cache
def rollout_kernels(real: Any, shape: NetworkShape, features: Features) -> RolloutKernels:
    """Return the kernels for networks of ``shape`` in precision ``real`` (``wp.float32`` or ``wp.float64``).

    What ``features`` lack is left out when the kernels are compiled, as if it stood nowhere.
    """
    _, vec2, vec4, vec6, rows, Parameters = arm_types(real)
    network = network_types(real, shape)
    Weights, Activity, Deltas = network.Weights, network.Activity, network.Deltas
    structs = rollout_structs(real, features.further_losses)
    Trials, Senses, Trajectories = structs.Trials, structs.Senses, structs.Trajectories
    UpstreamGradients, CarriedGradients = structs.UpstreamGradients, structs.CarriedGradients
    vec_terms = structs.vec_terms
    parts = step_functions(real, shape, features)
    at_rest, seen_target, steady_force = parts.at_rest, parts.seen_target, parts.steady_force
    observe, sensed_later, driven = parts.observe, parts.sensed_later, parts.driven
    within, all_terms = parts.within, parts.all_terms
    excite = network_forward(real, shape, features.hidden_noise)
    excite_adjoint = network_adjoint(real, shape, features.hidden_noise)
    adjoint = arm_adjoint(real)
    linearize, pull_back, pull_back_in_field = adjoint.linearize, adjoint.pull_back, adjoint.pull_back_in_field
    _, has_forces, has_further, has_senses, _ = features

    @wp.func
    def weighted_terms(error: vec2, excitation: vec6, weight: vec_terms) -> real:
        """Return the weighted sum of a step's terms: its gradient is that of the loss by error and excitation."""
        return wp.dot(weight, step_terms(error, excitation))

    @wp.func
    def weighted_all_terms(
        error: vec2,
        velocity: vec2,
        excitation: vec6,
        change: vec6,
        relative_force: vec6,
        counts: real,
        weight: vec_terms,
    ) -> real:
        """Return the weighted sum of all six."""
        return wp.dot(weight, all_terms(error, velocity, excitation, change, relative_force, counts))

    @wp.kernel(module="unique", enable_backward=False)
    def roll(
        p: Parameters,
        w: Weights,
        trials: Trials,
        senses: Senses,
        batch: int,
        n_steps: int,
        counts_from: int,
        first: int,
        a: Activity,
        out: Trajectories,
    ) -> None:
        trial = first + wp.tid()
        s = trial // batch
        joint = at_rest(trials.start[trial])
        muscle = resting_muscles(p, joint)
        position = hand_state(p, joint)
        for t in range(n_steps):
            k = trial * n_steps + t
            target = seen_target(p, trials, trial, t)
            observation = observe(p, trials, senses, out, trial, t, n_steps, muscle, position, target)
            excitation = excite(w, a, s, k, observation)
            load = steady_force(trials, trial, t)
            if has_forces:
                load = hand_force(position, load, trials.velocity_gain[trial], trials.position_gain[trial])
            joint_next = next_joint(p, joint, muscle_torque(p, joint, muscle[FORCE]), load)
            muscle = muscles_at(p, joint, activate(p, muscle[ACTIVATION], driven(senses, k, excitation)))
            joint = joint_next
            position = hand_state(p, joint)
            hand = vec2(position[0], position[1])
            out.joint[k] = joint
            out.muscle[k] = muscle
            out.hand[k] = hand
            out.excitation[k] = excitation
            if has_further:
                change = vec6()
                if t > 0:
                    change = excitation - out.excitation[k - 1]
                velocity = vec2(position[2], position[3])
                relative_force = wp.cw_div(muscle[FORCE], p.max_isometric_force)
                out.terms[k] = all_terms(
                    hand - target, velocity, excitation, change, relative_force, within(t, counts_from)
                )
            else:
                out.terms[k] = step_terms(hand - target, excitation)

    @wp.kernel(module="unique", enable_backward=False)
    def roll_adjoint(
        p: Parameters,
        w: Weights,
        trials: Trials,
        senses: Senses,
        batch: int,
        n_steps: int,
        counts_from: int,
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
            if has_further:
                c.excitation[stream, trial] = vec6()
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
            error = out.hand[k] - seen_target(p, trials, trial, t)
            load = steady_force(trials, trial, t)
            # What does not depend on the stream is worked out once for both.
            slopes = linearize(p, joint, muscle[ACTIVATION], driven(senses, k, excitation), muscle_next)
            for stream in range(n_streams):
                # The loss sees this step's end by its terms, by the next step (carried) and, maybe, by itself.
                d_joint = c.joint[stream, trial]
                d_muscle = c.muscle[stream, trial]
                d_hand = c.hand[stream, trial]
                d_command = vec6()
                if has_further:
                    after = hand_state(p, out.joint[k])
                    change = vec6()
                    if t > 0:
                        change = excitation - out.excitation[k - 1]
                    by_error, by_velocity, by_excitation, by_change, by_force, _counts, _weight = wp.grad(
                        weighted_all_terms
                    )(
                        error,
                        vec2(after[2], after[3]),
                        excitation,
                        change,
                        wp.cw_div(muscle_next[FORCE], p.max_isometric_force),
                        within(t, counts_from),
                        g.terms[stream],
                    )
                    d_hand = d_hand + vec4(by_error[0], by_error[1], by_velocity[0], by_velocity[1])
                    # A change is this excitation minus the one before, which is met next.
                    d_command = by_excitation + c.excitation[stream, trial]
                    if t > 0:
                        d_command = d_command + by_change
                        c.excitation[stream, trial] = -by_change
                    for m in range(N_MUSCLES):
                        d_muscle[FORCE, m] = d_muscle[FORCE, m] + by_force[m] / p.max_isometric_force[m]
                else:
                    d_error, d_effort, _weight = wp.grad(weighted_terms)(error, excitation, g.terms[stream])
                    d_hand = d_hand + vec4(d_error[0], d_error[1], real(0.0), real(0.0))
                    d_command = d_effort
                if g.joint.shape[1] > 0:
                    d_joint = d_joint + g.joint[stream, k]
                    d_muscle = d_muscle + g.muscle[stream, k]
                    d_position = g.hand[stream, k]
                    d_hand = d_hand + vec4(d_position[0], d_position[1], real(0.0), real(0.0))
                if has_forces:
                    gradients = pull_back_in_field(
                        p, slopes, joint, muscle[FORCE], load, trials.velocity_gain[trial], trials.position_gain[trial],
                        muscle_next, d_joint, d_muscle, d_hand,
                    )  # fmt: skip
                else:
                    gradients = pull_back(p, slopes, joint, muscle[FORCE], load, muscle_next, d_joint, d_muscle, d_hand)
                d_excitation = gradients.excitation + d_command
                d_observation = excite_adjoint(w, a, d, s, k, stream, trial, excitation, d_excitation)
                if has_senses:
                    d_observation = sensed_later(senses, a, c, stream, trial, t, n_steps, d_observation)
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

    return RolloutKernels(roll, roll_adjoint, network, structs)
