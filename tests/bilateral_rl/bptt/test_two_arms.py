"""Two arms in a stacked rollout: the arms' step, the torch network and the spring in a loop, and its gradients."""

import pytest
import torch
from two_arms_in_torch import TRAJECTORIES, roll, roll_one

from bilateral_rl.bptt.conditions import Conditions
from bilateral_rl.bptt.losses import StreamLosses
from bilateral_rl.bptt.optimizer import StackedAdam
from bilateral_rl.bptt.rollout import TrajectoryGradients
from bilateral_rl.bptt.trial_tensors import TrialTensors
from bilateral_rl.envs import ArmParameters
from bilateral_rl.envs.losses import LossSettings
from bilateral_rl.envs.two_arms import TwoArmSettings
from bilateral_rl.policies import make_network
from bilateral_rl.policies.lesions import LESIONS, NO_LESION
from bilateral_rl.vocabulary import SIDES, group_shares

UPPER = torch.tensor([135.0, 155.0]).deg2rad()
N_STEPS = 12
TERM_WEIGHTS = torch.tensor([[1.0, 2.0, 3.0], [0.5, 0.0, 1.0]], dtype=torch.float64)


def fill(trials, seed=0, spring=True):
    """Random trials, with a spring and a damper in all but the first, or in none."""
    generator = torch.Generator().manual_seed(seed)

    def uniform(tensor, low, high):
        tensor.copy_(low + (high - low) * torch.rand(tensor.shape, generator=generator, dtype=torch.float64))

    uniform(trials.start, 0.15, 0.85)
    trials.start.mul_(UPPER)
    uniform(trials.target, -0.3, 0.5)
    uniform(trials.load, -10.0, 10.0)
    uniform(trials.stiffness, 20.0, 100.0)
    uniform(trials.damping, 0.0, 5.0)
    for tensor in (trials.stiffness, trials.damping):
        tensor[:, : 1 if spring else None] = 0.0


def rolled(make_rollout, networks, **wanted):
    rollout = make_rollout(networks, 3, N_STEPS, conditions=Conditions(n_arms=2), fill=fill, **wanted)
    rollout.forward()
    return rollout


def in_torch(networks, rollout):
    paths = []
    for s, network in enumerate(networks):
        trials = rollout.trials.map(lambda tensor, s=s: tensor[s])
        paths.append(roll(network.excitation, trials, N_STEPS, rollout.conditions.settings.two_arms))
    return {name: torch.stack([getattr(path, name) for path in paths]) for name in TRAJECTORIES}


def test_trajectories_and_gradients_are_torchs_with_every_lesion(
    random_networks, make_rollout, gradient_rows, set_lesions, assert_rows_close
):
    lesions = [NO_LESION, *LESIONS.values()]
    networks = random_networks("callosal", 8, n=len(lesions), n_arms=2, trained_combination=True)
    watched = {"n_streams": 2, "watches_state": True}
    rollout = rolled(make_rollout, networks, **watched)
    set_lesions(rollout, networks, lesions)
    rollout.forward()
    path = in_torch(networks, rollout)
    for name in TRAJECTORIES:
        torch.testing.assert_close(getattr(rollout, name), path[name].detach(), rtol=1e-10, atol=1e-11)
    generator = torch.Generator().manual_seed(3)
    upstream = {
        name: scale * torch.randn((2, *path[name].shape), generator=generator, dtype=torch.float64)
        for name, scale in (("joint", 0.3), ("muscle", 0.01), ("hand", 1.0))
    }
    losses = [
        (weights * path["terms"]).sum() + sum((seed[stream] * path[name]).sum() for name, seed in upstream.items())
        for stream, weights in enumerate(TERM_WEIGHTS)
    ]
    expected = torch.stack([gradient_rows(rollout.layout, networks, loss) for loss in losses])
    gradient = rollout.backward(TERM_WEIGHTS, TrajectoryGradients(**upstream))
    assert_rows_close(rollout.layout, gradient, expected, rtol=1e-8)


def test_gradients_are_torchs_without_ipsilateral_paths_too(
    random_networks, make_rollout, gradient_rows, assert_rows_close
):
    networks = random_networks("callosal", 8, n_arms=2, ipsilateral_share=0.0)
    rollout = rolled(make_rollout, networks, n_streams=2)
    path = in_torch(networks, rollout)
    for network in networks:
        network.requires_grad_()  # what is fixed has a gradient, too, which nobody asks for
    losses = [(weights * path["terms"]).sum() for weights in TERM_WEIGHTS]
    expected = torch.stack([gradient_rows(rollout.layout, networks, loss) for loss in losses])
    free = rollout.layout.free
    assert_rows_close(rollout.layout, rollout.backward(TERM_WEIGHTS) * free, expected * free, rtol=1e-8)


def uni_gradients(network, side, path, trials):
    """By name, gradients of a unilateral network like one hemisphere, on its own arm's trials and by its own loss."""
    alone = make_network("unilateral", 20, 6, network.units // 2).double()
    layers = dict(getattr(network, side).named_parameters(prefix="hidden"))
    layers |= dict(network.output[side].named_parameters(prefix="output"))
    alone.load_state_dict({name: parameter.detach() for name, parameter in layers.items()})
    terms = roll_one(alone.excitation, trials, path.observation.detach(), SIDES.index(side), N_STEPS)
    names = [name.replace("hidden", side).replace("output", f"output.{side}") for name, _ in alone.named_parameters()]
    weights = torch.tensor(LossSettings().weights[SIDES.index(side)][:3], dtype=torch.float64)
    gradients = torch.autograd.grad(terms.mean((0, 1)) @ weights, list(alone.parameters()))
    return dict(zip(names, gradients, strict=True))


def test_each_hemisphere_learns_as_half_of_a_unilateral_network_on_its_own_arm(random_networks):
    """Raw gradients, with the other hand's position as recorded: each equals half of those of that network exactly."""
    (network,) = random_networks("bilateral", 8, n=1, n_arms=2, ipsilateral_share=0.0)
    trials = TrialTensors.zeros((1, 3), Conditions(n_arms=2).features, torch.float64)
    fill(trials, spring=False)
    trials = trials.map(lambda tensor: tensor[0])
    recorded, seeing = (roll(network.excitation, trials, N_STEPS, TwoArmSettings(), how) for how in (True, False))
    named = dict(network.named_parameters())
    for stream, (side, weights) in enumerate(zip(SIDES, LossSettings().weights, strict=True)):
        expected = uni_gradients(network, side, recorded, trials)
        assert {network.group_of(name) for name in expected} == {side}
        assert group_shares("specialized")[side] == (1.0 - stream, float(stream))
        parameters, loss = [named[name] for name in expected], torch.tensor(weights[:3], dtype=torch.float64)
        own, with_other = (
            torch.autograd.grad(path.terms.mean((0, 1)) @ loss, parameters, retain_graph=True)
            for path in (recorded, seeing)
        )
        for gradient, other, whole in zip(own, with_other, expected.values(), strict=True):
            torch.testing.assert_close(gradient, whole / 2, rtol=1e-13, atol=1e-16)
            assert not torch.allclose(other, whole / 2, rtol=1e-4), "through the other hand comes more than that"


def test_the_routed_gradient_of_a_network_blind_to_the_other_hand_is_that_too(
    random_networks, make_rollout, set_lesions, rows_of
):
    """The same of kernels, losses and routing: no gradient comes through weights of the other hand's position of 0."""
    (network,) = random_networks("callosal", 8, n=1, n_arms=2, ipsilateral_share=0.0)
    for side in SIDES:
        getattr(network, side)[0].weight.data[:, 14:16] = 0.0
    rollout = rolled(make_rollout, [network], n_streams=2)
    fill(rollout.trials, spring=False)
    set_lesions(rollout, [network], [LESIONS["callosum"]])  # which makes it a bilateral one
    rollout.forward()
    trials = rollout.trials.map(lambda tensor: tensor[0])
    losses = StreamLosses("specialized", "weights", 0.0, rollout.layout, ArmParameters())
    optimizer = StackedAdam(rollout, losses, "specialized", learning_rate=0.01, epsilon=1e-7, clip_norm=1.0)
    optimizer.gradient()
    path = roll(network.excitation, trials, N_STEPS, TwoArmSettings())
    dominant, non_dominant = (uni_gradients(network, side, path, trials) for side in SIDES)
    nothing = {f"combination_{side}": torch.zeros(2) for side in SIDES}
    expected = rows_of(rollout.layout, [dominant | non_dominant | nothing]) / 2
    torch.testing.assert_close(optimizer.routed, expected, rtol=1e-9, atol=1e-14)


def test_what_is_fixed_is_neither_moved_nor_penalized_and_what_is_trained_stays_positive(random_networks, make_rollout):
    moved = {}
    for is_trained in (False, True):
        rollout = rolled(
            make_rollout, random_networks("callosal", 8, n=1, n_arms=2, trained_combination=is_trained), n_streams=2
        )
        layout, before = rollout.layout, rollout.weights.clone()
        losses = StreamLosses("specialized", "weights", 0.1, layout, ArmParameters())
        optimizer = StackedAdam(rollout, losses, "specialized", learning_rate=3.0, epsilon=1e-7, clip_norm=1.0)
        penalty = losses._penalty(rollout, slice(0, 1)).item()
        assert penalty == pytest.approx(0.05 * before[0, layout.free].square().sum().item(), rel=1e-12)
        optimizer.gradient()
        optimizer.step()
        fixed = [v for v in layout.variables if v.fixed]
        assert [v.name for v in fixed] == ([] if is_trained else [f"combination_{side}" for side in SIDES])
        norms = optimizer.norms[0, [layout.variables.index(v) for v in fixed]]
        assert (norms == 0).all()
        moved[is_trained] = (rollout.weights != before)[0]
        assert not moved[is_trained][~layout.free].any()
    assert moved[True].sum() == moved[False].sum() + 4
    combination = layout.region(rollout.weights, "combination")
    assert (combination >= 0).all()
    assert (combination == 0).any()


def test_networks_of_another_number_of_arms_than_the_trials_are_refused(random_networks, make_rollout):
    for n_arms, of in ((1, Conditions(n_arms=2)), (2, Conditions())):
        with pytest.raises(ValueError, match=r"^trials of \d arm\(s\) are for networks of \d+ inputs and \d+ outputs"):
            make_rollout(random_networks("unilateral", 2, n_arms=n_arms), conditions=of)
