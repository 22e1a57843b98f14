"""The adjoint of a rollout's kernel: one thread a trial, back through its steps, arms and network."""

import functools
from typing import Any

import warp as wp

from bilateral_rl.bptt.features import Features
from bilateral_rl.bptt.network_adjoint import network_adjoint
from bilateral_rl.bptt.network_kernels import NetworkShape, network_types
from bilateral_rl.bptt.rollout_structs import HAND, N_SENSED, View, rollout_structs
from bilateral_rl.bptt.sense_kernels import sense_functions
from bilateral_rl.bptt.spring_kernels import spring_functions
from bilateral_rl.bptt.step_kernels import step_functions
from bilateral_rl.envs.arm.adjoint import arm_adjoint
from bilateral_rl.envs.arm.muscles import resting_muscles
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import ACTIVATION, FORCE, LENGTH, VELOCITY, arm_types
from bilateral_rl.envs.arm.physics import hand as hand_state
from bilateral_rl.envs.reward import step_terms


@functools.cache
def rollout_adjoint(real: Any, shape: NetworkShape, features: Features) -> wp.Kernel:
    """Return the kernel for networks of ``shape`` in precision ``real``."""
    _, vec2, vec4, vec6, rows, Parameters = arm_types(real)
    network = network_types(real, shape)
    Weights, Activity, Deltas, vec_out = network.Weights, network.Activity, network.Deltas, network.vec_out
    structs = rollout_structs(real, features.further_losses)
    Trials, Senses, Trajectories = structs.Trials, structs.Senses, structs.Trajectories
    UpstreamGradients, CarriedGradients = structs.UpstreamGradients, structs.CarriedGradients
    mat22, vec_sensed, vec_terms = structs.mat22, structs.vec_sensed, structs.vec_terms
    parts, senses_of = step_functions(real, features), sense_functions(real, shape, features)
    at_rest, seen_target, steady_force = parts.at_rest, parts.seen_target, parts.steady_force
    within, all_terms = parts.within, parts.all_terms
    by_sensed, sensed_later, driven = senses_of.by_sensed, senses_of.sensed_later, senses_of.driven
    spring_force, spring_slopes, back_to_other_hand = spring_functions(real, features)
    excite_adjoint = network_adjoint(real, shape, features.hidden_noise)
    adjoint = arm_adjoint(real)
    linearize, pull_back, pull_back_in_field = adjoint.linearize, adjoint.pull_back, adjoint.pull_back_in_field
    arms, size_of_view = features.arms, View.of(features.arms).size
    has_forces, has_further, has_senses = features.forces, features.further_losses, features.senses
    hands = wp.types.matrix((arms, 4), real)  # what a thread holds of its hands, a row each

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
        started = hands()
        for arm in range(arms):
            if arms > 1:
                started[arm] = hand_state(p, at_rest(trials.start[trial * arms + arm]))
            for stream in range(n_streams):
                hand = trial * arms + arm
                c.joint[stream, hand] = vec4()
                c.muscle[stream, hand] = rows()
                c.hand[stream, hand] = vec4()
                if has_further:
                    c.excitation[stream, hand] = vec6()
                d.combination[stream, trial, 0, arm] = real(0.0)
                d.combination[stream, trial, 1, arm] = real(0.0)
        for back in range(n_steps):
            t = n_steps - 1 - back
            joints = hands()
            positions = hands()
            for arm in range(arms):
                joint = at_rest(trials.start[trial * arms + arm])
                if t > 0:
                    joint = out.joint[(trial * arms + arm) * n_steps + t - 1]
                joints[arm] = joint
                if arms > 1:
                    positions[arm] = hand_state(p, joint)
            # Back through the step of each arm, to what it takes of the network and of the hands before it.
            excitation = vec_out()
            for arm in range(arms):
                hand = trial * arms + arm
                k = hand * n_steps + t
                joint = joints[arm]
                muscle = rows()
                if t == 0:
                    muscle = resting_muscles(p, joint)
                if t > 0:
                    muscle = out.muscle[k - 1]
                muscle_next = out.muscle[k]
                command = out.excitation[k]
                for m in range(N_MUSCLES):
                    excitation[arm * N_MUSCLES + m] = command[m]
                error = out.hand[k] - seen_target(p, trials, hand, t)
                load = steady_force(trials, hand, t)
                velocity_gain = mat22()
                position_gain = mat22()
                pull_by_position = mat22()
                pull_by_velocity = mat22()
                if has_forces:
                    velocity_gain = trials.velocity_gain[hand]
                    position_gain = trials.position_gain[hand]
                if arms > 1:
                    # At any one moment a spring is a field like others, affine in the motion of the hand.
                    other = arms - 1 - arm
                    own = positions[arm]
                    pull_by_position, pull_by_velocity = spring_slopes(
                        trials, trial, own, positions[other], started[arm], started[other]
                    )
                    pull = spring_force(trials, trial, own, positions[other], started[arm], started[other])
                    load = (
                        load + pull + pull_by_position * vec2(own[0], own[1]) + pull_by_velocity * vec2(own[2], own[3])
                    )
                    velocity_gain = velocity_gain - pull_by_velocity
                    position_gain = position_gain + pull_by_position
                # What does not depend on the stream is worked out once for both.
                slopes = linearize(p, joint, muscle[ACTIVATION], driven(senses, k, command), muscle_next)
                for stream in range(n_streams):
                    # The loss sees this step's end by its terms, by the next step (carried) and, maybe, by itself.
                    d_joint = c.joint[stream, hand]
                    d_muscle = c.muscle[stream, hand]
                    d_hand = c.hand[stream, hand]
                    d_command = vec6()
                    if has_further:
                        after = hand_state(p, out.joint[k])
                        change = vec6()
                        if t > 0:
                            change = command - out.excitation[k - 1]
                        by_error, by_velocity, by_excitation, by_change, by_force, _counts, _weight = wp.grad(
                            weighted_all_terms
                        )(
                            error,
                            vec2(after[2], after[3]),
                            command,
                            change,
                            wp.cw_div(muscle_next[FORCE], p.max_isometric_force),
                            within(t, counts_from),
                            g.terms[stream],
                        )
                        d_hand = d_hand + vec4(by_error[0], by_error[1], by_velocity[0], by_velocity[1])
                        # A change is this excitation minus the one before, which is met next.
                        d_command = by_excitation + c.excitation[stream, hand]
                        if t > 0:
                            d_command = d_command + by_change
                            c.excitation[stream, hand] = -by_change
                        for m in range(N_MUSCLES):
                            d_muscle[FORCE, m] = d_muscle[FORCE, m] + by_force[m] / p.max_isometric_force[m]
                    else:
                        d_error, d_effort, _weight = wp.grad(weighted_terms)(error, command, g.terms[stream])
                        d_hand = d_hand + vec4(d_error[0], d_error[1], real(0.0), real(0.0))
                        d_command = d_effort
                    if g.joint.shape[1] > 0:
                        d_joint = d_joint + g.joint[stream, k]
                        d_muscle = d_muscle + g.muscle[stream, k]
                        d_position = g.hand[stream, k]
                        d_hand = d_hand + vec4(d_position[0], d_position[1], real(0.0), real(0.0))
                    if has_forces or arms > 1:
                        gradients = pull_back_in_field(
                            p, slopes, joint, muscle[FORCE], load, velocity_gain, position_gain,
                            muscle_next, d_joint, d_muscle, d_hand,
                        )  # fmt: skip
                    else:
                        gradients = pull_back(
                            p, slopes, joint, muscle[FORCE], load, muscle_next, d_joint, d_muscle, d_hand
                        )
                    # Of the state at the step's start, the arm takes activation and force, the network the rest.
                    d_state = rows()
                    d_state[ACTIVATION] = gradients.activation
                    d_state[FORCE] = gradients.force
                    c.joint[stream, hand] = gradients.joint
                    c.muscle[stream, hand] = d_state
                    c.command[stream, hand] = gradients.excitation + d_command
                    if arms > 1:
                        c.pull[stream, hand] = back_to_other_hand(pull_by_position, pull_by_velocity, gradients.load)
            # Back through the network, to what it took of the arms; what it takes of the targets is no state.
            for stream in range(n_streams):
                d_excitation = vec_out()
                for arm in range(arms):
                    by_command = c.command[stream, trial * arms + arm]
                    for m in range(N_MUSCLES):
                        d_excitation[arm * N_MUSCLES + m] = by_command[m]
                sample = trial * n_steps + t
                d_observation = excite_adjoint(w, a, d, s, sample, stream, trial, excitation, d_excitation)
                for arm in range(arms):
                    hand = trial * arms + arm
                    d_sensed = by_sensed(d_observation, arm)
                    if has_senses:
                        sensed = vec_sensed()
                        for i in range(N_SENSED):
                            sensed[i] = a.observation[sample][arm * size_of_view + i]
                        d_sensed = sensed_later(senses, c, stream, hand, t, n_steps, sensed, d_sensed)
                    d_state = c.muscle[stream, hand]
                    for m in range(N_MUSCLES):
                        optimal = p.optimal_muscle_length[m]
                        d_state[LENGTH, m] = d_sensed[m] / optimal
                        d_state[VELOCITY, m] = d_sensed[N_MUSCLES + m] / (p.normalized_max_velocity * optimal)
                    c.muscle[stream, hand] = d_state
                    d_hand = vec4(d_sensed[HAND], d_sensed[HAND + 1], real(0.0), real(0.0))
                    if arms > 1:
                        d_hand = d_hand + c.pull[stream, trial * arms + arms - 1 - arm]
                    c.hand[stream, hand] = d_hand

    return roll_adjoint
