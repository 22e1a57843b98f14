"""The seven lesions: what each takes away, and that it comes back."""

import itertools

import numpy as np
import pytest
import torch

from bilateral_rl.policies import LESIONS, Lesion, make_network
from bilateral_rl.policies.lesions import NO_LESION, RELEASED_LESIONS, find_lesion
from bilateral_rl.vocabulary import SIDES

WITHOUT_CALLOSUM = [f"{depth}_{side}" for depth in ("shallow", "deep") for side in SIDES]
CALLOSAL_ONLY = ["callosum", "callosum_deep_dominant", "callosum_deep_non_dominant"]
POSSIBLE = {"unilateral": [], "bilateral": WITHOUT_CALLOSUM, "callosal": WITHOUT_CALLOSUM + CALLOSAL_ONLY}
IMPOSSIBLE = [
    *[("unilateral", lesion, "unilateral network has no hemispheres") for lesion in WITHOUT_CALLOSUM + CALLOSAL_ONLY],
    *[("bilateral", lesion, "bilateral network has no callosum") for lesion in CALLOSAL_ONLY],
]
OBSERVATION = torch.randn(32, 16, generator=torch.Generator().manual_seed(1))


def output(network):
    with torch.no_grad():
        return network(OBSERVATION)


def raise_inside(network, lesion):
    with network.lesioned(lesion):
        raise RuntimeError("the experiment failed")


def test_there_are_the_papers_seven_lesions():
    assert set(LESIONS) == {*WITHOUT_CALLOSUM, *CALLOSAL_ONLY}
    assert len(set(LESIONS.values())) == 7
    assert NO_LESION not in LESIONS.values()


@pytest.mark.parametrize("architecture", ["bilateral", "callosal"])
@pytest.mark.parametrize("layers", [2, 4])
def test_a_lesion_takes_away_what_the_paper_says_and_never_the_weights(
    random_network, reference_forward, architecture, layers
):
    network = random_network(architecture, layers=layers, seed=layers)
    weights = {name: value.clone() for name, value in network.state_dict().items()}
    outputs = [output(network)]
    for lesion in POSSIBLE[architecture]:
        with network.lesioned(lesion):
            outputs.append(output(network))
        expected = reference_forward(network, OBSERVATION.double().numpy(), LESIONS[lesion])
        np.testing.assert_allclose(outputs[-1].numpy(), expected, rtol=1e-4, atol=1e-5, err_msg=lesion)
        assert torch.equal(output(network), outputs[0])
    assert all(torch.equal(value, weights[name]) for name, value in network.state_dict().items())
    for one, other in itertools.combinations(outputs, 2):
        assert (one - other).abs().max() > 1e-3, "no two do the same"


def test_nested_lesions_give_back_the_outer_one(random_network):
    network = random_network("callosal")
    with network.lesioned("shallow_dominant"):
        outer = output(network)
        with pytest.raises(RuntimeError):
            raise_inside(network, "callosum")
        with network.lesioned("intact"):
            assert network.lesion == NO_LESION
        assert network.lesion == LESIONS["shallow_dominant"]
        assert torch.equal(output(network), outer)
    assert network.lesion == NO_LESION


def test_a_lesion_stays_until_set_to_intact(random_network):
    network = random_network("bilateral")
    intact = output(network)
    network.set_lesion("deep_dominant")
    assert not torch.equal(output(network), intact)
    network.set_lesion("intact")
    assert torch.equal(output(network), intact)


def test_a_lesion_that_the_architecture_cannot_have_is_refused_by_name():
    for architecture, lesion, reason in IMPOSSIBLE:
        network = make_network(architecture, 16, 6)
        with pytest.raises(ValueError, match=rf"{reason}.*{lesion}"):
            network.set_lesion(lesion)
        with pytest.raises(ValueError, match=reason), network.lesioned(LESIONS[lesion]):
            pass
        assert network.lesion == NO_LESION


def test_available_lesions_are_exactly_those_that_can_be_set():
    for architecture, possible in POSSIBLE.items():
        network = make_network(architecture, 16, 6)
        assert sorted(network.available_lesions()) == sorted(possible)
        for lesion in network.available_lesions():
            network.set_lesion(lesion)
        network.set_lesion("intact")


def test_an_unknown_lesion_is_refused_naming_the_valid_ones():
    for architecture in POSSIBLE:
        with pytest.raises(ValueError, match=r"'deep_left'.*intact, shallow_dominant.*callosum_deep_non_dominant"):
            make_network(architecture, 16, 6).set_lesion("deep_left")


def test_the_released_codes_combined_lesions_take_the_input_instead_of_the_output():
    for side in SIDES:
        name = f"callosum_deep_{side}"
        assert find_lesion(name, RELEASED_LESIONS) == Lesion(input_of=side, callosum=True)
        assert find_lesion(name) == Lesion(output_of=side, callosum=True)
    for name in [*WITHOUT_CALLOSUM, "callosum"]:
        assert RELEASED_LESIONS[name] == LESIONS[name]
