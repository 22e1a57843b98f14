"""Networks and policies out of run folders: any seed of any run, whatever trained it."""

import shutil

import numpy as np
import pytest
import torch

from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.config.parse import merge
from bilateral_rl.config.resolve import resolve
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import (
    build_network,
    build_policy,
    initial_states,
    load_policies,
    load_policy,
    network_states,
    parse_run,
    stack_states,
)

OBSERVATION = np.random.default_rng(0).normal(size=(32, 16)).astype(np.float32)


def with_values(config, **values):
    return resolve(None, None, [merge(config.to_values(), values)])


def action_of(policy):
    return policy.predict(OBSERVATION, deterministic=True)[0]


def stored_action(folder, seed, weights="final"):
    """What the stored network of the seed does, without the policy around it."""
    config, tensors = folder.config(), folder.load_weights(weights)
    if "seeds" in tensors:
        index = tensors.pop("seeds").tolist().index(seed)
        state = {name: tensor[index] for name, tensor in tensors.items()}
    else:
        prefix = "mlp_extractor.actor."
        state = {name[len(prefix) :]: tensor for name, tensor in tensors.items() if name.startswith(prefix)}
    network = build_network(config)
    network.load_state_dict(state)
    with torch.no_grad():
        return 2 * network.excitation(torch.from_numpy(OBSERVATION)).numpy() - 1


# Names of runs


def test_a_run_is_named_with_or_without_a_seed(run):
    assert parse_run(str(run.path)) == (run, None)
    assert parse_run(f"{run.path}:0") == (run, 0)
    assert parse_run(f"{run.path}:12") == (run, 12)
    assert parse_run(f"{run.path}/:3") == (RunFolder(run.path), 3)


def test_a_folder_may_have_a_colon_in_its_name(run, tmp_path):
    for name in ("a:1", "a:b", ":7"):
        path = tmp_path / name
        shutil.copytree(run.path, path)
        assert parse_run(str(path)) == (RunFolder(path), None)
        assert parse_run(f"{path}:2") == (RunFolder(path), 2)


def test_the_folder_that_is_there_wins_over_a_seed(run, tmp_path):
    for name in ("a", "a:1"):
        shutil.copytree(run.path, tmp_path / name)
    assert parse_run(str(tmp_path / "a:1")) == (RunFolder(tmp_path / "a:1"), None)
    assert parse_run(str(tmp_path / "a:2")) == (RunFolder(tmp_path / "a"), 2)


def test_what_is_no_run_is_refused(run):
    for ending in ("x", ":x", ":", ":-1", ":1.5", ":1:2", "x:1"):
        with pytest.raises(UserError, match="no run"):
            parse_run(f"{run.path}{ending}")


# Policies


def test_seeds_count_from_the_first_one(small, small_bptt):
    assert small_bptt(seed=5, seeds=3).all_seeds == [5, 6, 7]
    assert with_values(small, seed=5).all_seeds == [5]


def test_the_policy_of_a_reinforced_run_acts_as_its_network(run):
    for weights in ("final", "best"):
        (policy,) = load_policies(run, weights).values()
        np.testing.assert_allclose(action_of(policy), stored_action(run, 0, weights), atol=1e-6)
        assert load_policies(run).keys() == load_policies(run, seed=0).keys() == {0}


def test_the_policies_of_a_supervised_run_act_as_its_networks(bptt_run):
    for weights in ("final", "best"):
        policies = load_policies(bptt_run, weights)
        assert list(policies) == [0, 1, 2]
        for seed, policy in policies.items():
            np.testing.assert_allclose(action_of(policy), stored_action(bptt_run, seed, weights), atol=1e-6)
            np.testing.assert_array_equal(action_of(load_policy(bptt_run, weights, seed)), action_of(policy))
            assert list(load_policies(bptt_run, weights, seed)) == [seed]
        actions = [action_of(policy) for policy in policies.values()]
        assert not np.array_equal(actions[0], actions[1])
        assert not np.array_equal(action_of(policies[0]), action_of(load_policies(bptt_run, "final")[1]))


def test_final_and_best_weights_act_differently(bptt_run):
    first, second = (action_of(load_policy(bptt_run, weights, 0)) for weights in ("final", "best"))
    assert not np.array_equal(first, second)


def test_policies_can_be_loaded_by_what_commands_call_them(run, bptt_run):
    np.testing.assert_array_equal(action_of(load_policy(str(run.path))), action_of(load_policy(run)))
    named = load_policy(f"{bptt_run.path}:2")
    np.testing.assert_array_equal(action_of(named), action_of(load_policy(bptt_run, seed=2)))
    np.testing.assert_array_equal(action_of(load_policy(bptt_run.path, seed=2)), action_of(named))


def test_a_run_of_several_seeds_needs_a_choice(bptt_run):
    with pytest.raises(UserError, match=r"has seeds 0 to 2: say which one, as .*cc_s-bptt-1:0"):
        load_policy(bptt_run)


def test_a_seed_that_a_run_has_not_is_refused(run, bptt_run):
    for folder, has in ((run, "seed 0"), (bptt_run, "seeds 0 to 2")):
        for load in (load_policy, load_policies):
            with pytest.raises(UserError, match=f"has no seed 3; it has {has}"):
                load(folder, seed=3)


def test_policies_of_a_stored_stack_are_those_of_its_networks(tmp_path, small_bptt):
    for model in MODELS:
        config = small_bptt(model=model, seed=6)
        folder = RunFolder.create(tmp_path, config)
        networks = {seed: build_network(config) for seed in config.all_seeds}
        folder.save_weights("final", stack_states({seed: net.state_dict() for seed, net in networks.items()}))
        for seed, policy in load_policies(folder).items():
            with torch.no_grad():
                expected = 2 * networks[seed].excitation(torch.from_numpy(OBSERVATION)).numpy() - 1
            np.testing.assert_allclose(action_of(policy), expected, atol=1e-6)


def test_loaded_networks_are_of_their_own_memory(bptt_run):
    first, second = network_states(bptt_run), network_states(bptt_run)
    first[0]["output.bias"].fill_(5.0)
    assert not second[0]["output.bias"].eq(5.0).any()
    assert not first[1]["output.bias"].eq(5.0).any()


# Weights that are none


def without(name):
    return lambda tensors: {key: tensor for key, tensor in tensors.items() if key != name}


MISFITS = [
    lambda tensors: tensors | {"seeds": torch.tensor([1, 2, 3])},  # of other seeds
    lambda tensors: tensors | {"seeds": torch.tensor([0, 2, 1])},  # in another order
    lambda tensors: {name: tensor[:2] for name, tensor in tensors.items()},  # of fewer seeds
    without("seeds"),  # without seeds
    lambda tensors: tensors | {"output.bias": tensors["output.bias"][:2]},  # of a seed less in one
    lambda tensors: tensors | {"output.bias": torch.tensor(1.0)},  # of no seed in one
    without("output.bias"),  # without a parameter
    lambda tensors: tensors | {"other": torch.zeros(3, 1)},  # with another parameter
    lambda tensors: tensors | {"output.bias": torch.zeros(3, 7)},  # of another shape
    lambda tensors: tensors | {"output.bias": tensors["output.bias"] * torch.nan},  # not a number
    lambda tensors: tensors | {"output.bias": tensors["output.bias"] + torch.inf},  # infinite
]


def test_stacked_weights_that_do_not_fit_their_run_are_refused(bptt_run, small_bptt):
    sound = bptt_run.load_weights("final")
    for misfit in MISFITS:
        bptt_run.save_weights("final", misfit(sound))
        for load in (load_policies, network_states, lambda f: initial_states(small_bptt(init_from=str(f.path)))):
            with pytest.raises(UserError, match=r"cc_s-bptt-1"):
                load(bptt_run)


def test_a_stack_says_which_seeds_it_should_have(bptt_run):
    bptt_run.save_weights("final", bptt_run.load_weights("final") | {"seeds": torch.tensor([1, 2, 3])})
    with pytest.raises(UserError, match="not those of its seeds, seeds 0 to 2"):
        load_policies(bptt_run)


def test_damaged_and_missing_weights_are_refused(run, bptt_run):
    """With more damages: ``test_fuzz_loaders.py``."""
    for folder in (run, bptt_run):
        path = folder.path / "weights" / "final.safetensors"
        path.write_bytes(path.read_bytes()[:-100])
        for says in ("is damaged", "does not exist"):
            for load in (load_policies, network_states):
                with pytest.raises(UserError, match=rf"final\.safetensors {says}"):
                    load(folder)
            path.unlink(missing_ok=True)


def test_weights_of_another_network_than_the_runs_are_refused(run, bptt_run):
    for folder in (run, bptt_run):
        config = folder.config()
        for values in ({"network": {"units": 12}}, {"network": {"layers": 3}}, {"model": "uni_b"}):
            folder.write_config(with_values(config, **values))
            for load in (load_policies, network_states):
                with pytest.raises(UserError, match="do not fit its configuration"):
                    load(folder)


def test_weights_of_other_seeds_than_the_configurations_are_refused(bptt_run):
    config = bptt_run.config()
    for values in ({"seeds": 2}, {"seeds": 4}, {"seed": 1}):
        bptt_run.write_config(with_values(config, **values))
        for load in (load_policies, network_states):
            with pytest.raises(UserError, match="not those of its seeds"):
                load(bptt_run)


@pytest.mark.parametrize(("fixture", "other"), [("run", "bptt_run"), ("bptt_run", "run")])
def test_weights_of_another_algorithm_are_refused(request, fixture, other):
    folder, source = request.getfixturevalue(fixture), request.getfixturevalue(other)
    shutil.copy(source.path / "weights" / "final.safetensors", folder.path / "weights" / "final.safetensors")
    for load in (load_policies, network_states):
        with pytest.raises(UserError):
            load(folder)


# What a training begins with


def test_without_a_run_to_begin_with_there_is_nothing(small, small_bptt):
    assert initial_states(small) is None
    assert initial_states(small_bptt()) is None


def test_networks_and_policies_have_the_noise_of_their_run(small, small_bptt):
    for config in (small, small_bptt()):
        assert build_network(config).noise.std == build_policy(config).motor_network.noise.std == 0
        noisy = with_values(config, network={"hidden_noise": 0.1})
        assert build_network(noisy).noise.std == build_policy(noisy).motor_network.noise.std == 0.1


def test_both_kinds_of_runs_hold_networks_of_one_kind(run, bptt_run):
    (reinforced,), supervised = network_states(run).values(), network_states(bptt_run)
    assert list(supervised) == [0, 1, 2]
    for state in supervised.values():
        assert {name: t.shape for name, t in state.items()} == {name: t.shape for name, t in reinforced.items()}
    policy = build_policy(run.config())
    policy.motor_network.load_state_dict(supervised[0])
