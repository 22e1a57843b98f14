"""Where parameters lie in a row: nothing is lost, nothing overlaps, everything comes back."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from bilateral_rl.bptt.layout import Layout
from bilateral_rl.policies import ARCHITECTURES, make_network

fast = settings(max_examples=40, deadline=None)


@st.composite
def networks(draw):
    """A network of any architecture and size, for one arm or for two."""
    architecture = draw(st.sampled_from(list(ARCHITECTURES)))
    units, layers = draw(st.integers(1, 24)), draw(st.integers(1, 5))
    if architecture == "bilateral":
        units = 2 * units
    if architecture == "callosal":
        units, layers = 2 * units + 2, layers + 1
    n_arms = draw(st.integers(1, 2))
    sizes = (n_arms * draw(st.integers(1, 20)), n_arms * draw(st.integers(1, 8)), units, layers)
    paths = {"trained_combination": True} if draw(st.booleans()) else {"ipsilateral_share": 0.0}
    has_paths = n_arms == 2 and architecture != "unilateral"
    return make_network(architecture, *sizes, n_arms=n_arms, **(paths if has_paths else {}))


def states_of(network, n, seed):
    """The state of ``n`` such networks with random parameters."""
    generator = torch.Generator().manual_seed(seed)
    return [
        {name: torch.randn(value.shape, generator=generator) for name, value in network.state_dict().items()}
        for _ in range(n)
    ]


@fast
@given(network=networks(), n=st.integers(1, 4), seed=st.integers(0, 100))
def test_unpacking_gives_back_what_was_packed(network, n, seed):
    layout, states = Layout(network), states_of(network, n, seed)
    rows = layout.pack(states)
    assert rows.shape == (n, layout.width)
    unpacked = layout.unpack(rows)
    assert set(unpacked) == set(network.state_dict())
    for name, stacked in unpacked.items():
        assert torch.equal(stacked, torch.stack([state[name] for state in states])), name


@fast
@given(network=networks())
def test_parameters_lie_one_after_the_other_in_rows_of_a_multiple_of_sixteen(network):
    layout, offset = Layout(network), 0
    for v in layout.variables:
        assert (v.offset, v.size) == (offset, network.get_parameter(v.name).numel())
        assert v.group == network.group_of(v.name)
        offset += v.size
    assert sorted(v.name for v in layout.variables) == sorted(name for name, _ in network.named_parameters())
    assert layout.width % 16 == 0
    assert offset <= layout.width < offset + 16


@fast
@given(network=networks(), n=st.integers(1, 3))
def test_regions_hold_the_variables_layer_by_layer_and_the_bias_last(network, n):
    layout, states = Layout(network), states_of(network, n, seed=0)
    rows = layout.pack(states)
    sides = ["hidden"] if network.architecture == "unilateral" else ["dominant", "non_dominant"]
    names = {
        "first": [f"{side}.0" for side in sides],
        "hidden": [f"{side}.{k}" for k in range(1, network.layers) for side in sides],
        "output": ["output"] if layout.shape.arms == 1 else ["output.dominant", "output.non_dominant"],
    }
    regions = {name: layout.region(rows, name) for name in layout.regions}
    assert set(regions) == {*names, "combination"}
    for s, state in enumerate(states):
        for region, modules in names.items():
            layers = [torch.cat([state[f"{m}.weight"].t(), state[f"{m}.bias"][None]]) for m in modules]
            values = regions[region][s].reshape(len(layers), *regions[region].shape[-2:])
            assert len(layers) == 0 or torch.equal(values, torch.stack(layers)), region
        weights = [state[f"combination_{side}"].reshape(-1).tolist() for side in sides if len(sides) == 2]
        assert regions["combination"][s].tolist() == weights


def test_regions_are_views_of_the_rows():
    layout = Layout(make_network("callosal", n_inputs=16, n_outputs=6))
    rows = torch.zeros(2, 3, layout.width)
    for name in layout.regions:
        layout.region(rows, name).fill_(1.0)
    n = sum(v.size for v in layout.variables)
    assert (rows[..., :n] == 1).all()
    assert (rows[..., n:] == 0).all()


@fast
@given(network=networks())
def test_what_is_fixed_is_not_free(network):
    layout = Layout(network)
    fixed = {v.name for v in layout.variables if v.fixed}
    assert fixed == {name for name, parameter in network.named_parameters() if not parameter.requires_grad}
    assert layout.free.sum() == sum(parameter.numel() for parameter in network.parameters() if parameter.requires_grad)


def test_only_the_combination_weights_are_kept_from_going_negative():
    for architecture in ARCHITECTURES:
        network = make_network(architecture, n_inputs=16, n_outputs=6)
        kept = {v.name for v in Layout(network).variables if v.non_negative}
        with torch.no_grad():
            for parameter in network.parameters():
                parameter.fill_(-1.0)
        network.constrain()
        assert kept == {name for name, parameter in network.named_parameters() if (parameter == 0).all()}


def test_packing_and_unpacking_copy():
    network = make_network("callosal", n_inputs=16, n_outputs=6)
    layout = Layout(network)
    rows = layout.pack([network.state_dict()])
    before = rows.clone()
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.add_(1.0)
    for stacked in layout.unpack(rows).values():
        stacked.add_(1.0)
    assert torch.equal(rows, before)


def test_a_parameter_without_a_place_is_refused():
    network = make_network("unilateral", n_inputs=16, n_outputs=6)
    network.gain = torch.nn.Parameter(torch.ones(3))
    with pytest.raises(ValueError, match="without a place: gain"):
        Layout(network)
