"""Reinforcement learning of two arms from start to end: what its folder holds, and that stopping changes nothing."""

import numpy as np
import pandas as pd
import pytest
import torch
from rl_runs import ALGORITHMS, curves, differences, evaluations, small_rl
from supervised_runs import Watch, with_values

import bilateral_rl as brl
from bilateral_rl.analysis.modulation import TAGS_OF
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import initial_states, load_policy
from bilateral_rl.training.run import resume, train

FEW = {"trials": 4, "seed": 3}
COMBINATIONS = {"ppo": {"trained_combination": True}, "sac": {"ipsilateral_share": 0.0}, "a2c": {}, "td3": {}}
"""What each algorithm's network has; the usual share is fixed."""


OFF_POLICY = {"learning_starts": 160, "gradient_steps": 1}
FASTER = {"sac": {"sac": OFF_POLICY}, "td3": {"td3": OFF_POLICY | {"critic_warm_up": 5}}}


def small_pair(algo):
    network, short = {"units": 8} | COMBINATIONS[algo], {"trial_length": 10}
    return small_rl(algo, "two_reaches", timesteps=480, network=network, trial=short, **FASTER.get(algo, {}))


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """By algorithm, a small training of both arms in one go."""
    out = tmp_path_factory.mktemp("two_arms")
    return {algo: train(small_pair(algo), out) for algo in ALGORITHMS}


def observations():
    return np.random.default_rng(0).uniform(-0.5, 0.5, (3, 40)).astype(np.float32)


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_a_training_that_is_stopped_ends_with_the_bits_of_one_in_one_go(trained, tmp_path, algo):
    config = small_pair(algo)
    stopped = train(config, tmp_path, Watch(stop_at=200))
    assert 0 < stopped.done < config.timesteps
    outcome = resume(RunFolder(stopped.folder.path), config)
    assert differences(outcome.folder, trained[algo].folder) == []


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_a_run_acts_from_its_folder_and_from_an_exported_one(trained, tmp_path, algo):
    outcome = trained[algo]
    expected, _ = outcome.policies[0].predict(observations(), deterministic=True)
    network = load_policy(outcome.folder).motor_network
    assert (network.n_arms, network.n_outputs, network.trained_combination) == (2, 12, algo == "ppo")
    made = brl.load(outcome.folder.path).export(tmp_path / "made", **FEW)
    if not network.noise.std:  # which acts anew each time
        for folder in (outcome.folder, made.folder):
            actions, _ = load_policy(folder).predict(observations(), deterministic=True)
            np.testing.assert_array_equal(actions, expected)
    pd.testing.assert_frame_equal(made.evaluate(**FEW), brl.load(outcome.folder.path).evaluate(**FEW))
    text = " ".join((made.path / "README.md").read_text(encoding="utf-8").split())
    assert "two planar arms, each of two joints and six muscles" in text
    assert '"two_reaches", seed=0' in text


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_evaluations_say_what_each_side_supplies_to_each_arm(trained, algo):
    row, shown = evaluations(trained[algo].folder)[-1], curves(trained[algo].folder)
    for name, tag in TAGS_OF[2].items():
        assert shown[tag][-1][1] == pytest.approx(float(row[name]), rel=1e-4)
    for arm in ("dominant", "non_dominant"):
        shares = [float(row[f"contribution_percent_{arm}_arm_{side}"]) for side in ("dominant", "non_dominant")]
        assert sum(shares) == pytest.approx(100, rel=1e-4)
        if algo == "sac":  # without a path to the arm of its own side
            assert sorted(shares) == [0, 100]
    logged = {name.removeprefix("combination/") for name in shown if name.startswith("combination/")}
    weights = load_policy(trained[algo].folder).motor_network.combination_weights()
    assert logged == ({*weights} if algo == "ppo" else set()), "what is fixed is no news"


def test_evaluations_tell_of_each_hand_by_its_role(trained):
    folder = trained["ppo"].folder
    row, shown = evaluations(folder)[-1], curves(folder)
    errors = [float(row[f"final_error_cm_of_{hand}_reach"]) for hand in ("dominant", "non_dominant")]
    assert sum(errors) / 2 == pytest.approx(float(row["final_error_cm"]), rel=1e-4)
    assert errors[0] != errors[1]
    assert shown["evaluation/final_error_cm_of_dominant_reach"][-1][1] == pytest.approx(errors[0], rel=1e-4)


def test_a_training_begins_with_a_network_of_as_many_arms_and_the_same_share(trained):
    folder = trained["a2c"].folder
    begun = initial_states(with_values(small_pair("td3"), init_from=str(folder.path)))
    expected = load_policy(folder).motor_network.state_dict()
    assert all(torch.equal(value, begun[0][name]) for name, value in expected.items())
    for config, message in (
        (small_pair("ppo"), r"for two arms, ipsilateral share 0\.15, and .* share 0\.15 at first: --init-from needs"),
        (small_pair("sac"), r"share 0\.15, and .* share 0: --init-from needs the same"),
        (small_rl("a2c", network={"units": 8}), r"for two arms.*, and .* 8 units in 2 layers: --init-from needs"),
    ):
        with pytest.raises(UserError, match=message):
            initial_states(with_values(config, init_from=str(folder.path)))
