"""One thread a trial: its arms and the network in a closed loop over the steps; ``rollout_adjoint.py`` goes back.

The arms of a trial go side by side through one thread, as the hands' forces on each other are those of one moment.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from bilateral_rl.bptt.features import Features
from bilateral_rl.bptt.network_kernels import NetworkShape, NetworkTypes, network_forward, network_types
from bilateral_rl.bptt.rollout_adjoint import rollout_adjoint
from bilateral_rl.bptt.rollout_structs import RolloutStructs, rollout_structs
from bilateral_rl.bptt.sense_kernels import sense_functions
from bilateral_rl.bptt.spring_kernels import spring_functions
from bilateral_rl.bptt.step_kernels import step_functions
from bilateral_rl.envs.arm.hand_force import hand_force
from bilateral_rl.envs.arm.muscles import activate, muscle_torque, muscles_at, proprioception, resting_muscles
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import ACTIVATION, FORCE, arm_types, next_joint
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
    _, vec2, _, vec6, _, Parameters = arm_types(real)
    network = network_types(real, shape)
    Weights, Activity, vec_in = network.Weights, network.Activity, network.vec_in
    structs = rollout_structs(real, features.further_losses)
    Trials, Senses, Trajectories = structs.Trials, structs.Senses, structs.Trajectories
    parts, senses_of = step_functions(real, features), sense_functions(real, shape, features)
    at_rest, seen_target, steady_force = parts.at_rest, parts.seen_target, parts.steady_force
    within, all_terms = parts.within, parts.all_terms
    sense, show, driven = senses_of.sense, senses_of.show, senses_of.driven
    spring_force = spring_functions(real, features).spring_force
    excite = network_forward(real, shape, features.hidden_noise)
    arms, has_forces, has_further = features.arms, features.forces, features.further_losses
    # What a thread holds of its arms, a row each.
    hands = wp.types.matrix((arms, 4), real)
    of_muscles = wp.types.matrix((arms, N_MUSCLES), real)
    felts = wp.types.matrix((arms, 2 * N_MUSCLES), real)
    places = wp.types.matrix((arms, 2), real)

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
        joints = hands()
        positions = hands()
        activations = of_muscles()
        forces = of_muscles()
        felt = felts()
        for arm in range(arms):
            joint = at_rest(trials.start[trial * arms + arm])
            muscle = resting_muscles(p, joint)
            joints[arm] = joint
            positions[arm] = hand_state(p, joint)
            activations[arm] = muscle[ACTIVATION]
            forces[arm] = muscle[FORCE]
            felt[arm] = proprioception(p, muscle)
        started = hands(positions)
        for t in range(n_steps):
            observation = vec_in()
            targets = places()
            for arm in range(arms):
                hand = trial * arms + arm
                target = seen_target(p, trials, hand, t)
                sensed = sense(p, trials, senses, out, hand, t, n_steps, felt[arm], positions[arm])
                observation = show(observation, trials, arm, sensed, target)
                targets[arm] = target
            excitation = excite(w, a, s, trial * n_steps + t, observation)
            before = hands(positions)
            for arm in range(arms):
                hand = trial * arms + arm
                k = hand * n_steps + t
                joint = joints[arm]
                command = vec6()
                for m in range(N_MUSCLES):
                    command[m] = excitation[arm * N_MUSCLES + m]
                load = steady_force(trials, hand, t)
                if has_forces:
                    load = hand_force(before[arm], load, trials.velocity_gain[hand], trials.position_gain[hand])
                if arms > 1:
                    other = arms - 1 - arm
                    load = load + spring_force(trials, trial, before[arm], before[other], started[arm], started[other])
                joint_next = next_joint(p, joint, muscle_torque(p, joint, forces[arm]), load)
                muscle = muscles_at(p, joint, activate(p, activations[arm], driven(senses, k, command)))
                position = hand_state(p, joint_next)
                joints[arm] = joint_next
                positions[arm] = position
                activations[arm] = muscle[ACTIVATION]
                forces[arm] = muscle[FORCE]
                felt[arm] = proprioception(p, muscle)
                place = vec2(position[0], position[1])
                out.joint[k] = joint_next
                out.muscle[k] = muscle
                out.hand[k] = place
                out.excitation[k] = command
                error = place - targets[arm]
                if has_further:
                    change = vec6()
                    if t > 0:
                        change = command - out.excitation[k - 1]
                    velocity = vec2(position[2], position[3])
                    relative_force = wp.cw_div(muscle[FORCE], p.max_isometric_force)
                    out.terms[k] = all_terms(error, velocity, command, change, relative_force, within(t, counts_from))
                else:
                    out.terms[k] = step_terms(error, command)

    return RolloutKernels(roll, rollout_adjoint(real, shape, features), network, structs)
