"""Lesion studies: every state that a network can have, each seed as if it were alone, and the run only read."""

import copy
import itertools

import pandas as pd
import pytest
import torch
from lesion_studies import (
    assert_same,
    evaluated,
    retrained_by_hand,
    run_study,
    study_of,
    values_of,
    with_config,
)

from bilateral_rl.analysis.goals import STUDY_RADII
from bilateral_rl.analysis.metrics import metrics_of
from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.analysis.results import COLUMNS
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import LESIONS, RELEASED_LESIONS, find_lesion
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import build_network, load_policies, load_policy, network_states
from bilateral_rl.study import lesioning
from bilateral_rl.study.lesioning import state_names
from bilateral_rl.training.fresh_networks import fresh_network
from bilateral_rl.training.retraining import Retraining

COMBINED = ["callosum_deep_dominant", "callosum_deep_non_dominant"]
STATE = ["seed", "lesion", "network", "protocol"]
NONE = {"network": "trained", "protocol": "none"}
OUTPUT = {"network": "trained", "protocol": "output"}
NO_RETRAINING = {"protocols": (Protocol("none"),)}


@pytest.fixture(scope="module")
def trained(_trained_bptt):
    """A run of three seeds, never written to."""
    return _trained_bptt


@pytest.fixture(scope="module")
def results(trained):
    return run_study(trained)


# States


def test_a_model_has_the_states_of_its_architecture_intact_first(small_bptt):
    for model in MODELS:
        shallow_and_deep = ["shallow_dominant", "shallow_non_dominant", "deep_dominant", "deep_non_dominant"]
        lesions = {"uni": [], "bi": shallow_and_deep, "cc": [*shallow_and_deep, "callosum", *COMBINED]}
        names = state_names(small_bptt(model), None)
        assert names == ["intact", *lesions[model.split("_")[0]]]
        assert len(names) == {"uni": 1, "bi": 5, "cc": 8}[model.split("_")[0]]


def test_wanted_lesions_come_in_the_order_wanted_each_once_after_the_intact_network(small_bptt):
    wanted = ["callosum", "deep_dominant", "callosum", "intact"]
    assert state_names(small_bptt("cc_s"), wanted) == ["intact", "callosum", "deep_dominant"]
    assert state_names(small_bptt("uni_b"), ["intact"]) == ["intact"]


def test_a_lesion_that_cannot_be_is_refused_with_those_that_can(small_bptt):
    for model, lesion, says in (
        ("uni_b", "deep_dominant", "uni_b is a unilateral network and cannot .* 'deep_dominant'; choose from intact.$"),
        ("bi_ns", "callosum", "bilateral .* 'callosum'; .* shallow_dominant, .*deep_non_dominant.$"),
        (
            "bi_s",
            "callosum_deep_dominant",
            "bilateral .* choose from intact, shallow_dominant, .*, deep_non_dominant.$",
        ),
        ("cc_s", "lobotomy", "callosal .* 'lobotomy'; choose from intact, .*, callosum_deep_non_dominant.$"),
        ("uni_dl", "lobotomy", "choose from intact.$"),
    ):
        with pytest.raises(UserError, match=says):
            state_names(small_bptt(model), ["intact", lesion])


# The table


def test_there_is_a_row_for_each_seed_state_condition_and_metric(trained, results):
    metrics = [metric.name for metric in metrics_of("random_reach", STUDY_RADII)]
    assert tuple(results.columns) == COLUMNS
    assert len(results) == 3 * 8 * 3 * 2 * len(metrics)
    assert not results.duplicated([*STATE, "metric"]).any()
    assert set(map(tuple, results[["model", "task", "algo"]].to_numpy())) == {("cc_s", "random_reach", "bptt")}
    assert sorted(set(results["seed"])) == [0, 1, 2]
    assert list(dict.fromkeys(results["lesion"])) == ["intact", *LESIONS]
    assert list(dict.fromkeys(results["metric"])) == metrics
    assert list(dict.fromkeys(results["protocol"])) == ["none", "output", "everything"]
    assert list(dict.fromkeys(results["network"])) == ["trained", "fresh"]


def test_metrics_are_those_of_the_task_at_the_reported_radii_and_the_runs_own(bptt_run):
    with_config(bptt_run, task="hold_position", trial={"threshold": 0.045})
    found = set(run_study(bptt_run, only=0, **NO_RETRAINING, lesions=("callosum",), trials=2)["metric"])
    assert found == {metric.name for metric in metrics_of("hold_position", (*STUDY_RADII, 0.045))}
    assert {"time_in_goal_1cm", "time_in_goal_4.5cm", "effort"} < found
    assert "goal_completion_5cm" not in found


def test_values_are_those_of_the_lesioned_policy(trained, results):
    for seed, policy in load_policies(trained).items():
        for lesion in ("intact", *LESIONS):
            found = values_of(results, seed=seed, lesion=lesion, **NONE)
            assert_same(found, evaluated(trained, policy, lesion))


def test_a_seed_is_retrained_as_if_it_were_alone(trained, results):
    for lesion in ("intact", "shallow_dominant", "callosum_deep_non_dominant"):
        for seed in (0, 2):
            policy = retrained_by_hand(trained, seed, find_lesion(lesion))
            assert_same(values_of(results, seed=seed, lesion=lesion, **OUTPUT), evaluated(trained, policy, lesion))


def test_the_same_study_brings_the_same_numbers_whatever_the_threads(trained, results):
    again = run_study(trained, threads=2, lesions=("callosum",))
    expected = results[results["lesion"].isin(["intact", "callosum"])].reset_index(drop=True)
    pd.testing.assert_frame_equal(again, expected, check_exact=True)


def test_one_seed_and_some_lesions_bring_the_rows_that_all_bring(trained, results):
    some = run_study(trained, only=1, lesions=("callosum", "deep_dominant"))
    assert list(dict.fromkeys(some["lesion"])) == ["intact", "callosum", "deep_dominant"]
    wanted = results[(results["seed"] == 1) & results["lesion"].isin(["intact", "callosum", "deep_dominant"])]
    order = [*STATE, "metric"]
    first, second = (table.sort_values(order, ignore_index=True) for table in (some, wanted))
    pd.testing.assert_frame_equal(first, second, check_exact=True)


def test_the_trials_are_those_of_the_seed_asked_for(trained, results):
    other = run_study(trained, only=0, lesions=("callosum",), **NO_RETRAINING, seed=8, trials=3)
    found = values_of(other, lesion="callosum", **NONE)
    assert_same(found, evaluated(trained, load_policy(trained, seed=0), "callosum", seed=8, trials=3))
    assert found["effort"] != values_of(results, seed=0, lesion="callosum", **NONE)["effort"]


def test_the_best_weights_are_tested_if_asked(trained, results):
    best = run_study(trained, weights="best", lesions=("callosum",), **NO_RETRAINING)
    for seed, policy in load_policies(trained, "best").items():
        assert_same(values_of(best, seed=seed, lesion="callosum", **NONE), evaluated(trained, policy, "callosum"))
    tables = (best, results[results["protocol"] == "none"])
    efforts = [t["value"][(t["metric"] == "effort") & (t["network"] == "trained")] for t in tables]
    assert not set(efforts[0]) & set(efforts[1])


def test_without_retraining_there_is_one_condition(trained, results):
    without = run_study(trained, **NO_RETRAINING)
    pd.testing.assert_frame_equal(
        without, results[results["protocol"] == "none"].reset_index(drop=True), check_exact=True
    )


def test_it_says_which_state_comes_next(trained):
    heard = []
    study = study_of(trained, only=0, lesions=("callosum",), **NO_RETRAINING, trials=1)
    study.run(lambda *arguments: heard.append(arguments))
    assert study.names == ["intact", "callosum"]
    assert heard == [(0, 2, "intact"), (1, 2, "callosum"), (2, 2, "")]


# What is tested


@pytest.fixture
def tested(monkeypatch):
    """Every network that trials were run with: its lesion and a copy of its weights."""
    seen = []

    class Watching(Evaluator):
        def run(self, policy, deterministic=True):
            assert deterministic
            assert not policy.training
            seen.append((policy.motor_network.lesion, copy.deepcopy(policy.motor_network.state_dict())))
            return super().run(policy, deterministic)

    monkeypatch.setattr(lesioning, "Evaluator", Watching)
    return seen


ADAPTING = {
    "none": (),
    "output": ("output.",),
    "combination": ("output.", "combination_"),
    "everything": ("output.", "combination_", "dominant.", "non_dominant."),
}


@pytest.mark.parametrize("profile", ["paper", "released"])
def test_only_what_a_protocol_lets_adapt_is_another_and_no_test_leaves_a_trace(trained, tested, same_bits, profile):
    names = {"paper": list(LESIONS), "released": COMBINED}[profile]
    protocols = tuple(Protocol(retrain) for retrain in ADAPTING)
    run_study(trained, trials=1, profile=profile, lesions=tuple(names), protocols=protocols, retraining_trials=16)
    table, stored = {"paper": LESIONS, "released": RELEASED_LESIONS}[profile], network_states(trained)
    networks = [stored, {seed: fresh_network(trained.config(), seed) for seed in stored}]
    states = [
        (name, retrain, before)
        for name, retrain, states in itertools.product(("intact", *names), ADAPTING, networks)
        for before in states.values()
    ]
    for (name, retrain, before), (lesion, weights) in zip(states, tested, strict=True):
        assert lesion == find_lesion(name, table)
        assert weights.keys() == before.keys()
        changed = {key for key in weights if not same_bits(weights[key], before[key])}
        assert all(key.startswith(ADAPTING[retrain]) for key in changed), (name, retrain)
        assert {"output.weight", "output.bias"} <= changed or retrain == "none"


def test_the_control_is_a_fresh_network_of_the_seed_that_goes_through_the_same(trained, results):
    for seed, lesion in ((0, "intact"), (2, "callosum"), (1, "shallow_dominant")):
        fresh = fresh_network(trained.config(), seed)
        policy = load_policy(trained, seed=seed)
        policy.motor_network.load_state_dict(fresh)
        state = {"seed": seed, "lesion": lesion, "network": "fresh"}
        assert_same(values_of(results, **state, protocol="none"), evaluated(trained, policy, lesion))
        for protocol in (Protocol("output"), Protocol("everything")):
            policy = retrained_by_hand(trained, seed, find_lesion(lesion), protocol=protocol, state=fresh)
            found = values_of(results, **state, protocol=protocol.name)
            assert_same(found, evaluated(trained, policy, lesion))


def test_a_study_may_have_no_control(trained, results):
    without = run_study(trained, control=False, lesions=("callosum",))
    wanted = results[results["lesion"].isin(["intact", "callosum"]) & (results["network"] == "trained")]
    pd.testing.assert_frame_equal(without, wanted.reset_index(drop=True), check_exact=True)


def test_a_study_can_be_run_again(trained):
    study = study_of(trained, only=0, lesions=("callosum",), trials=2)
    pd.testing.assert_frame_equal(study.run(), study.run(), check_exact=True)


# Profiles


def test_the_released_profile_changes_the_combined_lesions_alone(trained, results):
    released = run_study(trained, profile="released", lesions=("deep_dominant", "callosum", *COMBINED))
    results = results[results["lesion"].isin(set(released["lesion"]))].reset_index(drop=True)
    combined = results["lesion"].isin(COMBINED)
    pd.testing.assert_frame_equal(released[~combined], results[~combined], check_exact=True)
    for lesion in COMBINED:
        policy = load_policy(trained, seed=1)
        found = values_of(released, seed=1, lesion=lesion, **NONE)
        assert_same(found, evaluated(trained, policy, RELEASED_LESIONS[lesion]))
        policy = retrained_by_hand(trained, 1, RELEASED_LESIONS[lesion])
        found = values_of(released, seed=1, lesion=lesion, **OUTPUT)
        assert_same(found, evaluated(trained, policy, RELEASED_LESIONS[lesion]))
        changed = (released["value"] != results["value"])[
            (results["metric"] == "effort") & (results["lesion"] == lesion)
        ]
        assert changed.groupby(results["protocol"]).any().all()


def test_the_profile_is_the_runs_unless_another_is_wanted(bptt_run, results):
    with_config(bptt_run, profile="released", bptt={"penalty": "weights", "penalty_coefficient": 0.001})
    own = run_study(bptt_run, only=0, lesions=(COMBINED[0],))
    by_paper = run_study(bptt_run, only=0, lesions=(COMBINED[0],), profile="paper")
    state = {"seed": 0, "lesion": COMBINED[0], **OUTPUT}
    assert_same(values_of(by_paper, **state), values_of(results, **state))
    policy = retrained_by_hand(bptt_run, 0, RELEASED_LESIONS[COMBINED[0]])
    assert_same(values_of(own, **state), evaluated(bptt_run, policy, RELEASED_LESIONS[COMBINED[0]]))


def test_the_epoch_uses_the_loss_and_the_settings_of_the_run(bptt_run, results):
    with_config(bptt_run, bptt={"penalty": "activity", "penalty_coefficient": 0.5, "learning_rate": 0.01})
    found = run_study(bptt_run, only=0, lesions=("callosum",))
    policy = retrained_by_hand(bptt_run, 0, LESIONS["callosum"])
    state = {"seed": 0, "lesion": "callosum", **OUTPUT}
    assert_same(values_of(found, **state), evaluated(bptt_run, policy, "callosum"))
    assert values_of(found, **state)["effort"] != values_of(results, **state)["effort"]


def test_an_unknown_profile_is_refused(trained):
    with pytest.raises(UserError, match="'code'; choose from paper, released"):
        study_of(trained, profile="code")


# Runs of reinforcement learning


@pytest.mark.parametrize("profile", [None, "released"])
def test_a_reinforced_run_is_retrained_by_the_papers_loss(run, profile):
    results = run_study(run, lesions=("callosum",), profile=profile, retraining_trials=128)
    assert set(results["algo"]) == {"ppo"}
    assert set(results["seed"]) == {0}
    assert_same(values_of(results, lesion="callosum", **NONE), evaluated(run, load_policy(run), "callosum"))
    policy = retrained_by_hand(run, 0, LESIONS["callosum"], 128)
    assert_same(values_of(results, lesion="callosum", **OUTPUT), evaluated(run, policy, "callosum"))


def test_networks_are_retrained_with_noise_delay_and_losses_of_their_own(run):
    with_config(run, trial={"vision_noise": 0.01, "motor_noise": 0.05, "vision_delay": 2})
    results = run_study(run, lesions=("callosum",), retraining_trials=128, trials=2)
    policy = retrained_by_hand(run, 0, LESIONS["callosum"], 128)
    assert_same(values_of(results, lesion="callosum", **OUTPUT), evaluated(run, policy, "callosum", trials=2))


# What goes wrong


def test_a_network_that_retraining_breaks_has_no_values_and_harms_no_other(trained, results, monkeypatch):
    real, variables = Retraining.run, Layout(build_network(trained.config())).variables
    (bias,) = [variable.offset for variable in variables if variable.name == "output.bias"]

    def breaking(self, weights, seeds, lesions, *rest):
        after = real(self, weights, seeds, lesions, *rest)
        for row, seed, lesion in zip(after, seeds, lesions, strict=True):
            if (seed, lesion) == (1, LESIONS["shallow_dominant"]):
                row[bias] = float("nan")
        return after

    monkeypatch.setattr(Retraining, "run", breaking)
    found = run_study(trained, lesions=("shallow_dominant", "callosum"))
    broken = (found["seed"] == 1) & (found["lesion"] == "shallow_dominant") & (found["protocol"] != "none")
    assert found["value"][broken].isna().all()
    expected = results[results["lesion"].isin(["intact", "shallow_dominant", "callosum"])].reset_index(drop=True)
    pd.testing.assert_frame_equal(found[~broken], expected[~broken], check_exact=True)


def test_an_epoch_that_blows_up_brings_no_values(bptt_run):
    with_config(bptt_run, bptt={"learning_rate": 1e39})
    results = run_study(bptt_run, lesions=("callosum",), trials=2)
    assert results["value"][results["protocol"] != "none"].isna().all()
    assert results["value"][(results["protocol"] == "none") & (results["metric"] == "effort")].notna().all()


def test_a_seed_that_the_run_has_not_is_refused(trained):
    with pytest.raises(UserError, match="no seed 3; it has seeds 0 to 2"):
        study_of(trained, only=3)


def test_an_epoch_of_less_than_a_batch_is_refused(trained):
    with pytest.raises(UserError, match="15 trials is less than one batch of 16"):
        study_of(trained, retraining_trials=15)


def test_a_network_of_one_side_has_one_state(tmp_path, small_bptt):
    config = small_bptt("uni_dl", seeds=1)
    folder = RunFolder.create(tmp_path, config)
    torch.manual_seed(0)
    states = {name: tensor[None] for name, tensor in build_network(config).state_dict().items()}
    folder.save_weights("final", {"seeds": torch.tensor([0]), **states})
    results = run_study(folder, trials=2)
    assert set(results["lesion"]) == {"intact"}
    assert set(results["protocol"]) == {"none", "output", "everything"}
