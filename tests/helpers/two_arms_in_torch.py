"""Trials of two arms by ``Arm.step`` and the torch networks, differentiable: written down from the specification."""

from types import SimpleNamespace

import torch

from bilateral_rl.envs import Arm

TRAJECTORIES = ("joint", "muscle", "hand", "excitation", "terms", "observation")


def mirrored(vectors, shoulder_distance=0.0):
    """Positions (…, 2) in the other arm's own frame; vectors, with no distance."""
    return torch.stack([-vectors[..., 0] - shoulder_distance, vectors[..., 1]], dim=-1)


def spring_force(own, other, rest, stiffness, damping):
    """The force (B, 2) on a hand (B, 4) of a vector spring, of another hand in the same frame."""
    apart, rate = (other - own).split(2, dim=1)
    return stiffness[:, None] * (apart - rest) + damping[:, None] * rate


def views(arm, states, targets, distance, recorded=False):
    """The view (B, 20) of each arm; ``recorded``: without a gradient through the other hand."""
    result = []
    for own, other in ((0, 1), (1, 0)):
        hand = states[other].cartesian[:, :2]
        hand = hand.detach() if recorded else hand
        own_hand = [arm.proprioception(states[own]), states[own].cartesian[:, :2]]
        others = [mirrored(place, distance) for place in (hand, targets[other])]
        result.append(torch.cat([*own_hand, others[0], targets[own], others[1]], dim=1))
    return result


def step_terms(hand, target, excitation):
    error = hand - target
    return torch.stack([error.abs().mean(1), 10 * error.square().mean(1), excitation.square().mean(1)], dim=1)


def roll_one(command, trials, seen, arm_index, n_steps):
    """Terms (B, T, 3) of one arm of the trials alone, without a spring; ``seen`` (B, T, 40) was observed in them.

    The other hand's position is fed as it was recorded, and the targets.
    """
    arm = Arm(dtype=trials.target.dtype)
    target, load = (part[arm_index::2] for part in (trials.target, trials.load))
    recorded = seen[:, :, 20 * arm_index : 20 * arm_index + 20]
    state, terms = arm.rest(trials.start[arm_index::2]), []
    for t in range(n_steps):
        own = [arm.proprioception(state), state.cartesian[:, :2]]
        excitation = command(torch.cat([*own, recorded[:, t, 14:]], dim=1))
        state = arm.step(state, excitation, load)
        terms.append(step_terms(state.cartesian[:, :2], target, excitation))
    return torch.stack(terms, dim=1)


def roll(command, trials, n_steps, settings, recorded=False):
    """Trajectories (B · 2, T, …) of one network's trials (B · 2, …), a row a hand, and observations (B, T, 40).

    Args:
        command: from observations (B, 40) to excitations (B, 12).
        trials: start, target, load, stiffness and damping.
        n_steps: of a trial.
        settings: ``TwoArmSettings``.
        recorded: let no gradient through the seen position of the other hand.
    """
    arm = Arm(dtype=trials.target.dtype)
    distance = settings.shoulder_distance
    states = [arm.rest(trials.start[a::2]) for a in range(2)]
    targets, loads = ([part[a::2] for a in range(2)] for part in (trials.target, trials.load))

    def seen(state):
        place, velocity = state.cartesian.split(2, dim=1)
        return torch.cat([mirrored(place, distance), mirrored(velocity)], dim=1)

    rests = [(seen(states[1 - a]) - states[a].cartesian)[:, :2] for a in range(2)]
    steps = []
    for _ in range(n_steps):
        observation = torch.cat(views(arm, states, targets, distance, recorded), dim=1)
        excitation = command(observation).chunk(2, dim=1)
        forces = [
            loads[a]
            + spring_force(*(states[a].cartesian, seen(states[1 - a]), rests[a], trials.stiffness, trials.damping))
            for a in range(2)
        ]
        states = [arm.step(states[a], excitation[a], forces[a]) for a in range(2)]
        hands = [state.cartesian[:, :2] for state in states]
        terms = [step_terms(*parts) for parts in zip(hands, targets, excitation, strict=True)]
        by_arm = ([s.joint for s in states], [s.muscle for s in states], hands, excitation, terms)
        steps.append((*(torch.stack(list(part), dim=1).flatten(0, 1) for part in by_arm), observation))
    paths = [torch.stack(part, dim=1) for part in zip(*steps, strict=True)]
    return SimpleNamespace(**dict(zip(TRAJECTORIES, paths, strict=True)))
