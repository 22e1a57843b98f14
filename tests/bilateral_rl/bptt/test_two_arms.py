"""Two arms in a stacked rollout: the arms' step, the torch network and the spring in a loop, and its gradients."""

import pytest
import torch
from two_arms_in_torch import TRAJECTORIES, mirrored, roll, step_terms

from bilateral_rl.bptt.conditions import Conditions
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.losses import StreamLosses
from bilateral_rl.bptt.optimizer import StackedAdam
from bilateral_rl.bptt.rollout import TrajectoryGradients
from bilateral_rl.bptt.trial_tensors import TrialTensors
from bilateral_rl.envs import Arm, ArmParameters, TrialSettings
from bilateral_rl.policies import make_network
from bilateral_rl.policies.lesions import LESIONS, NO_LESION
from bilateral_rl.vocabulary import SIDES, group_shares

UPPER = torch.tensor([135.0, 155.0]).deg2rad()
N_STEPS = 12
TERM_WEIGHTS = torch.tensor([[1.0, 2.0, 3.0], [0.5, 0.0, 1.0]], dtype=torch.float64)


def conditions(kind="vector", **others):
    return Conditions(settings=TrialSettings(two_arms={"spring": {"kind": kind}}), n_arms=2, **others)


def networks_of(architecture, units, n, seed=0, **paths):
    """Networks of two arms with random parameters, but for those that are fixed."""
    generator = torch.Generator().manual_seed(seed)
    networks = [make_network(architecture, 40, 12, units, n_arms=2, **paths).double() for _ in range(n)]
    for network in networks:
        for name, parameter in network.named_parameters():
            values = torch.randn(parameter.shape, generator=generator, dtype=torch.float64)
            if parameter.requires_grad:
                parameter.data.copy_(0.3 + values.abs() if name.startswith("combination") else 0.5 * values)
    return networks


def fill(rollout, seed=0):
    """Random trials, with a spring and a damper in all but the first."""
    generator = torch.Generator().manual_seed(seed)

    def uniform(tensor, low, high):
        tensor.copy_(low + (high - low) * torch.rand(tensor.shape, generator=generator, dtype=torch.float64))

    uniform(rollout.trials.start, 0.15, 0.85)
    rollout.trials.start.mul_(UPPER)
    uniform(rollout.trials.target, -0.3, 0.5)
    uniform(rollout.trials.load, -10.0, 10.0)
    uniform(rollout.trials.stiffness, 20.0, 100.0)
    uniform(rollout.trials.damping, 0.0, 5.0)
    rollout.trials.stiffness[:, 0], rollout.trials.damping[:, 0] = 0.0, 0.0


def rolled(make_rollout, networks, of=None, n_trials=3, **wanted):
    rollout = make_rollout(networks, n_trials, N_STEPS, conditions=of or conditions(), fill=fill, **wanted)
    rollout.forward()
    return rollout


def in_torch(networks, rollout):
    paths = []
    for s, network in enumerate(networks):
        trials = rollout.trials.map(lambda tensor, s=s: tensor[s])
        paths.append(roll(network.excitation, trials, N_STEPS, rollout.conditions.settings.two_arms))
    return {name: torch.stack([getattr(path, name) for path in paths]) for name in TRAJECTORIES}


@pytest.mark.parametrize("kind", ["vector", "distance"])
def test_trajectories_and_gradients_are_torchs_with_every_lesion(
    make_rollout, gradient_rows, set_lesions, assert_rows_close, kind
):
    lesions = [NO_LESION, *LESIONS.values()]
    networks = networks_of("callosal", 8, len(lesions), trained_combination=True)
    watched = {"n_streams": 2, "watches_state": True}
    rollout = rolled(make_rollout, networks, conditions(kind), **watched)
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


@pytest.mark.parametrize(
    ("architecture", "units", "paths"), [("unilateral", 3, {}), ("callosal", 8, {"ipsilateral_share": 0.0})]
)
def test_other_networks_of_two_arms_too(make_rollout, gradient_rows, assert_rows_close, architecture, units, paths):
    networks = networks_of(architecture, units, 2, **paths)
    rollout = rolled(make_rollout, networks, n_streams=2)
    path = in_torch(networks, rollout)
    for name in TRAJECTORIES:
        torch.testing.assert_close(getattr(rollout, name), path[name].detach(), rtol=1e-10, atol=1e-11)
    for network in networks:
        network.requires_grad_()  # what is fixed has a gradient, too, which nobody asks for
    losses = [(weights * path["terms"]).sum() for weights in TERM_WEIGHTS]
    expected = torch.stack([gradient_rows(rollout.layout, networks, loss) for loss in losses])
    free = rollout.layout.free
    assert_rows_close(rollout.layout, rollout.backward(TERM_WEIGHTS) * free, expected * free, rtol=1e-8)
