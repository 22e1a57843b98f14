"""Groups of a network's parameters that do not learn: they stay bit for bit, and the others go on learning."""

import numpy as np
import pytest
import torch
from hemispheric_models import ALGORITHMS, arm, changed, make_model, names_by_group, weights
from rl_runs import small_rl
from supervised_runs import Watch, with_values

from bilateral_rl.config.resolve import resolve
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies import make_network
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import build_network, build_policy, network_states, stack_states
from bilateral_rl.training import evaluation
from bilateral_rl.training.run import resume, train
from bilateral_rl.vocabulary import GROUPS

pytestmark = pytest.mark.usefixtures("no_pictures")

TINY_RL = {"timesteps": 640, "evaluation": {"every": 10**6, "checkpoint_every": 10**6, "trials": 2}}


@pytest.fixture(autouse=True)
def no_rl_pictures(monkeypatch):
    monkeypatch.setattr(evaluation, "hand_paths", lambda *_: None)


@pytest.fixture
def odd_run(make_run):
    """A run whose network has a combination weight that every projection would change."""
    folder = make_run()
    (state,) = network_states(folder).values()
    state["combination_dominant"] = torch.tensor(-0.25)
    folder.save_weights("final", stack_states({0: state}))
    return folder


def moved_groups(before, after, config):
    network = build_network(config)
    return {network.group_of(name) for name, tensor in after.items() if not torch.equal(tensor, before[name])}


def names_of_network(model):
    """What a model's policy calls the parameters of its network."""
    network = {id(p) for p in model.policy.motor_network.parameters()}
    return {name for name, p in model.policy.named_parameters() if id(p) in network}


@pytest.mark.parametrize(
    ("algo", "frozen"),
    [
        ("bptt", ["dominant"]),
        ("bptt", ["non_dominant", "shared"]),
        ("ppo", ["non_dominant", "shared"]),
        ("a2c", ["dominant"]),
        ("sac", ["dominant", "shared"]),
        ("td3", ["non_dominant"]),
    ],
)
def test_frozen_groups_stay_to_the_bit_and_the_others_learn(algo, frozen, odd_run, small_bptt, tmp_path):
    chosen = {"frozen": frozen, "init_from": str(odd_run.path)}
    if algo == "bptt":
        config = small_bptt(seeds=1, **chosen)
    else:
        config = small_rl(algo, **TINY_RL, **chosen, **{algo: {"weight_penalty": 0.1}})
    folder = train(config, tmp_path).folder
    before, after = network_states(odd_run)[0], network_states(folder)[0]
    assert moved_groups(before, after, config) == {*GROUPS} - {*frozen}
    assert RunFolder(folder.path).config().frozen == tuple(frozen)
    if algo == "td3":
        policy = build_policy(config)
        policy.load_state_dict(folder.load_weights("final"))
        target = policy.actor_target.network.state_dict()
        assert moved_groups(before, target, config) == {*GROUPS} - {*frozen}, "the target follows the network"


@pytest.mark.parametrize("algo", ["bptt", "sac"])
def test_a_training_that_goes_on_keeps_them_frozen(algo, small_bptt, tmp_path):
    frozen = {"frozen": ["non_dominant"]}
    whole = small_bptt(**frozen) if algo == "bptt" else small_rl(algo, **TINY_RL, **frozen)
    half = with_values(whole, **({"epochs": 1} if algo == "bptt" else {"timesteps": 320}))
    first = train(half, tmp_path).folder
    before = network_states(first)
    outcome = resume(first, whole)
    after = network_states(outcome.folder)
    for seed in before:
        assert moved_groups(before[seed], after[seed], whole) == {"dominant", "shared"}


def test_a_stopped_training_with_a_frozen_side_ends_with_the_same_bits(small_bptt, assert_same_end, tmp_path):
    config = small_bptt(frozen=["dominant"])
    whole = train(config, tmp_path / "whole").folder
    stopped = train(config, tmp_path / "stopped", Watch(stop_at=3))
    assert stopped.interrupted
    assert_same_end(whole, resume(stopped.folder, config).folder)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_critics_and_exploration_learn_while_the_network_is_frozen(algorithm):
    model = make_model(algorithm, frozen=["non_dominant", "shared"])
    before, groups = weights(model), names_by_group(model)
    network = names_of_network(model)
    model.learn(160)
    learned = changed(model, before)
    assert {*groups["critic_0"]} <= learned
    assert learned & network == {*groups["dominant"]} & network
    if "log_std" in before:
        assert "log_std" in learned


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_saved_model_keeps_its_frozen_groups_and_load_may_choose_others(algorithm, tmp_path):
    make_model(algorithm, frozen="dominant").save(tmp_path / "model")
    kept = algorithm.load(tmp_path / "model", env=arm())
    assert kept.frozen == ("dominant",)
    other = algorithm.load(tmp_path / "model", env=arm(), frozen=("shared",))
    before, groups = weights(other), names_by_group(other)
    other.learn(160)
    assert {*groups["dominant"]} <= changed(other, before)
    assert not changed(other, before) & names_of_network(other) & {*groups["shared"]}
    other.frozen = ()
    with pytest.raises(ValueError, match="setting frozen afterwards"):
        other.learn(160)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"model": "uni_b", "frozen": ["shared"]}, "frozen names sides, which the model uni_b has not"),
        ({"frozen": [*GROUPS]}, "frozen leaves nothing to learn: give two of dominant, non_dominant, shared at most"),
        ({"frozen": ["left"]}, "frozen"),
        ({"frozen": ["dominant", "dominant"]}, "must name each group once"),
    ],
)
def test_what_cannot_be_frozen_is_refused(settings, message):
    for algo in ("ppo", "bptt"):
        with pytest.raises(UserError, match=message):
            resolve(algo, None, [settings])


def test_algorithms_refuse_what_cannot_be_frozen():
    algorithm = ALGORITHMS[0]
    for policy, frozen, message in (
        ("CallosalPolicy", ["left"], "parameter groups, dominant, non_dominant, shared, not 'left'"),
        ("CallosalPolicy", 3, "not 3"),
        ("CallosalPolicy", GROUPS, "nothing of a callosal network to learn"),
        ("UnilateralPolicy", ["dominant"], "frozen names dominant, and a unilateral network has no such parameters"),
        ("UnilateralPolicy", ["shared"], "nothing of a unilateral network to learn"),
    ):
        with pytest.raises(ValueError, match=message):
            make_model(algorithm, policy, frozen=frozen)


def test_one_group_may_be_given_as_a_word():
    assert resolve("bptt", None, [{"frozen": "shared"}]).frozen == ("shared",)


def test_a_frozen_weight_is_not_projected():
    network = make_network("bilateral", 16, 6)
    with torch.no_grad():
        network.combination_dominant.fill_(-1.0)
        network.combination_non_dominant.fill_(-1.0)
    network.combination_dominant.requires_grad_(False)
    network.constrain()
    np.testing.assert_array_equal([*network.combination_weights().values()], [-1.0, 0.0])
