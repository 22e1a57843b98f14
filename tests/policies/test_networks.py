"""The three architectures: what they compute, their sizes, their parameter groups and their gradients."""

from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from released_names import released_name

from bilateral_rl.policies import ARCHITECTURES, MotorNetwork, make_network
from bilateral_rl.policies.lesions import LESIONS, RELEASED_LESIONS
from bilateral_rl.vocabulary import GROUPS, SIDES

REFERENCE = Path(__file__).parents[1] / "data" / "networks.npz"
RELEASED_NAMES = {"uni": "unilateral", "bi": "bilateral", "cc": "callosal"}
# The released code's left is our dominant side.
RELEASED_LESION_OF = {
    "highleft": LESIONS["shallow_dominant"],
    "highright": LESIONS["shallow_non_dominant"],
    "lowleft": LESIONS["deep_dominant"],
    "lowright": LESIONS["deep_non_dominant"],
    "cc": LESIONS["callosum"],
    "ccl": RELEASED_LESIONS["callosum_deep_dominant"],
    "ccr": RELEASED_LESIONS["callosum_deep_non_dominant"],
}
SIDE_LESIONS = ["highleft", "highright", "lowleft", "lowright"]
RELEASED_CASES = [
    ("uni", "intact"),
    *[("bi", lesion) for lesion in ("intact", *SIDE_LESIONS)],
    *[("cc", lesion) for lesion in ("intact", *RELEASED_LESION_OF)],
]

fast = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@st.composite
def sizes(draw):
    """An architecture and a size that it can have."""
    architecture = draw(st.sampled_from(list(ARCHITECTURES)))
    units = draw(st.integers(1, 24))
    layers = draw(st.integers(1, 5))
    if architecture == "bilateral":
        units = 2 * units
    if architecture == "callosal":
        units, layers = 2 * units + 2, layers + 1
    return architecture, units, layers


def released_network(data, architecture):
    """Our network with the released code's weights; every one of its arrays must find its place."""
    network = make_network(RELEASED_NAMES[architecture], n_inputs=16, n_outputs=6)
    names = {name: f"{architecture}/weight/{released_name(name)}" for name in network.state_dict()}
    assert set(names.values()) == {key for key in data if key.startswith(f"{architecture}/weight/")}
    network.load_state_dict({name: torch.from_numpy(np.asarray(data[key]).T.copy()) for name, key in names.items()})
    return network


def parameter_count(network):
    return sum(parameter.numel() for parameter in network.parameters())


def gradients(network, output_weights, observation):
    """Gradient of a weighted sum of the outputs, by parameter name; None where there is no path."""
    network.zero_grad()
    (network(observation) * output_weights).sum().backward()
    return {name: parameter.grad for name, parameter in network.named_parameters()}


def names_of(network, group):
    return [name for name, _ in network.named_parameters() if network.group_of(name) == group]


@pytest.mark.parametrize(("architecture", "lesion"), RELEASED_CASES)
def test_the_released_networks_outputs_are_reproduced(architecture, lesion):
    with np.load(REFERENCE) as data:
        network = released_network(data, architecture)
        if lesion != "intact":
            network.set_lesion(RELEASED_LESION_OF[lesion])
        output = network.excitation(torch.from_numpy(data[f"{architecture}/input"])).detach().numpy()
        np.testing.assert_allclose(output, data[f"{architecture}/output/{lesion}"], rtol=0, atol=1e-6)


def test_every_released_output_is_compared():
    with np.load(REFERENCE) as data:
        outputs = {tuple(key.split("/")[::2]) for key in data if "/output/" in key}
    assert outputs == set(RELEASED_CASES)


def test_the_papers_networks_have_the_papers_parameter_counts():
    for architecture, count in (("unilateral", 346), ("bilateral", 268), ("callosal", 268)):
        assert parameter_count(make_network(architecture, n_inputs=16, n_outputs=6)) == count


@fast
@given(size=sizes(), seed=st.integers(0, 100))
def test_any_size_computes_what_the_paper_says(random_network, reference_forward, size, seed):
    architecture, units, layers = size
    network = random_network(architecture, n_inputs=7, n_outputs=3, units=units, layers=layers, seed=seed)
    observation = np.random.default_rng(seed).normal(size=(4, 7))
    output = network(torch.tensor(observation, dtype=torch.float32)).detach().numpy()
    np.testing.assert_allclose(output, reference_forward(network, observation), rtol=1e-4, atol=1e-5)


@fast
@given(size=sizes(), n_inputs=st.integers(1, 20), n_outputs=st.integers(1, 8))
def test_any_size_has_the_parameters_of_its_layers(size, n_inputs, n_outputs):
    architecture, units, layers = size
    sides, width = (1, units) if architecture == "unilateral" else (2, units // 2)
    hidden = sides * ((n_inputs + 1) * width + (layers - 1) * (width + 1) * width)
    expected = hidden + (width + 1) * n_outputs + (2 if sides == 2 else 0)
    assert parameter_count(make_network(architecture, n_inputs, n_outputs, units, layers)) == expected


@fast
@given(size=sizes())
def test_every_parameter_is_in_exactly_one_group(size):
    architecture, units, layers = size
    network = make_network(architecture, 16, 6, units, layers)
    groups = network.parameter_groups()
    assert tuple(groups) == GROUPS
    grouped = [id(parameter) for group in groups.values() for parameter in group]
    assert sorted(grouped) == sorted(id(parameter) for parameter in network.parameters())


def test_each_side_owns_its_layers_and_the_rest_is_shared(random_network):
    assert names_of(random_network("unilateral"), "shared") == list(random_network("unilateral").state_dict())
    for architecture in ("bilateral", "callosal"):
        network = random_network(architecture)
        for side in SIDES:
            layers = [f"{side}.{k}.{kind}" for k in range(2) for kind in ("weight", "bias")]
            assert names_of(network, side) == layers
        shared = {"combination_dominant", "combination_non_dominant", "output.weight", "output.bias"}
        assert set(names_of(network, "shared")) == shared


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_leading_dimensions_are_kept_and_excitations_are_the_sigmoid(random_network, architecture):
    network = random_network(architecture)
    for leading in ((), (5,), (3, 4)):
        observation = torch.randn(*leading, 16)
        output, excitation = network(observation), network.excitation(observation)
        assert output.shape == excitation.shape == (*leading, 6)
        torch.testing.assert_close(excitation, 1 / (1 + torch.exp(-output)))


@pytest.mark.parametrize(
    ("architecture", "units", "layers", "message"),
    [
        ("unilateral", 0, 2, "units must be at least 1, got 0"),
        ("unilateral", 10, 0, "layers must be at least 1, got 0"),
        ("bilateral", -2, 2, "units must be at least 1, got -2"),
        ("bilateral", 7, 2, "bilateral network .* 7 is odd"),
        ("callosal", 7, 2, "callosal network .* 7 is odd"),
        ("callosal", 2, 2, "callosal network needs at least 4 units.* got 2"),
        ("callosal", 10, 1, "callosal network needs at least 2 hidden layers.* got 1"),
    ],
)
def test_sizes_that_an_architecture_cannot_have_are_refused(architecture, units, layers, message):
    with pytest.raises(ValueError, match=message):
        make_network(architecture, 16, 6, units, layers)


def test_an_unknown_architecture_is_refused_naming_the_valid_ones():
    with pytest.raises(ValueError, match=r"trilateral.*unilateral, bilateral, callosal"):
        make_network("trilateral", 16, 6)


def received(network, observation):
    """Record the inputs of each side's second hidden layer."""
    inputs = {}
    for side in SIDES:
        hook = getattr(network, side)[1].register_forward_pre_hook(lambda _, x, side=side: inputs.update({side: x[0]}))
        try:
            network(observation)
        finally:
            hook.remove()
    return inputs


def callosal_network_with_first_layer_activity(dominant, non_dominant):
    """A callosal network whose sides' first hidden layers have this activity for any observation."""
    network = make_network("callosal", n_inputs=1, n_outputs=1, units=2 * len(dominant))
    with torch.no_grad():
        for side, activity in (("dominant", dominant), ("non_dominant", non_dominant)):
            layer = getattr(network, side)[0]
            layer.weight.zero_()
            layer.bias.copy_(torch.atanh(torch.tensor(activity)))
    return network


@pytest.mark.parametrize("sender", SIDES)
def test_the_callosum_sends_the_papers_example(sender):
    # [1, 5, 2, 3, 9] sends [0, 0, 0, 5, 3]; a tenth of it, as activity is a tanh.
    activity, silence = [0.1, 0.5, 0.2, 0.3, 0.9], [0.0] * 5
    receiver = "non_dominant" if sender == "dominant" else "dominant"
    network = callosal_network_with_first_layer_activity(**{sender: activity, receiver: silence})
    inputs = received(network, torch.zeros(1, 1))
    torch.testing.assert_close(inputs[receiver], torch.tensor([[0.0, 0.0, 0.0, 0.5, 0.3]]))
    torch.testing.assert_close(inputs[sender], torch.tensor([activity]))


def test_both_directions_of_the_callosum_carry_the_values_from_before_the_exchange():
    network = callosal_network_with_first_layer_activity([0.1, 0.2, 0.3, 0.4], [-0.1, -0.2, 0.5, 0.6])
    inputs = received(network, torch.zeros(1, 1))
    torch.testing.assert_close(inputs["dominant"], torch.tensor([[0.1, 0.2, 0.3 - 0.1, 0.4 + 0.6]]))
    torch.testing.assert_close(inputs["non_dominant"], torch.tensor([[-0.1, -0.2, 0.5 + 0.2, 0.6 + 0.4]]))


def test_without_a_callosum_the_sides_do_not_talk(random_network):
    network, observation = random_network("bilateral"), torch.randn(8, 16)
    before = received(network, observation)["non_dominant"].clone()
    with torch.no_grad():
        for parameter in network.dominant.parameters():
            parameter.add_(1.0)
    torch.testing.assert_close(received(network, observation)["non_dominant"], before, rtol=0, atol=0)


@pytest.mark.parametrize("side", SIDES)
def test_a_sides_weights_act_through_the_other_side_only_over_an_intact_callosum(random_network, side):
    """With the side's own way to the output closed, only the callosum is left."""
    observation, weights = torch.randn(8, 16), torch.randn(8, 6)
    bilateral, callosal = random_network("bilateral"), random_network("callosal")
    with bilateral.lesioned(f"deep_{side}"):
        isolated = gradients(bilateral, weights, observation)
    with callosal.lesioned(f"deep_{side}"):
        connected = gradients(callosal, weights, observation)
    with callosal.lesioned(f"callosum_deep_{side}"):
        cut = gradients(callosal, weights, observation)
    for name in names_of(callosal, side):
        assert isolated[name] is None
        assert cut[name] is None
        if name.startswith(f"{side}.0"):
            assert connected[name].abs().max() > 1e-3
        else:
            assert connected[name] is None, "the last hidden layer sends nothing over the callosum"


def test_in_the_bilateral_network_a_sides_gradient_ignores_the_other_sides_weights(random_network):
    network, observation, weights = random_network("bilateral"), torch.randn(8, 16), torch.randn(8, 6)
    before = {name: g.clone() for name, g in gradients(network, weights, observation).items()}
    with torch.no_grad():
        for parameter in network.dominant.parameters():
            parameter.mul_(-2.0)
    after = gradients(network, weights, observation)
    for name in names_of(network, "non_dominant"):
        torch.testing.assert_close(after[name], before[name], rtol=0, atol=0)
    assert not torch.allclose(after["dominant.0.weight"], before["dominant.0.weight"])


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_kernels_start_glorot_uniform_biases_zero_and_combination_weights_a_half(architecture):
    network = make_network(architecture, n_inputs=60, n_outputs=50, units=120, layers=3)
    for name, parameter in network.named_parameters():
        if name.startswith("combination"):
            assert parameter.item() == 0.5
        elif name.endswith("bias"):
            assert (parameter == 0).all()
        else:
            bound = (6 / sum(parameter.shape)) ** 0.5
            assert 0.97 * bound < parameter.abs().max() <= bound
            assert parameter.std().item() == pytest.approx(bound / 3**0.5, rel=0.05), "uniform"
            assert abs(parameter.mean().item()) < 0.05 * bound


@pytest.mark.parametrize("architecture", ["bilateral", "callosal"])
def test_constrain_clamps_negative_combination_weights_and_nothing_else(random_network, architecture):
    network = random_network(architecture)
    with torch.no_grad():
        network.combination_dominant.fill_(-0.3)
        network.combination_non_dominant.fill_(0.2)
    before = {name: value.clone() for name, value in network.state_dict().items()}
    network.constrain()
    assert network.combination_weights() == {"dominant": 0.0, "non_dominant": pytest.approx(0.2)}
    before["combination_dominant"] = torch.tensor(0.0)
    for name, value in network.state_dict().items():
        assert torch.equal(value, before[name]), name
    assert network.combination_dominant.requires_grad


def test_constrain_leaves_a_unilateral_network_alone(random_network):
    network = random_network("unilateral")
    before = {name: value.clone() for name, value in network.state_dict().items()}
    network.constrain()
    assert all(torch.equal(value, before[name]) for name, value in network.state_dict().items())


def test_a_network_without_sides_has_no_combination_weights(random_network):
    assert random_network("unilateral").combination_weights() == {}


def test_an_architecture_that_leaves_out_what_it_computes_cannot_be_built():
    class Incomplete(MotorNetwork):
        architecture = "unilateral"

    with pytest.raises(TypeError, match=r"abstract.*forward.*group_of"):
        Incomplete(16, 6)
