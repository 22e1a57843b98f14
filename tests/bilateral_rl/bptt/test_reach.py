"""Which weights have a way to the output under a lesion, counted by hand."""

import pytest
import torch

from bilateral_rl.bptt.reach import reached_weights
from bilateral_rl.policies.lesions import LESIONS, NO_LESION, Lesion
from bilateral_rl.policies.networks import make_network

SIZES = {"n_inputs": 7, "n_outputs": 3}


def unreached(architecture, lesion, units=10, layers=2):
    """Numbers without a way to the output, by parameter."""
    network = make_network(architecture, **SIZES, units=units, layers=layers)
    reached = reached_weights(network, lesion)
    assert {name: tensor.shape for name, tensor in reached.items()} == {
        name: p.shape for name, p in network.named_parameters()
    }
    return {name: int((~tensor).sum()) for name, tensor in reached.items() if not tensor.all()}


@pytest.mark.parametrize("architecture", ["unilateral", "bilateral", "callosal"])
@pytest.mark.parametrize("layers", [2, 4])
def test_all_of_an_intact_network_is_reached(architecture, layers):
    assert unreached(architecture, NO_LESION, layers=layers) == {}


def test_a_shallow_lesion_cuts_off_the_inputs_but_not_the_biases():
    assert unreached("bilateral", LESIONS["shallow_dominant"]) == {"dominant.0.weight": 5 * 7}
    # Behind it the units' activity is constant, so that the same one of each two is always the larger: either may be.
    shallow = LESIONS["shallow_non_dominant"]
    assert unreached("callosal", shallow, layers=4) == {"non_dominant.0.weight": 5 * 7}


def test_without_a_callosum_a_deep_lesion_silences_a_side():
    whole_side = {"non_dominant.0.weight": 35, "non_dominant.0.bias": 5, "non_dominant.1.weight": 25,
                  "non_dominant.1.bias": 5, "combination_non_dominant": 1}  # fmt: skip
    assert unreached("bilateral", LESIONS["deep_non_dominant"]) == whole_side
    assert unreached("callosal", LESIONS["callosum_deep_non_dominant"]) == whole_side
    assert unreached("callosal", LESIONS["callosum"]) == {}


def test_over_the_callosum_a_side_is_heard_but_for_the_unit_that_pooling_drops():
    last_layer = {"dominant.1.weight": 25, "dominant.1.bias": 5, "combination_dominant": 1}
    dropped = {"dominant.0.weight": 7, "dominant.0.bias": 1}
    assert unreached("callosal", LESIONS["deep_dominant"]) == dropped | last_layer
    even = {"dominant.1.weight": 36, "dominant.1.bias": 6, "combination_dominant": 1}
    assert unreached("callosal", LESIONS["deep_dominant"], units=12) == even
    # Of three layers, the second one's last unit is dropped; the first layer reaches the others through its own side.
    deep = {"dominant.1.weight": 5, "dominant.1.bias": 1, "dominant.2.weight": 25, "dominant.2.bias": 5}
    found = unreached("callosal", LESIONS["deep_dominant"], layers=3)
    assert found == deep | {"combination_dominant": 1}


def test_it_is_a_matter_of_structure_and_touches_no_random_stream():
    network = make_network("callosal", **SIZES)
    expected = reached_weights(network, LESIONS["deep_dominant"])
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.zero_()
    network.set_lesion("callosum")
    state = torch.random.get_rng_state()
    both = Lesion(input_of="dominant", output_of="non_dominant")  # no other test asks for it: it is not remembered
    reached_weights(network, both)
    assert torch.equal(state, torch.random.get_rng_state())
    again = reached_weights(network, LESIONS["deep_dominant"])
    assert all(torch.equal(again[name], expected[name]) for name in expected)
