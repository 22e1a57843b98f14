"""Timelines, forces, further losses, noise and delays: gradients are finite differences, in every combination."""

from dataclasses import replace

import pytest
import torch

from bilateral_rl.bptt.conditions import Conditions
from bilateral_rl.bptt.features import Features
from bilateral_rl.bptt.rollout import TrajectoryGradients
from bilateral_rl.envs import Arm, ArmParameters, TrialSettings
from bilateral_rl.envs.arm.physics import FORCE
from bilateral_rl.envs.losses import LossSettings, SideLoss

N_STEPS, N_TRIALS = 8, 4
EVERY_GRADIENT = {"n_streams": 2, "watches_state": True, "watches_activity": True}
SMALL = [("unilateral", 4, 1), ("bilateral", 4, 2), ("callosal", 4, 2)]
"""Small networks: each of them costs a compilation of each set of features."""
LOSSES = LossSettings(dominant=SideLoss(hand_speed=0.5, excitation_change=2.0, muscle_force=1.0), last_steps=5)
SENSES = {"sensory_noise": 0.01, "motor_noise": 0.1, "proprioception_delay": 1, "vision_delay": 3}
ALONE = {
    "timeline": Conditions(timeline=True),
    "forces": Conditions(forces=True),
    "further_losses": Conditions(settings=TrialSettings(losses=LOSSES)),
    "senses": Conditions(settings=TrialSettings(**SENSES)),
    "hidden_noise": Conditions(hidden_noise=0.1),
    "arms": Conditions(n_arms=2),
}
EVERYTHING = Conditions(True, True, TrialSettings(losses=LOSSES, **SENSES), hidden_noise=0.1)
DISTANCE = {"spring": {"kind": "distance"}}
WITH_TWO_ARMS = replace(EVERYTHING, settings=replace(EVERYTHING.settings, two_arms=DISTANCE), n_arms=2)
BY_NAME = {**ALONE, "everything": EVERYTHING, "everything_with_two_arms": WITH_TWO_ARMS}
CASES = [
    *((name, SMALL[2]) for name in ALONE if name != "arms"),  # which is compared with torch
    *(("everything", shape) for shape in (SMALL[0], SMALL[2])),
    ("everything_with_two_arms", SMALL[0]),
]


def fill(rollout, seed=0):
    """Fill what the paper's trials do not have with random numbers large enough to matter."""
    generator = torch.Generator().manual_seed(seed)
    trials, noise = rollout.trials.tensors(), (rollout.noise, rollout.hidden_noise)

    def normal(tensor, scale):
        tensor.copy_(scale * torch.randn(tensor.shape, generator=generator, dtype=torch.float64))

    scales = {"jump_target": 0.3, "offset": 5.0, "velocity_gain": 15.0, "position_gain": 30.0, "pulse": 10.0}
    scales |= {"stiffness": 50.0, "damping": 3.0}
    for name, scale in scales.items():
        if name in trials:
            normal(trials[name], scale)
    if "go" in trials:
        n, hands = trials["go"].shape
        trials["go"].copy_(torch.tensor([0, 2, 3, 1_000_000], dtype=torch.int32).repeat(n, hands // N_TRIALS))
        trials["jump"].copy_(torch.tensor([5, 4, 1_000_000, 1_000_000], dtype=torch.int32).repeat(n, hands // N_TRIALS))
    if "pulse_window" in trials:
        n, hands, _ = trials["pulse_window"].shape
        windows = torch.tensor([[0, 2], [3, 4], [2, 100], [1_000_000, 1_000_000]], dtype=torch.int32)
        trials["pulse_window"].copy_(windows.repeat(n, hands // N_TRIALS, 1))
    for tensor in noise:
        normal(tensor, 0.1)
    if rollout.noise.numel():  # so much that it leaves what can be observed
        rollout.noise[:, 0, 4, 3], rollout.noise[:, 1, 2, 13] = -9.0, 9.0


def built(make_rollout, networks, conditions, **wanted):
    rollout = make_rollout(networks, N_TRIALS, N_STEPS, conditions=conditions, **wanted)
    fill(rollout)
    return rollout


def copy_inputs(rollout, other):
    """Give ``rollout`` of many networks what the first network of ``other`` does."""
    for own, part in zip(rollout.trials, other.trials, strict=True):
        own.copy_(part[:1].expand_as(own))
    rollout.noise.copy_(other.noise[:1].expand_as(rollout.noise))
    rollout.hidden_noise.copy_(other.hidden_noise[:1].expand_as(rollout.hidden_noise))


def test_a_feature_is_compiled_where_it_is_asked_for():
    for name, conditions in ALONE.items():
        assert conditions.features == Features(**{name: 2 if name == "arms" else True})
    assert EVERYTHING.features == Features(*[True] * 5)
    assert WITH_TWO_ARMS.features == Features(*[True] * 5, arms=2, distance_spring=True)
    assert Conditions(settings=TrialSettings(two_arms=DISTANCE)).features == Features()
    assert Conditions().features == Features()
    assert Conditions(settings=TrialSettings(vision_delay=1)).features == Features(senses=True)


@pytest.mark.parametrize(("name", "shape"), CASES, ids=lambda value: value if isinstance(value, str) else value[0])
def test_gradients_are_finite_differences_of_the_losses(random_networks, make_rollout, assert_rows_close, name, shape):
    """Of two streams that weigh every term, and of losses on trajectories."""
    conditions = BY_NAME[name]
    (network,) = random_networks(*shape, n=1, n_arms=conditions.n_arms)
    rollout = built(make_rollout, [network], conditions, **EVERY_GRADIENT)
    rollout.forward()
    generator = torch.Generator().manual_seed(1)
    weights = torch.rand(2, rollout.terms.shape[-1], generator=generator, dtype=torch.float64)
    upstream = {
        name: 0.1 * torch.randn((2, *getattr(rollout, name).shape), generator=generator, dtype=torch.float64)
        for name in ("joint", "muscle", "hand", "hidden")
    }
    gradient = rollout.backward(weights, TrajectoryGradients(**upstream)).clone()

    n, step = sum(v.size for v in rollout.layout.variables), 1e-5
    moved = built(make_rollout, [network] * (2 * n), conditions)
    copy_inputs(moved, rollout)
    moves = step * torch.eye(n, rollout.layout.width, dtype=torch.float64)
    moved.weights += torch.cat([moves, -moves])
    moved.forward()
    difference = torch.zeros_like(gradient)
    for stream in range(2):
        losses = (moved.terms * weights[stream]).flatten(1).sum(1)
        losses += sum((getattr(moved, part) * upstream[part][stream]).flatten(1).sum(1) for part in upstream)
        difference[stream, 0, :n] = (losses[:n] - losses[n:]) / (2 * step)
    assert_rows_close(rollout.layout, gradient, difference, rtol=1e-6)


def test_trials_are_the_arms_steps_under_the_forces_and_what_is_sensed_is_what_was(random_networks, make_rollout):
    """Written down from the definitions, in torch, along the commands of the rollout."""
    (network,) = random_networks(*SMALL[2], n=1)
    rollout = built(make_rollout, [network], EVERYTHING, **EVERY_GRADIENT)
    rollout.forward()
    trials, arm = rollout.trials.map(lambda tensor: tensor[0]), Arm(dtype=torch.float64)
    commands, noise = rollout.excitation[0], rollout.noise[0]
    state = arm.rest(trials.start)
    felt, seen = [arm.proprioception(state)], [state.cartesian[:, :2]]
    low, high = (torch.from_numpy(bound).double() for bound in TrialSettings().observation_bounds())
    last, before = torch.tensor(ArmParameters().max_isometric_force, dtype=torch.float64), commands[:, 0]
    for t in range(N_STEPS):
        target = torch.where((t >= trials.go)[:, None], trials.target, seen[0])
        target = torch.where((t >= trials.jump)[:, None], trials.jump_target, target)
        felt_at, seen_at = max(t - 1, 0), max(t - 3, 0)
        sensed = torch.cat([felt[felt_at] + noise[:, felt_at, :12], seen[seen_at] + noise[:, seen_at, 12:14]], dim=1)
        observation = torch.cat([sensed.clamp(low[:14], high[:14]), target], dim=1)
        torch.testing.assert_close(rollout.observation[0, :, t], observation, rtol=1e-11, atol=1e-12)

        hand = state.cartesian
        force = trials.load + trials.offset
        force = force + torch.einsum("nij,nj->ni", trials.velocity_gain, hand[:, 2:])
        force = force - torch.einsum("nij,nj->ni", trials.position_gain, hand[:, :2])
        pulsed = (trials.pulse_window[:, 0] <= t) & (t < trials.pulse_window[:, 1])
        force = torch.where(pulsed[:, None], force + trials.pulse, force)
        state = arm.step(state, commands[:, t] + noise[:, t, 14:], force)
        torch.testing.assert_close(rollout.joint[0, :, t], state.joint, rtol=1e-11, atol=1e-12)
        torch.testing.assert_close(rollout.muscle[0, :, t], state.muscle, rtol=1e-11, atol=1e-9)

        error = state.cartesian[:, :2] - target
        counts = float(t >= N_STEPS - 5)
        terms = [
            counts * error.abs().mean(1),
            counts * 10 * error.square().mean(1),
            commands[:, t].square().mean(1),
            counts * state.cartesian[:, 2:].square().sum(1),
            (commands[:, t] - before).square().mean(1),
            (state.muscle[:, FORCE] / last).square().mean(1),
        ]
        torch.testing.assert_close(rollout.terms[0, :, t], torch.stack(terms, dim=1), rtol=1e-10, atol=1e-12)
        before = commands[:, t]
        felt.append(arm.proprioception(state))
        seen.append(state.cartesian[:, :2])
