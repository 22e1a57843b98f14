"""What each side supplies: against plain loops, of saturated, lost and silent sides."""

import math
import statistics
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from bilateral_rl.analysis.modulation import (
    SILENT_PERCENT,
    TAGS,
    TAGS_OF,
    Contributions,
    SideModulation,
    contributions,
    contributions_in,
    modulation_of,
    side_modulation,
    side_modulations,
)
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.policies import make_network
from bilateral_rl.runs.policies import build_policy
from bilateral_rl.vocabulary import SIDES


@pytest.fixture
def policy(small):
    """Every parameter of its network is random, and the sides weigh differently."""
    torch.manual_seed(0)
    policy = build_policy(small)
    with torch.no_grad():
        for name, parameter in policy.motor_network.named_parameters():
            parameter += 0.2 * torch.randn(parameter.shape)
            if name.startswith("combination"):
                parameter.fill_(0.75 if name.endswith("_dominant") and "non" not in name else 0.25)
    return policy


@pytest.fixture
def evaluator(small):
    return Evaluator(small.task, small.trial, 5, 0)


LESIONS = ["intact", "shallow_dominant", "deep_dominant", "deep_non_dominant", "callosum", "callosum_deep_dominant"]


@pytest.mark.parametrize("lesion", LESIONS)
def test_contributions_and_the_bias_are_the_commands_that_were_given(policy, evaluator, lesion):
    network = policy.motor_network
    with network.lesioned(lesion), torch.no_grad():
        record = evaluator.run(policy)
        dominant, non_dominant = contributions(network, record.observation)
        expected = network(torch.from_numpy(record.observation)).numpy()
    output = dominant + non_dominant + network.output.bias.detach().numpy()
    np.testing.assert_allclose(output, expected, atol=1e-6)
    assert dominant.any() == ("deep_dominant" not in lesion)
    assert non_dominant.any() == (lesion != "deep_non_dominant")


@pytest.mark.parametrize("lesion", ["intact", "shallow_dominant", "callosum"])
def test_modulation_and_constant_part_are_those_of_a_plain_loop(policy, evaluator, lesion):
    network = policy.motor_network
    with network.lesioned(lesion), torch.no_grad():
        record = evaluator.run(policy)
        found = side_modulation(network, record)
        samples = {side: [[] for _ in range(6)] for side in SIDES}
        for trial in record.observation:
            for observation in trial:
                activity = dict(zip(SIDES, network.hemispheres(torch.from_numpy(observation)), strict=True))
                for side in SIDES:
                    weight = network.combination_weights()[side]
                    for muscle, row in enumerate(network.output.weight.tolist()):
                        added = sum(w * weight * h for w, h in zip(row, activity[side].tolist(), strict=True))
                        samples[side][muscle].append(added)
    deviations = {side: statistics.fmean(map(statistics.pstdev, samples[side])) for side in SIDES}
    means = {side: statistics.fmean(abs(statistics.fmean(values)) for values in samples[side]) for side in SIDES}
    assert found.modulation == pytest.approx(deviations, rel=1e-5)
    assert found.constant == pytest.approx(means, rel=1e-5)
    shares = {side: 100 * deviations[side] / sum(deviations.values()) for side in SIDES}
    assert found.percent == pytest.approx(shares, rel=1e-5)
    assert sum(found.percent.values()) == pytest.approx(100)


def test_a_saturated_side_has_no_share_however_much_it_adds(policy, evaluator):
    network = policy.motor_network
    with torch.no_grad():
        network.non_dominant[-1].bias.fill_(40.0)
    found = side_modulation(network, evaluator.run(policy))
    assert found.percent == {"dominant": 100.0, "non_dominant": 0.0}
    expected = 0.25 * network.output.weight.sum(dim=1).abs().mean().item()
    assert found.constant["non_dominant"] == pytest.approx(expected, rel=1e-5)
    assert found.constant["non_dominant"] > 0.05
    assert found.silent == ["non_dominant"]


def test_a_side_with_no_combination_weight_or_a_deep_lesion_supplies_nothing(policy, evaluator):
    network = policy.motor_network
    with network.lesioned("deep_dominant"):
        lesioned = side_modulation(network, evaluator.run(policy))
    assert (lesioned.percent["dominant"], lesioned.constant["dominant"], lesioned.silent) == (0.0, 0.0, ["dominant"])
    with torch.no_grad():
        network.combination_non_dominant.zero_()
    found = side_modulation(network, evaluator.run(policy))
    assert (found.percent["non_dominant"], found.constant["non_dominant"]) == (0.0, 0.0)
    assert found.silent == ["non_dominant"]


def test_sides_that_cancel_each_other_both_count():
    swing = np.random.default_rng(0).normal(size=(4, 10, 6))
    found = modulation_of(Contributions(swing, -swing + 3.0))
    assert found.percent == pytest.approx({"dominant": 50.0, "non_dominant": 50.0})
    assert found.constant["non_dominant"] == pytest.approx(3.0, abs=0.3)
    assert found.silent == []


def test_a_side_is_silent_up_to_a_named_share_and_both_are_where_nothing_moves():
    def of(dominant, non_dominant):
        return SideModulation({"dominant": dominant, "non_dominant": non_dominant}, dict.fromkeys(SIDES, 0.0))

    assert of(SILENT_PERCENT + 0.01, 100 - SILENT_PERCENT).silent == []
    assert of(SILENT_PERCENT - 0.01, 100 - SILENT_PERCENT).silent == ["dominant"]
    assert of(0.0, 0.0).silent == [*SIDES]
    assert all(math.isnan(share) for share in of(0.0, 0.0).percent.values())
    assert of(math.nan, math.nan).silent == []  # not known


def test_each_of_two_arms_has_shares_of_its_own():
    network = make_network("callosal", 10, 6, 8, n_arms=2, ipsilateral_share=0.3)
    added = contributions(network, np.random.default_rng(0).normal(size=(5, 4, 10)).astype(np.float32))
    modulation = modulation_of(added, 2)
    for name, muscles in (("dominant", slice(0, 3)), ("non_dominant", slice(3, 6))):
        of_arm = modulation_of(Contributions(*(side[..., muscles] for side in added)))
        for side in SIDES:
            path = f"{name}_arm/{side}"
            assert modulation.modulation[path] == of_arm.modulation[side]
            assert modulation.constant[path] == of_arm.constant[side]
            assert modulation.percent[path] == of_arm.percent[side]
    assert modulation.measures().keys() == TAGS_OF[2].keys()
    assert TAGS["contribution_percent_dominant_arm_non_dominant"] == "contribution_percent/dominant_arm/non_dominant"
    assert SideModulation.from_measures(modulation.measures() | {"loss": 1.0}) == modulation


def test_in_trials_of_two_arms_a_network_sees_both_hands_views_side_by_side():
    network = make_network("callosal", 10, 6, 8, n_arms=2)
    views = np.random.default_rng(0).normal(size=(6, 4, 5)).astype(np.float32)  # two hands of each of three trials
    found = contributions_in(network, SimpleNamespace(observation=views))
    expected = contributions(network, np.concatenate([views[0::2], views[1::2]], axis=2))
    for side, of_trials in zip(found, expected, strict=True):
        np.testing.assert_array_equal(side, of_trials)


def test_a_side_of_two_arms_is_silent_where_it_moves_neither():
    def of(*numbers):
        paths = [f"{arm}_arm/{side}" for arm in SIDES for side in SIDES]
        return SideModulation(dict(zip(paths, numbers, strict=True)), dict.fromkeys(paths, 0.0)).silent

    assert of(99.0, 1.0, 50.0, 50.0) == []
    assert of(99.0, 1.0, 99.0, 1.0) == ["non_dominant"]
    assert of(1.0, 99.0, 0.0, 0.0) == ["dominant"], "where neither moves an arm, that arm says nothing for it"


def test_its_numbers_have_names_and_come_back_from_them():
    modulation = SideModulation({"dominant": 3.0, "non_dominant": 1.0}, {"dominant": 0.5, "non_dominant": 0.25})
    assert list(modulation.measures()) == list(TAGS_OF[1])
    assert {TAGS[name]: value for name, value in modulation.measures().items()} == {
        "contribution/dominant": 3.0,
        "contribution/non_dominant": 1.0,
        "contribution_percent/dominant": 75.0,
        "contribution_percent/non_dominant": 25.0,
        "contribution_constant/dominant": 0.5,
        "contribution_constant/non_dominant": 0.25,
    }
    assert SideModulation.from_measures(modulation.measures()) == modulation


def test_a_network_with_one_side_has_none_of_it(policy, evaluator):
    record = evaluator.run(policy)
    assert side_modulation(make_network("unilateral", 16, 6), record) is None
    networks = {3: make_network("unilateral", 16, 6), 4: policy.motor_network}
    assert list(side_modulations(networks, {3: record, 4: record})) == [4]
