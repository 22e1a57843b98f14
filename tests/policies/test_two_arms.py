"""Networks that command two arms: crossed views, a combination and an output layer for each arm, groups, lesions."""

import numpy as np
import pytest
import torch

from bilateral_rl.policies import ARCHITECTURES, LESIONS, make_network
from bilateral_rl.policies.lesions import NO_LESION
from bilateral_rl.vocabulary import SIDES

TWO_ARMS = {"n_inputs": 14, "n_outputs": 6, "units": 8, "n_arms": 2}
SIDED = ("bilateral", "callosal")
OBSERVATION = torch.randn(9, 14, generator=torch.Generator().manual_seed(1))
ARMS = {"dominant": slice(0, 3), "non_dominant": slice(3, 6)}
OTHER = {"dominant": "non_dominant", "non_dominant": "dominant"}


def output(network, observation=OBSERVATION):
    with torch.no_grad():
        return network(observation)


def gradient_names(network, arm):
    """The parameters that have a gradient of the commands to an arm."""
    network.zero_grad()
    network(OBSERVATION)[:, ARMS[arm]].square().sum().backward()
    return {n for n, p in network.named_parameters() if p.grad is not None and p.grad.abs().max() > 0}


@pytest.mark.parametrize("architecture", ARCHITECTURES)
@pytest.mark.parametrize("options", [{}, {"ipsilateral_share": 0.0}, {"trained_combination": True}])
def test_two_arms_compute_what_the_equations_say_with_every_lesion(
    random_network, reference_forward, architecture, options
):
    options = options if architecture != "unilateral" else {}
    network = random_network(architecture, **TWO_ARMS, **options)
    weights = {name: value.clone() for name, value in network.state_dict().items()}
    outputs = []
    for name in ("intact", *network.available_lesions()):
        with network.lesioned(name):
            outputs.append(output(network))
        expected = reference_forward(network, OBSERVATION.double().numpy(), LESIONS.get(name, NO_LESION))
        np.testing.assert_allclose(outputs[-1].numpy(), expected, rtol=1e-4, atol=1e-5, err_msg=name)
    assert outputs[0].shape == (9, 6)
    assert len({tuple(one.flatten().tolist()) for one in outputs}) == len(outputs), "no two do the same"
    assert all(torch.equal(value, weights[name]) for name, value in network.state_dict().items())


def test_a_hemisphere_feels_the_opposite_arm_alone(random_network):
    network, changed = random_network("bilateral", **TWO_ARMS), OBSERVATION.clone()
    changed[:, 7:] += 1.0  # the view of the non-dominant arm
    before, after = network.hemispheres(OBSERVATION), network.hemispheres(changed)
    assert torch.equal(before[0], after[0])
    assert not torch.equal(before[1], after[1])


@pytest.mark.parametrize("side", SIDES)
def test_an_arm_follows_its_opposite_hemisphere_and_by_a_share_that_of_its_own_side(random_network, side):
    """By the contributions: what a hemisphere adds is w · h through the arm's output layer, and both and the bias are
    the commands."""
    share = 0.3
    network = random_network("callosal", **TWO_ARMS, ipsilateral_share=share)
    with torch.no_grad():
        added = dict(zip(SIDES, network.contributions(OBSERVATION), strict=True))
        activity = dict(zip(SIDES, network.hemispheres(OBSERVATION), strict=True))
        for arm in SIDES:
            weight = 1 - share if arm == side else share
            by_hand = weight * activity[side] @ getattr(network.output, arm).weight.T
            torch.testing.assert_close(added[side][:, ARMS[arm]], by_hand)
        biases = torch.cat([network.output.dominant.bias, network.output.non_dominant.bias])
        torch.testing.assert_close(added["dominant"] + added["non_dominant"] + biases, network(OBSERVATION))


@pytest.mark.parametrize("side", SIDES)
def test_a_deep_lesion_takes_a_hemisphere_from_both_arms(random_network, side):
    network = random_network("bilateral", **TWO_ARMS)
    with network.lesioned(f"deep_{side}"), torch.no_grad():
        added = dict(zip(SIDES, network.contributions(OBSERVATION), strict=True))
        commands = network(OBSERVATION)
    assert not added[side].any()
    biases = torch.cat([network.output.dominant.bias, network.output.non_dominant.bias])
    torch.testing.assert_close(added[OTHER[side]] + biases, commands)


@pytest.mark.parametrize("side", SIDES)
def test_without_an_ipsilateral_path_arms_are_moved_by_their_opposite_hemisphere_alone(random_network, side):
    bilateral = random_network("bilateral", **TWO_ARMS, ipsilateral_share=0.0)
    owned = {n for n, _ in bilateral.named_parameters() if bilateral.group_of(n) == side}
    stack = {f"{side}.{k}.{part}" for k in range(2) for part in ("weight", "bias")}
    layer = {f"output.{side}.{part}" for part in ("weight", "bias")}
    assert owned == stack | layer | {f"combination_{side}"}
    assert gradient_names(bilateral, side) == stack | layer
    with bilateral.lesioned(f"deep_{side}"), torch.no_grad():
        bias = getattr(bilateral.output, side).bias
        assert torch.equal(bilateral(OBSERVATION)[:, ARMS[side]], bias.expand(9, 3)), "nothing commands it any more"
    assert bilateral.combination_weights() == {f"{arm}_arm/{arm}": 1.0 for arm in SIDES}
    callosal = random_network("callosal", **TWO_ARMS, ipsilateral_share=0.0)
    over_callosum = {f"{OTHER[side]}.0.{part}" for part in ("weight", "bias")}
    assert gradient_names(callosal, side) == stack | layer | over_callosum


@pytest.mark.parametrize("side", SIDES)
def test_without_an_ipsilateral_path_a_hemisphere_is_a_network_of_its_arms_view(side):
    network = make_network("bilateral", **TWO_ARMS, ipsilateral_share=0.0)
    alone = make_network("unilateral", n_inputs=7, n_outputs=3, units=4)
    with torch.no_grad():
        for layer, own in zip(getattr(network, side), alone.hidden, strict=True):
            layer.load_state_dict(own.state_dict())
        getattr(network.output, side).load_state_dict(alone.output.state_dict())
    view = OBSERVATION[:, :7] if side == "dominant" else OBSERVATION[:, 7:]
    assert torch.equal(output(network)[:, ARMS[side]], output(alone, view))


def test_with_a_path_output_layers_and_combinations_are_shared():
    for options in ({}, {"trained_combination": True}):
        network = make_network("callosal", **TWO_ARMS, **options)
        shared = {n for n, _ in network.named_parameters() if network.group_of(n) == "shared"}
        layers = {f"output.{arm}.{part}" for arm in SIDES for part in ("weight", "bias")}
        assert shared == layers | {f"combination_{side}" for side in SIDES}


def test_combination_weights_are_fixed_at_the_share_or_begin_there_and_are_kept_non_negative():
    fixed = make_network("callosal", **TWO_ARMS)
    expected = {"dominant_arm/dominant": 0.85, "dominant_arm/non_dominant": 0.15,
                "non_dominant_arm/dominant": 0.15, "non_dominant_arm/non_dominant": 0.85}  # fmt: skip
    assert fixed.combination_weights() == pytest.approx(expected)
    assert not any(p.requires_grad for n, p in fixed.named_parameters() if n.startswith("combination"))
    trained = make_network("callosal", **TWO_ARMS, ipsilateral_share=0.4, trained_combination=True)
    assert sorted(trained.combination_weights().values()) == pytest.approx([0.4, 0.4, 0.6, 0.6])
    with torch.no_grad():
        trained.combination_dominant[1] = -0.2
    trained.constrain()
    assert trained.combination_weights()["non_dominant_arm/dominant"] == 0
    assert sum(trained.combination_weights().values()) == pytest.approx(1.6)


def test_all_of_a_unilateral_network_sees_and_commands_both_arms():
    network = make_network("unilateral", **TWO_ARMS)
    assert [tuple(p.shape) for p in network.parameters()] == [(8, 14), (8,), (8, 8), (8,), (6, 8), (6,)]
    assert network.combination_weights() == {}
    assert network.n_arms == 2


def test_the_network_of_both_arms_has_the_sizes_of_its_specification():
    network = make_network("callosal", n_inputs=40, n_outputs=12, n_arms=2)
    assert network.units == 20, "ten for each arm"
    half = (20 + 1) * 10 + (10 + 1) * 10 + (10 + 1) * 6
    trained = sum(p.numel() for p in network.parameters() if p.requires_grad)
    assert trained == 2 * half


def test_a_network_is_made_again_from_its_arguments():
    for architecture in SIDED:
        network = make_network(architecture, **TWO_ARMS, ipsilateral_share=0.2, trained_combination=True)
        again = make_network(**network.arguments)
        assert again.arguments == network.arguments
        again.load_state_dict(network.state_dict())
        assert torch.equal(output(again), output(network))


@pytest.mark.parametrize(
    ("architecture", "arguments", "message"),
    [
        ("bilateral", {"n_arms": 3}, "n_arms must be 1 or 2, got 3"),
        ("bilateral", {"n_arms": 0}, "n_arms must be at least 1, got 0"),
        ("bilateral", {"n_inputs": 15}, "n_inputs must be even, half for each arm, got 15"),
        ("unilateral", {"n_outputs": 7}, "n_outputs must be even, half for each arm, got 7"),
        ("bilateral", {"n_arms": 1, "ipsilateral_share": 0.1}, "ipsilateral_share is for .* two arms: leave it out"),
        ("callosal", {"n_arms": 1, "trained_combination": False}, "trained_combination is for .* two arms"),
        ("unilateral", {"ipsilateral_share": 0.15}, "ipsilateral_share has no effect on a unilateral network"),
        ("unilateral", {"trained_combination": True}, "trained_combination has no effect on a unilateral network"),
        ("callosal", {"ipsilateral_share": 1.1}, r"ipsilateral_share must be at most 1, got 1\.1"),
        ("callosal", {"ipsilateral_share": -0.1}, r"ipsilateral_share must be at least 0, got -0\.1"),
        ("callosal", {"trained_combination": "yes"}, "trained_combination must be True or False, got 'yes'"),
        ("bilateral", {"ipsilateral_share": 0, "trained_combination": True}, "has nothing to weigh"),
    ],
)  # fmt: skip
def test_what_could_have_no_effect_on_the_arms_is_refused(architecture, arguments, message):
    with pytest.raises(ValueError, match=message):
        make_network(architecture, **(TWO_ARMS | arguments))
