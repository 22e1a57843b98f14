"""Where supervised and reinforced trainings begin: with fresh networks or those of other runs."""

import dataclasses
import shutil
import signal

import numpy as np
import pytest
import torch
from supervised_runs import Watch, with_values

from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.policies import build_network, build_policy, network_states
from bilateral_rl.training.callbacks import Stopped
from bilateral_rl.training.run import resume, train

pytestmark = pytest.mark.usefixtures("no_pictures")


def beginning(config, out):
    """The networks by seed before any update."""
    outcome = train(config, out, Watch(stop_at=1))
    assert outcome.interrupted
    return network_states(outcome.folder)


@pytest.fixture
def before_learning(monkeypatch, tmp_path):
    """The policy of a PPO training before any update."""

    def look(config):
        def stop(*_args, **_kwargs):
            signal.raise_signal(signal.SIGINT)
            raise Stopped

        with monkeypatch.context() as patch:
            patch.setattr("bilateral_rl.algorithms.HemisphericPPO.collect_rollouts", stop)
            return train(config, tmp_path / "before").policies[config.seed]

    return look


def test_every_seed_can_begin_with_a_reinforced_network(tmp_path, run, small_bptt, same_bits):
    source = network_states(run)[0]
    for named in (str(run.path), f"{run.path}:0"):
        states = beginning(small_bptt(seed=5, init_from=named), tmp_path)
        assert list(states) == [5, 6]
        assert all(same_bits(state, source) for state in states.values())


def test_seeds_begin_with_the_seeds_of_their_number_or_with_the_one_named(tmp_path, bptt_run, small_bptt, same_bits):
    source = network_states(bptt_run)
    states = beginning(small_bptt(seed=1, init_from=str(bptt_run.path)), tmp_path)
    assert all(same_bits(states[seed], source[seed]) for seed in (1, 2))
    states = beginning(small_bptt(seed=1, init_from=f"{bptt_run.path}:2"), tmp_path)
    assert all(same_bits(states[seed], source[2]) for seed in (1, 2))


def test_another_model_of_the_same_architecture_may_be_begun_with(tmp_path, bptt_run, small_bptt, same_bits):
    states = beginning(small_bptt(model="cc_ns", task="hold_position", init_from=str(bptt_run.path)), tmp_path)
    assert same_bits(states[1], network_states(bptt_run)[1])


def test_reinforcement_begins_with_the_action_of_the_supervised_network(bptt_run, small, before_learning):
    observation, network = torch.randn(64, 16), build_network(bptt_run.config())
    for seed, named, expected in ((1, "", 1), (1, ":2", 2), (9, ":0", 0)):
        policy = before_learning(with_values(small, seed=seed, init_from=f"{bptt_run.path}{named}"))
        network.load_state_dict(network_states(bptt_run)[expected])
        with torch.no_grad():
            excitation = network.excitation(observation)
        action, _ = policy.predict(observation.numpy(), deterministic=True)
        np.testing.assert_allclose((action + 1) / 2, excitation, atol=1e-6)


def test_reinforcement_goes_on_from_a_supervised_network(tmp_path, bptt_run, small):
    config = with_values(small, timesteps=1_000, init_from=str(bptt_run.path))
    with pytest.raises(UserError, match=r"no run"):
        train(dataclasses.replace(config, init_from=f"{bptt_run.path}x"), tmp_path)
    outcome = train(config, tmp_path)
    assert outcome.folder.config().init_from == str(bptt_run.path)
    assert network_states(outcome.folder).keys() == {0}


def test_the_run_begun_with_is_not_needed_to_resume(tmp_path, bptt_run, small_bptt, assert_same_end):
    config = small_bptt(seeds=3, init_from=str(bptt_run.path))
    whole = train(config, tmp_path).folder
    folder = train(config, tmp_path, Watch(3)).folder
    shutil.rmtree(bptt_run.path)
    resume(folder, folder.config())
    assert_same_end(folder, whole)


UNFIT = [
    ({"seed": 7}, "{}", r"has seeds 0 to 2, not 7: name one, as .*cc_s-bptt-1:0"),
    ({}, "{}:3", r"has no seed 3; it has seeds 0 to 2"),
    ({"model": "bi_s"}, "{}", r"callosal.*bilateral"),
    ({"model": "uni_b"}, "{}:0", r"callosal.*unilateral"),
    ({"network": {"units": 12}}, "{}", r"10 units in 2 layers.*12 units in 2 layers"),
    ({"network": {"layers": 3}}, "{}", r"10 units in 2 layers.*10 units in 3 layers"),
    ({}, "{}-no", r"no run"),
    ({}, "{}/weights", r"config\.yaml"),
]
SEEDS_UNFIT = ({"seed": 1, "seeds": 3}, "{}", r"has seeds 0 to 2, not 3: name one, as .*cc_s-bptt-1:0")


@pytest.mark.parametrize("algo", ["ppo", "bptt"])
def test_what_cannot_be_begun_with_is_refused_and_leaves_nothing(tmp_path, bptt_run, small, small_bptt, algo):
    for values, named, says in UNFIT if algo == "ppo" else (*UNFIT, SEEDS_UNFIT):
        beginning = {**values, "init_from": named.format(bptt_run.path)}
        config = with_values(small, **beginning) if algo == "ppo" else small_bptt(**beginning)
        with pytest.raises(UserError, match=says):
            train(config, tmp_path / "new")
        assert not (tmp_path / "new").exists()


def test_a_damaged_network_is_not_begun_with(tmp_path, bptt_run, small_bptt):
    weights = bptt_run.load_weights("final")
    weights["output.bias"][2, 0] = torch.nan
    bptt_run.save_weights("final", weights)
    with pytest.raises(UserError, match=r"output\.bias"):
        train(small_bptt(init_from=f"{bptt_run.path}:0"), tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_a_policy_of_another_start_has_fresh_critics_only(bptt_run, small, before_learning, same_bits):
    config = with_values(small, init_from=f"{bptt_run.path}:1")
    own, fresh = (before_learning(c).state_dict() for c in (config, with_values(small)))
    differing = {name for name in own if not same_bits(own[name], fresh[name])}
    assert differing == {name for name in own if name.startswith("mlp_extractor.actor.")}
    assert set(build_policy(config).state_dict()) == set(own)
