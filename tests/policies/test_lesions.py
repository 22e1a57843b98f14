"""The seven lesions: what each takes away, and that it comes back."""

import numpy as np
import pytest
import torch

from bilateral_rl.policies import LESIONS, Lesion, make_network
from bilateral_rl.policies.lesions import NO_LESION, RELEASED_LESIONS, find_lesion
from bilateral_rl.vocabulary import SIDES

WITHOUT_CALLOSUM = [f"{depth}_{side}" for depth in ("shallow", "deep") for side in SIDES]
CALLOSAL_ONLY = ["callosum", "callosum_deep_dominant", "callosum_deep_non_dominant"]
POSSIBLE = [
    *[("bilateral", lesion) for lesion in WITHOUT_CALLOSUM],
    *[("callosal", lesion) for lesion in WITHOUT_CALLOSUM + CALLOSAL_ONLY],
]
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


@pytest.mark.parametrize(("architecture", "lesion"), POSSIBLE)
@pytest.mark.parametrize("layers", [2, 4])
def test_a_lesion_takes_away_what_the_paper_says(random_network, reference_forward, architecture, lesion, layers):
    network = random_network(architecture, layers=layers, seed=layers)
    with network.lesioned(lesion):
        lesioned = output(network).numpy()
    expected = reference_forward(network, OBSERVATION.double().numpy(), LESIONS[lesion])
    np.testing.assert_allclose(lesioned, expected, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize(("architecture", "lesion"), POSSIBLE)
def test_a_lesion_changes_the_output_and_never_the_weights(random_network, architecture, lesion):
    network = random_network(architecture)
    weights = {name: value.clone() for name, value in network.state_dict().items()}
    intact = output(network)
    with network.lesioned(lesion):
        assert (output(network) - intact).abs().max() > 1e-2
        assert all(torch.equal(value, weights[name]) for name, value in network.state_dict().items())
    assert torch.equal(output(network), intact)
    assert all(torch.equal(value, weights[name]) for name, value in network.state_dict().items())


@pytest.mark.parametrize("lesion", WITHOUT_CALLOSUM + CALLOSAL_ONLY)
def test_the_seven_lesions_differ_from_each_other(random_network, lesion):
    network = random_network("callosal")
    outputs = {}
    for name in LESIONS:
        with network.lesioned(name):
            outputs[name] = output(network)
    assert all((outputs[lesion] - other).abs().max() > 1e-3 for name, other in outputs.items() if name != lesion)


def test_a_lesion_is_lifted_after_an_exception(random_network):
    network = random_network("callosal")
    with pytest.raises(RuntimeError, match="experiment failed"):
        raise_inside(network, "callosum")
    assert network.lesion == NO_LESION


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


@pytest.mark.parametrize(("architecture", "lesion", "reason"), IMPOSSIBLE)
def test_a_lesion_that_the_architecture_cannot_have_is_refused_by_name(architecture, lesion, reason):
    network = make_network(architecture, 16, 6)
    with pytest.raises(ValueError, match=rf"{reason}.*{lesion}"):
        network.set_lesion(lesion)
    with pytest.raises(ValueError, match=reason), network.lesioned(LESIONS[lesion]):
        pass
    assert network.lesion == NO_LESION


@pytest.mark.parametrize("architecture", ["unilateral", "bilateral", "callosal"])
def test_available_lesions_are_exactly_those_that_can_be_set(architecture):
    network = make_network(architecture, 16, 6)
    possible = [lesion for case, lesion in POSSIBLE if case == architecture]
    assert sorted(network.available_lesions()) == sorted(possible)
    for lesion in network.available_lesions():
        network.set_lesion(lesion)
    network.set_lesion("intact")


@pytest.mark.parametrize("architecture", ["unilateral", "bilateral", "callosal"])
def test_an_unknown_lesion_is_refused_naming_the_valid_ones(architecture):
    with pytest.raises(ValueError, match=r"'deep_left'.*intact, shallow_dominant.*callosum_deep_non_dominant"):
        make_network(architecture, 16, 6).set_lesion("deep_left")


@pytest.mark.parametrize("architecture", ["bilateral", "callosal"])
@pytest.mark.parametrize("side", SIDES)
def test_a_deep_lesion_equals_a_combination_weight_of_zero(random_network, architecture, side):
    network = random_network(architecture)
    with network.lesioned(f"deep_{side}"):
        lesioned = output(network)
    with torch.no_grad():
        getattr(network, f"combination_{side}").zero_()
    assert torch.equal(output(network), lesioned)


@pytest.mark.parametrize("side", SIDES)
def test_a_shallow_lesion_leaves_the_biases_flowing(random_network, side):
    """The lesioned side still says something – the same to every observation – through its biases."""
    network = random_network("bilateral")
    with network.lesioned(f"shallow_{side}"):
        with_biases = output(network)
    with network.lesioned(f"deep_{side}"):
        silent = output(network)
    contribution = with_biases - silent
    assert contribution.abs().max() > 1e-2
    torch.testing.assert_close(contribution, contribution[:1].expand_as(contribution), rtol=0, atol=1e-5)


def test_the_released_codes_combined_lesions_take_the_input_instead_of_the_output():
    for side in SIDES:
        name = f"callosum_deep_{side}"
        assert find_lesion(name, RELEASED_LESIONS) == Lesion(input_of=side, callosum=True)
        assert find_lesion(name) == Lesion(output_of=side, callosum=True)
    for name in [*WITHOUT_CALLOSUM, "callosum"]:
        assert RELEASED_LESIONS[name] == LESIONS[name]
