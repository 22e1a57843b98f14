"""The routing rule: whose gradient a parameter gets, the weight penalty, and clipping by group."""

import copy

import numpy as np
import pytest
import torch
from hemispheric_models import PENALTY_ON_GROUP
from torch import nn

from bilateral_rl.algorithms.routing import (
    add_weight_penalty,
    assign_routed_gradients,
    clip_group_gradients,
    policy_shares,
)
from bilateral_rl.policies import ARCHITECTURES, make_network
from bilateral_rl.vocabulary import GROUPS, LOSSES, group_penalties, stream_mix, stream_names

NETWORK_GROUPS = ("dominant", "non_dominant", "shared")


class TwoStreams(nn.Module):
    """A motor network and a critic for each stream."""

    def __init__(self, architecture="callosal"):
        super().__init__()
        self.motor_network = make_network(architecture, n_inputs=16, n_outputs=6)
        self.critics = nn.ModuleList(nn.Linear(16, 1) for _ in range(2))

    def groups(self):
        critics = {f"critic_{i}": list(critic.parameters()) for i, critic in enumerate(self.critics)}
        return self.motor_network.parameter_groups() | critics

    def losses(self):
        """Two scalars of one graph, of which each depends on every parameter of the network."""
        x = torch.linspace(-1, 1, 8 * 16).reshape(8, 16).sin()
        excitation = self.motor_network.excitation(x)
        return [
            (excitation - 0.2).square().mean() + self.critics[0](x).square().mean(),
            3 * (excitation * x[:, :6]).mean() + (self.critics[1](x) - 1).square().mean(),
        ]


def two_streams(architecture="callosal"):
    torch.manual_seed(0)
    return TwoStreams(architecture)


def backward_gradients(model, stream):
    """Every parameter's gradient of one loss by an ordinary backward pass, 0 where it has none."""
    model = copy.deepcopy(model)
    model.losses()[stream].backward()
    return {
        name: [torch.zeros_like(p) if p.grad is None else p.grad for p in group]
        for name, group in model.groups().items()
    }


def random_parameters(*sizes, seed=0, scale=1.0):
    """Parameters that already have gradients."""
    generator = torch.Generator().manual_seed(seed)
    parameters = [nn.Parameter(torch.randn(size, generator=generator)) for size in sizes]
    for parameter in parameters:
        parameter.grad = scale * torch.randn(parameter.shape, generator=generator)
    return parameters


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_routed_gradients_are_those_of_two_ordinary_backward_passes(architecture):
    model = two_streams(architecture)
    dominant, non_dominant = (backward_gradients(model, stream) for stream in range(2))
    assign_routed_gradients(model.losses(), model.groups(), policy_shares("specialized"))
    half_of_each = [(d + n) / 2 for d, n in zip(dominant["shared"], non_dominant["shared"], strict=True)]
    expected = {
        "dominant": dominant["dominant"],
        "non_dominant": non_dominant["non_dominant"],
        "shared": half_of_each,
        "critic_0": dominant["critic_0"],
        "critic_1": non_dominant["critic_1"],
    }
    for name, group in model.groups().items():
        for parameter, gradient in zip(group, expected[name], strict=True):
            assert gradient.abs().max() > 0
            torch.testing.assert_close(parameter.grad, gradient, rtol=1e-6, atol=1e-8)


def test_a_single_stream_routes_its_whole_gradient_everywhere():
    expected = backward_gradients(two_streams(), stream=0)
    for loss in ("combined", "dominant", "non_dominant"):
        model = two_streams()
        groups = {name: group for name, group in model.groups().items() if name != "critic_1"}
        assign_routed_gradients(model.losses()[:1], groups, policy_shares(loss))
        for name, group in groups.items():
            for parameter, gradient in zip(group, expected[name], strict=True):
                torch.testing.assert_close(parameter.grad, gradient, rtol=1e-6, atol=1e-8)


def test_routing_replaces_gradients_and_forgets_those_without_a_share_or_a_path():
    owned, without_share, without_path = random_parameters(3, 3, 3)
    losses = [(2 * owned + without_share).sum(), without_share.sum()]
    groups = {"owned": [owned], "without_share": [without_share], "without_path": [without_path]}
    assign_routed_gradients(
        losses, groups, {"owned": [1.0, 0.0], "without_share": [0.0, 0.0], "without_path": [1.0, 0.0]}
    )
    torch.testing.assert_close(owned.grad, torch.full((3,), 2.0))
    assert without_share.grad is None
    assert without_path.grad is None


def test_adam_does_not_move_a_parameter_without_a_share():
    """Also not by the momentum of earlier updates."""
    moving, resting = random_parameters(3, 3)
    optimizer = torch.optim.Adam([moving, resting], lr=0.1)
    optimizer.step()
    before = resting.detach().clone(), moving.detach().clone()
    assign_routed_gradients([(moving * resting).sum()], {"a": [moving], "b": [resting]}, {"a": [1.0], "b": [0.0]})
    optimizer.step()
    assert torch.equal(resting, before[0])
    assert not torch.equal(moving, before[1])


@pytest.mark.parametrize("architecture", ["bilateral", "callosal"])
def test_a_lesioned_side_gets_no_gradient_unless_it_speaks_over_the_callosum(architecture):
    model = two_streams(architecture)
    with model.motor_network.lesioned("deep_dominant"):
        assign_routed_gradients(model.losses(), model.groups(), policy_shares("specialized"))
    assert (model.motor_network.dominant[0].weight.grad is None) == (architecture == "bilateral")
    assert model.motor_network.dominant[1].weight.grad is None
    assert model.motor_network.combination_dominant.grad is None
    assert model.motor_network.combination_non_dominant.grad is not None


def test_the_penalty_weighs_on_each_group_as_the_paper_says():
    assert {loss: group_penalties(loss) for loss in LOSSES} == PENALTY_ON_GROUP


def test_weights_of_the_penalty_are_mixed_and_routed_as_the_losses_are():
    assert group_penalties("specialized", None, (3.0, 1.0)) == {"dominant": 3.0, "non_dominant": 1.0, "shared": 2.0}
    assert group_penalties("specialized", [2.0, 0.5], (3.0, 1.0)) == {
        "dominant": 6.0, "non_dominant": 0.5, "shared": 3.25
    }  # fmt: skip
    assert group_penalties("combined", None, (3.0, 1.0)) == dict.fromkeys(GROUPS, 2.0)
    assert group_penalties("dominant", None, (3.0, 1.0)) == dict.fromkeys(GROUPS, 3.0)


def test_the_penalty_is_scaled_as_the_streams_that_pay_it():
    assert group_penalties("specialized", [10.0, 0.25]) == {"dominant": 0.0, "non_dominant": 0.5, "shared": 0.25}
    assert group_penalties("combined", [0.25]) == {"dominant": 0.25, "non_dominant": 0.25, "shared": 0.25}


@pytest.mark.parametrize("loss", LOSSES)
def test_the_penaltys_gradient_is_autograds_of_half_the_squared_weights(loss):
    coefficient = 0.7
    model = two_streams().motor_network
    with torch.no_grad():
        for parameter in model.parameters():
            parameter.add_(0.1)
    groups = model.parameter_groups()
    penalty = sum(
        coefficient * PENALTY_ON_GROUP[loss][name] * 0.5 * sum(p.square().sum() for p in group)
        for name, group in groups.items()
    )
    parameters = [p for name in NETWORK_GROUPS for p in groups[name]]
    expected = torch.autograd.grad(penalty, parameters)
    add_weight_penalty(groups, group_penalties(loss), coefficient)
    for parameter, gradient in zip(parameters, expected, strict=True):
        got = torch.zeros_like(gradient) if parameter.grad is None else parameter.grad
        torch.testing.assert_close(got, gradient)


def test_the_penalty_adds_to_gradients_and_touches_only_weighted_groups():
    penalized, spared = random_parameters(4, 4)
    before = penalized.grad.clone(), spared.grad.clone()
    add_weight_penalty({"a": [penalized], "b": [spared]}, {"a": 2.0, "b": 0.0}, coefficient=0.5)
    torch.testing.assert_close(penalized.grad, before[0] + penalized.detach())
    assert torch.equal(spared.grad, before[1])


def test_a_penalty_of_coefficient_zero_makes_no_gradient():
    parameter = nn.Parameter(torch.ones(3))
    add_weight_penalty({"a": [parameter]}, {"a": 2.0}, coefficient=0.0)
    assert parameter.grad is None


@pytest.mark.parametrize("max_norm", [0.5, 1e6])
def test_clipping_equals_torchs_on_each_group(max_norm):
    def three_groups():
        return {name: random_parameters((5, 3), 7, (), seed=i, scale=10.0 ** (i - 1)) for i, name in enumerate("abc")}

    groups, expected = three_groups(), three_groups()
    before = {name: nn.utils.clip_grad_norm_(group, max_norm) for name, group in expected.items()}
    norms = clip_group_gradients(groups, max_norm)
    for name, group in groups.items():
        for parameter, other in zip(group, expected[name], strict=True):
            torch.testing.assert_close(parameter.grad, other.grad)
        after = torch.linalg.vector_norm(torch.cat([p.grad.flatten() for p in group]))
        torch.testing.assert_close(norms[name][0], before[name])
        torch.testing.assert_close(norms[name][1], after)


def test_without_a_bound_norms_are_only_measured():
    (parameter,) = random_parameters(10, scale=100.0)
    before = parameter.grad.clone()
    norms = clip_group_gradients({"a": [parameter]}, None)
    assert torch.equal(parameter.grad, before)
    assert norms["a"][0] == norms["a"][1] == torch.linalg.vector_norm(before)


def test_groups_and_parameters_without_gradients_are_passed_over():
    silent, speaking = nn.Parameter(torch.ones(2)), random_parameters(3, scale=100.0)[0]
    norms = clip_group_gradients({"empty": [], "silent": [silent], "mixed": [silent, speaking]}, 0.5)
    assert set(norms) == {"mixed"}
    assert silent.grad is None
    assert torch.linalg.vector_norm(speaking.grad).item() == pytest.approx(0.5, rel=1e-5)


@pytest.mark.parametrize("weights", [torch.ones(3), torch.arange(3.0)], ids=["expanded", "shared storage"])
def test_gradients_that_autograd_gives_to_two_parameters_at_once_are_clipped_once(weights):
    """The gradient of a + b is one tensor for both, and clipping works in place."""
    a, b = nn.Parameter(torch.ones(3)), nn.Parameter(torch.ones(3))
    groups = {"group": [a, b]}
    assign_routed_gradients([100 * ((a + b) * weights).sum()], groups, {"group": [1.0]})
    clip_group_gradients(groups, 1.0)
    norm = torch.linalg.vector_norm(torch.cat([a.grad, b.grad]))
    assert norm.item() == pytest.approx(1.0, rel=1e-5)


def test_the_stream_of_the_combined_loss_is_the_mean_of_the_pair():
    pair = np.array([-3.0, -1.0])
    streams = {loss: (np.array(stream_mix(loss)) @ pair).tolist() for loss in LOSSES}
    assert streams == {
        "combined": [-2.0],
        "dominant": [-3.0],
        "non_dominant": [-1.0],
        "specialized": [-3.0, -1.0],
    }


def test_every_stream_has_a_name_a_critic_and_a_share_for_each_group():
    for loss in LOSSES:
        n_streams = len(stream_mix(loss))
        assert len(stream_names(loss)) == n_streams
        assert set(policy_shares(loss)) == {*NETWORK_GROUPS, *(f"critic_{i}" for i in range(n_streams))}
        for name, share in policy_shares(loss).items():
            assert len(share) == n_streams
            assert sum(share) == 1.0, name


def test_an_unknown_loss_is_refused_naming_the_valid_ones():
    with pytest.raises(ValueError, match=r"'both'.*combined, dominant, non_dominant, specialized"):
        stream_mix("both")
