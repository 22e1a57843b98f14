import dataclasses
import importlib
import importlib.resources
import itertools
import json
import re

import pytest
import torch
import yaml
from hypothesis import given
from hypothesis import strategies as st

from bilateral_rl.config.catalogue import ALGORITHMS, MODELS
from bilateral_rl.config.parse import merge, parse_overrides
from bilateral_rl.config.resolve import from_values, resolve, tuned_defaults
from bilateral_rl.config.schema import CONFIGS, BPTTConfig, PPOConfig
from bilateral_rl.envs import TASKS
from bilateral_rl.envs.task_specs import TASK_SPECS
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.yaml_files import read_settings
from bilateral_rl.policies import make_network


def test_every_algorithm_task_and_model_has_working_defaults():
    for algo in ALGORITHMS:
        for task, model in itertools.product(TASKS, MODELS):
            config = resolve(algo, task, model=model)
            assert (config.algo, config.task, config.model, config.spec) == (algo, task, model, MODELS[model])
            assert (config.seeds, config.all_seeds) == (1, [0])


def test_a_configuration_says_what_it_counts_and_up_to_where():
    rl, supervised = resolve("sac", None, [{"timesteps": 1e5, "seeds": 2}]), resolve("bptt", None, [{"epochs": 3}])
    assert (rl.total, rl.unit) == (200_000, "steps")
    assert (supervised.total, supervised.unit) == (300, "updates")


def test_seeds_and_threads_are_settings_of_every_algorithm():
    for algo, threads in (("ppo", 1), ("td3", 1), ("bptt", 0)):
        config = resolve(algo, None, [{"seed": 7, "seeds": 3}])
        assert (config.all_seeds, config.threads) == ([7, 8, 9], threads)
        assert resolve(algo, None, [{"threads": 2}]).threads == 2
        with pytest.raises(UserError, match=r"The last seed, .* at most 4,294,967,295"):
            resolve(algo, None, [{"seed": 2**32 - 2, "seeds": 3}])


def test_the_bare_command_trains_the_callosal_specialized_model_to_reach_with_ppo():
    config = resolve(None, None)
    assert (config.algo, config.task, config.model) == ("ppo", "random_reach", "cc_s")


def test_later_layers_win_over_earlier_ones_and_over_the_tuned_defaults():
    tuned = tuned_defaults("ppo", "random_reach")
    config = resolve(None, None, [{"ppo": {"gamma": 0.5, "n_epochs": 3}}, {"ppo": {"gamma": 0.6}}])
    assert (config.ppo.gamma, config.ppo.n_epochs) == (0.6, 3)
    assert config.ppo.learning_rate == tuned.get("ppo", {}).get("learning_rate", PPOConfig().ppo.learning_rate)


def test_tuned_defaults_name_only_settings_that_exist():
    for algo in ALGORITHMS:
        for task in TASKS:
            from_values({"algo": algo} | tuned_defaults(algo, task))


def test_tuned_defaults_are_for_algorithms_and_tasks_that_exist():
    table = yaml.safe_load(importlib.resources.files("bilateral_rl.config").joinpath("defaults.yaml").read_text())
    assert set(table) <= set(ALGORITHMS)
    for algo, by_task in table.items():
        assert set(by_task) <= {"any_task", "two_arms", "in_field", "adapting", "quick", *TASKS}
        for values in by_task.values():
            assert not {"algo", "model", "task", "seed"} & set(values)
            assert set(values) <= {f.name for f in dataclasses.fields(CONFIGS[algo])}


def test_a_configuration_survives_yaml_and_json(tmp_path):
    for algo in ALGORITHMS:
        values = {"seeds": 3, "init_from": "a:1", "trial": {"threshold": 0.02, "arm": {"link_length": [0.3, 0.31]}}}
        values |= {"profile": "released", "bptt": {"epsilon": 1e-8, "penalty": "activity"}} if algo == "bptt" else {}
        config = resolve(algo, "hold_position", [values])
        for name, text in (("c.yaml", yaml.safe_dump(config.to_values())), ("c.json", json.dumps(config.to_values()))):
            (tmp_path / name).write_text(text)
            assert resolve(None, None, [read_settings(tmp_path / name)]) == config


def test_overrides_are_read_as_numbers_words_and_lists():
    values = parse_overrides(["ppo.gamma=0.9", "ppo.n_steps=25", "model=bi_s", "network.critic_arch=[32, 16]"])
    config = resolve(None, None, [values])
    assert (config.ppo.gamma, config.ppo.n_steps, config.model) == (0.9, 25, "bi_s")
    assert config.network.critic_arch == (32, 16)


def test_exponents_without_a_point_are_numbers():
    assert resolve(None, None, [parse_overrides(["ppo.learning_rate=1e-3", "timesteps=1e6"])]).timesteps == 1_000_000


def test_what_cannot_work_is_refused_in_one_sentence():
    for values, sentence in (
        ({"model": "cc"}, "Unknown model 'cc'; choose from uni_b, uni_dl"),
        ({"task": "reach"}, "Unknown task 'reach'; choose from random_reach"),
        ({"algo": "dqn"}, "Unknown algorithm 'dqn'; choose from ppo"),
        ({"modle": "cc_s"}, "Unknown setting 'modle' among the settings; choose from algo, model"),
        ({"ppo": {"lr": 1}}, "Unknown setting 'lr' in ppo; choose from learning_rate"),
        ({"trial": {"arm": {"mass": 1}}}, "Unknown setting 'mass' in trial.arm; choose from timestep, link_mass"),
        ({3: 4}, "Unknown setting 3 among the settings"),
        ({"ppo": 3}, "ppo must be settings by name, got 3."),
        ({"timesteps": 0}, "timesteps must be at least 1, got 0."),
        ({"timesteps": 1.5}, "timesteps must be a whole number, got 1.5."),
        ({"timesteps": True}, "timesteps must be a number, got True."),
        ({"timesteps": 10**16}, "timesteps must be at most 1,000,000,000,000,000, got 10,000"),
        ({"track": "yes"}, "track must be true or false, got 'yes'."),
        ({"track": 1}, "track must be true or false, got 1."),
        ({"init_from": 3}, "init_from must be a word, got 3."),
        ({"seed": -1}, "seed must be at least 0, got -1."),
        ({"seed": 2**32}, "seed must be at most 4,294,967,295, got 4,294,967,296."),
        ({"seeds": 0}, "seeds must be at least 1, got 0."),
        ({"threads": 0}, "threads must be at least 1, got 0."),
        ({"n_envs": 1, "ppo": {"n_steps": 1}}, "ppo.n_steps times n_envs must be at least 2"),
        ({"ppo": {"gamma": 1.5}}, "ppo.gamma must be at most 1, got 1.5."),
        ({"ppo": {"gamma": True}}, "ppo.gamma must be a number, got True."),
        ({"ppo": {"gamma": float("nan")}}, "ppo.gamma must be a finite number, got nan."),
        ({"ppo": {"gamma": "nan"}}, "ppo.gamma must be a finite number"),
        ({"ppo": {"learning_rate": "fast"}}, "ppo.learning_rate must be a finite number, got 'fast'."),
        ({"ppo": {"learning_rate": 10**400}}, "ppo.learning_rate must be a finite number"),
        ({"network": {"critic_arch": []}}, "network.critic_arch must be a list of at least 1 number, got []."),
        ({"network": {"critic_arch": 64}}, "network.critic_arch must be a list, got 64."),
        ({"network": {"critic_arch": [8, 0]}}, "network.critic_arch must be at least 1, got 0."),
        ({"trial": {"arm": {"link_length": [0.3]}}}, "trial.arm.link_length must be a list of 2 numbers, got [0.3]."),
        ({"trial": {"arm": {"link_length": [1, 2, 3]}}}, "trial.arm.link_length must be a list of at most 2 numbers"),
        ({"trial": {"arm": {"link_length": [1, -2]}}}, "trial.arm.link_length must be above 0, got -2."),
        ({"trial": {"arm": {"joint_lower_limit": [0, 3]}}}, "trial.arm.joint_lower_limit must be below joint_upper_"),
        ({"evaluation": {"trials": 0}}, "evaluation.trials must be at least 1, got 0."),
        ({"evaluation": {"seed": -1}}, "evaluation.seed must be at least 0, got -1."),
    ):
        with pytest.raises(UserError, match=f"^{re.escape(sentence)}"):
            resolve(None, None, [values])


def test_a_device_is_the_cpu_or_a_gpu_by_its_number():
    for device in ("tpu", "cuda:", "cuda:99x", "cuda:-1", "cudax", "cuda:1000", "CPU", ""):
        with pytest.raises(UserError, match=r"device must be cpu, cuda or, for one of several, cuda:0"):
            resolve(None, None, [{"device": device}])
        for good in ("cpu", "cuda", "cuda:7"):
            assert resolve(None, None, [{"device": good}]).device == good


def test_exactly_the_networks_that_cannot_be_built_are_refused():
    for model in ("uni_b", "bi_s", "cc_s"):
        for units, layers in itertools.product(range(-1, 7), range(-1, 4)):
            values = {"network": {"units": units, "layers": layers}}
            try:
                make_network(MODELS[model].architecture, 16, 6, units, layers)
            except ValueError:
                with pytest.raises(UserError, match=r"units|layers"):
                    resolve(None, None, [values], model=model)
            else:
                assert resolve(None, None, [values], model=model).network.units == units


TWO_ARMS = {
    "name": "both",
    "arms": {
        name: {"start": {"joints": [0.5, 1.0]}, "target": {"joints": [1.0, 1.2]}}
        for name in ("dominant", "non_dominant")
    },
}
"""An experiment of two arms."""


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_tasks_of_two_arms_have_twenty_units_and_twelve_muscles(algo):
    config = resolve(algo, None, [{"experiment": TWO_ARMS}])
    assert (config.n_arms, config.n_muscles, config.network.units) == (2, 12, 20)
    assert (config.network.ipsilateral_share, config.network.trained_combination) == (None, None)
    one = resolve(algo, None)
    assert (one.n_arms, one.n_muscles, one.network.units) == (1, 6, 10)


def test_weights_of_hemispheres_in_two_arms_are_taken_where_they_have_an_effect():
    both, share, trained = {"experiment": TWO_ARMS}, {"ipsilateral_share": 0.3}, {"trained_combination": True}
    for network in (share, trained, share | trained, {"ipsilateral_share": 0}):
        config = resolve("bptt", None, [both, {"network": network}])
        assert {name: getattr(config.network, name) for name in network} == network
        again = from_values(config.to_values())
        assert again.network == config.network
    for task, network, model, message in (
        ({}, share, "cc_s", "network.ipsilateral_share is for tasks of two arms, and random_reach has one"),
        ({}, {"trained_combination": False}, "cc_s", "network.trained_combination is for tasks of two arms"),
        (both, share, "uni_b", "network.ipsilateral_share has no effect on uni_b, which has no hemispheres"),
        (both, trained, "uni_dl", "network.trained_combination has no effect on uni_dl"),
        (both, trained | {"ipsilateral_share": 0.0}, "bi_s", "network.trained_combination has nothing to weigh"),
        (both, {"ipsilateral_share": 1.5}, "bi_s", "ipsilateral_share"),
        (both, {"trained_combination": "maybe"}, "bi_s", "trained_combination"),
    ):
        with pytest.raises(UserError, match=re.escape(message)):
            resolve(None, None, [task, {"network": network}], model=model)


def test_without_an_ipsilateral_path_nothing_is_shared_that_could_be_frozen():
    alone = {"experiment": TWO_ARMS, "network": {"ipsilateral_share": 0.0}}
    assert resolve("ppo", None, [alone | {"frozen": "dominant"}]).frozen == ("dominant",)
    for frozen, message in (
        (["shared"], r"frozen names shared, and nothing is where network\.ipsilateral_share is 0"),
        (["dominant", "non_dominant"], "frozen leaves nothing to learn: give one of dominant, non_dominant at most"),
    ):
        with pytest.raises(UserError, match=message):
            resolve("ppo", None, [alone | {"frozen": frozen}])


def test_reading_a_configuration_draws_no_random_numbers():
    before = torch.get_rng_state()
    resolve(None, None)
    assert torch.equal(torch.get_rng_state(), before)


def test_the_catalogue_describes_the_tasks_there_are():
    assert TASK_SPECS.keys() == TASKS.keys()


ON_POLICY = ("ppo", "a2c")
OFF_POLICY = ("sac", "td3")
BAD_HYPERPARAMETERS = [
    (("ppo", "a2c", "sac", "td3"), "learning_rate", (0, -1, "fast", float("inf"))),
    (("ppo", "a2c", "sac", "td3"), "final_learning_rate", (-0.1,)),
    (("ppo", "a2c", "sac", "td3"), "gamma", (-0.1, 1.01)),
    (("ppo", "a2c", "sac", "td3"), "weight_penalty", (-0.001,)),
    (("ppo", "a2c", "sac", "td3"), "reward_scale", (0, -1)),
    (("ppo", "a2c", "sac", "td3"), "critic_rate_factor", (0, -1, 10**6)),
    (("ppo", "a2c", "sac", "td3"), "network_epsilon", (0, -1)),
    (("ppo", "a2c", "sac", "td3"), "action_traces", ([0.5, 1.0], [-0.1], [float("nan")], 0.5, [0.5] * 9)),
    (ON_POLICY, "n_steps", (0, 2.5)),
    (ON_POLICY, "gae_lambda", (-0.1, 1.1)),
    (ON_POLICY, "ent_coef", (-0.1,)),
    (ON_POLICY, "final_ent_coef", (-0.1,)),
    (ON_POLICY, "vf_coef", (-0.1,)),
    (ON_POLICY, "max_grad_norm", (0,)),
    (("ppo",), "batch_size", (0, 1)),
    (("ppo",), "n_epochs", (0,)),
    (("ppo",), "clip_range", (0,)),
    (("a2c",), "normalize_advantage", (3, "yes")),
    (("a2c",), "use_rms_prop", (3,)),
    (OFF_POLICY, "buffer_size", (0, 10**12)),
    (OFF_POLICY, "learning_starts", (-1,)),
    (OFF_POLICY, "batch_size", (0, 1, 10**12)),
    (OFF_POLICY, "tau", (0, 1.1)),
    (OFF_POLICY, "train_freq", (0, 0.5)),
    (OFF_POLICY, "gradient_steps", (0, -1)),
    (OFF_POLICY, "n_critics", (0, 11)),
    (OFF_POLICY, "critic_warm_up", (-1,)),
    (OFF_POLICY, "policy_delay", (0, 1.5)),
    (OFF_POLICY, "standardize_inputs", (1, "yes")),
    (OFF_POLICY, "actor_value", ("max", 1)),
    (OFF_POLICY, "normalize_streams", (1, None)),
    (("sac",), "ent_coef", (-0.1, "auto")),
    (("sac",), "initial_ent_coef", (0,)),
    (("sac",), "target_entropy", ("auto", float("nan"))),
    (("td3",), "action_noise", (-0.1,)),
    (("td3",), "target_policy_noise", (0,)),
    (("td3",), "target_noise_clip", (0,)),
]


def test_a_hyperparameter_that_cannot_work_is_refused_by_name():
    for algo in (*ON_POLICY, *OFF_POLICY):
        for algos, name, values in BAD_HYPERPARAMETERS:
            for value in values if algo in algos else ():
                with pytest.raises(UserError, match=rf"^(Unknown )?{algo}\.{name} (must be |.*choose from)"):
                    resolve(algo, None, [{algo: {name: value}}])


def test_every_hyperparameter_has_values_that_are_refused():
    covered = {(algo, name) for algos, name, _ in BAD_HYPERPARAMETERS for algo in algos}
    configs = {algo: resolve(algo, None) for algo in (*ON_POLICY, *OFF_POLICY)}
    fields = {(algo, f.name) for algo, c in configs.items() for f in dataclasses.fields(c.hyperparameters)}
    assert covered == fields


def test_the_settings_of_another_algorithm_are_refused():
    for algo in ALGORITHMS:
        for other in set(ALGORITHMS) - {algo}:
            with pytest.raises(UserError, match=f"{other} is a setting of another algorithm than {algo}"):
                resolve(algo, None, [{other: {}}])
        for name in ("timesteps", "n_envs", "track", "evaluation") if algo == "bptt" else ("epochs", "profile"):
            with pytest.raises(UserError, match=f"{name} is a setting of another algorithm than {algo}"):
                resolve(algo, None, [{name: 1}])


def test_an_override_of_another_form_is_refused():
    for item in ("gamma", "=3", ""):
        with pytest.raises(UserError, match="key=value"):
            parse_overrides([item])


def test_a_file_that_is_no_configuration_is_refused(tmp_path):
    for text in ("- 1\n- 2\n", "a: [1", "!!python/object/apply:os.getcwd []", "\x00"):
        (tmp_path / "c.yaml").write_text(text)
        with pytest.raises(UserError):
            read_settings(tmp_path / "c.yaml")


@given(st.dictionaries(st.sampled_from("abc"), st.integers()), st.dictionaries(st.sampled_from("abc"), st.integers()))
def test_merging_keeps_every_key_and_prefers_the_second(first, second):
    merged = merge({"x": first}, {"x": second})["x"]
    assert merged == {**first, **second}


def test_supervised_training_is_the_papers_by_default():
    config = resolve("bptt", None)
    settings = config.bptt
    assert isinstance(config, BPTTConfig)
    assert (config.epochs, config.seeds, config.profile) == (100, 1, "paper")
    assert (settings.trials, settings.batch_size, settings.validation_trials) == (6400, 64, 64)
    assert (settings.learning_rate, settings.epsilon, settings.clip_norm) == (0.001, 1e-7, 1.0)
    assert settings.patience == 3
    assert (config.network.units, config.network.layers, config.trial.trial_length) == (10, 2, 50)


def test_the_penalty_is_the_given_one_or_the_profiles():
    for values, penalty, coefficient in (
        ({}, "weights", 0.001),
        ({"profile": "released"}, "released", 0.01),
        ({"bptt": {"penalty": "activity"}}, "activity", 0.01),
        ({"profile": "released", "bptt": {"penalty": "weights"}}, "weights", 0.001),
        ({"bptt": {"penalty_coefficient": 0.1}}, "weights", 0.1),
        ({"profile": "released", "bptt": {"penalty_coefficient": 0}}, "released", 0.0),
    ):
        config = resolve("bptt", None, [values])
        assert (config.penalty, config.penalty_coefficient) == (penalty, coefficient)


def test_what_supervised_training_cannot_do_is_refused_by_name():
    for values, names in (
        ({"network": {"critic_arch": [4]}}, "critic_arch"),
        ({"seeds": 1001}, "seeds"),
        ({"epochs": 0}, "epochs"),
        ({"threads": -1}, "threads"),
        ({"profile": "text"}, "paper, released"),
        ({"bptt": {"penalty": "l2"}}, "weights, activity, released"),
        ({"bptt": {"penalty_coefficient": -0.1}}, "penalty_coefficient"),
        ({"bptt": {"penalty_coefficient": float("nan")}}, "penalty_coefficient"),
        ({"bptt": {"learning_rate": 0}}, "learning_rate"),
        ({"bptt": {"epsilon": 0}}, "epsilon"),
        ({"bptt": {"clip_norm": 0}}, "clip_norm"),
        ({"bptt": {"patience": 0}}, "patience"),
        ({"bptt": {"batch_size": 0}}, "batch_size"),
        ({"bptt": {"trials": 0}}, "trials"),
        ({"bptt": {"validation_trials": 0}}, "validation_trials"),
        ({"bptt": {"trials": 100}}, "multiple of bptt.batch_size, got 100 and 64"),
        ({"bptt": {"penalty": "activity"}, "trial": {"trial_length": 1}}, "trial_length must be at least 2"),
    ):
        with pytest.raises(UserError, match=names):
            resolve("bptt", None, [values])


def test_the_configuration_of_another_tasks_run_brings_its_choices_and_not_its_tuned_defaults():
    for algo in ALGORITHMS:
        chosen = {"seed": 3, "network": {"units": 12}, "trial": {"threshold": 0.03}, algo: {"learning_rate": 0.123}}
        run = resolve(algo, "random_reach", [chosen], model="bi_s").to_values()
        assert resolve(None, "hold_position", [run]) == resolve(algo, "hold_position", [chosen], model="bi_s")
        assert resolve(None, None, [run, {"task": "hold_position"}]) == resolve(None, "hold_position", [run])
        assert resolve(None, None, [run], model="cc_ns").to_values() == run | {"model": "cc_ns"}
        assert resolve(None, None, [run]).to_values() == run


def test_the_configuration_of_another_algorithms_run_brings_what_both_have():
    run = resolve("ppo", "hold_position", [{"n_envs": 77, "trial": {"threshold": 0.03}}], model="bi_s").to_values()
    config = resolve("sac", None, [run])
    assert config == resolve("sac", "hold_position", [{"n_envs": 77, "trial": {"threshold": 0.03}}], model="bi_s")
    assert resolve("bptt", None, [run | {"n_envs": 1024}]).trial.threshold == 0.03
    with pytest.raises(UserError, match="ppo is a setting of another algorithm than sac"):
        resolve("sac", None, [resolve("ppo", None, [{"ppo": {"gamma": 0.5}}]).to_values()])


def test_what_a_file_says_by_itself_holds_for_whatever_task():
    ent_coef = tuned_defaults("ppo", "random_reach")["ppo"]["ent_coef"]
    written = {"algo": "ppo", "task": "random_reach", "ppo": {"ent_coef": ent_coef}}
    assert resolve(None, "hold_position", [written]).ppo.ent_coef == ent_coef


def test_names_of_a_wrong_type_in_a_file_end_in_a_sentence_or_are_overruled():
    for wrong in ([1], {"a": 1}, 3, None):
        with pytest.raises(UserError, match="Unknown algorithm"):
            resolve(None, None, [{"algo": wrong}])
        assert resolve("ppo", "random_reach", [{"algo": wrong, "task": wrong}]) == resolve("ppo", "random_reach")


def test_a_file_that_somebody_wrote_keeps_the_tuned_defaults_of_what_it_leaves_out():
    """However much it says; only what a run wrote is the whole of it."""
    tuned = resolve("ppo", "random_reach")
    written = tuned.to_values()
    del written["init_from"]
    del written["ppo"]["ent_coef"], written["network"]["critic_arch"]
    assert resolve(None, None, [written]) == tuned


def test_a_td3_run_of_version_0_2_0_names_a_standard_deviation_that_nothing_had_use_for():
    values = resolve("td3", None).to_values()
    values["network"]["log_std_init"] = -1.25
    assert resolve(None, None, [values]) == resolve("td3", None)
    assert resolve(None, "hold_position", [values]) == resolve("td3", "hold_position")
    with pytest.raises(UserError, match="Unknown setting 'log_std_init' in network"):
        resolve("td3", None, [{"network": {"log_std_init": -1.25}}])


def test_a_run_of_version_0_1_0_has_one_seed():
    values = resolve("a2c", None).to_values()
    del values["seeds"]
    assert resolve(None, None, [values]) == resolve("a2c", None)


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_a_setting_that_a_runs_version_had_not_stays_off(algo, monkeypatch):
    """Whatever is tuned for new trainings: the run was made without it."""
    if algo == "bptt":
        return
    values = resolve(algo, None).to_values()
    del values[algo]["action_traces"]
    tuned = {algo: {"any_task": {algo: {"action_traces": [0.5]}}}}
    monkeypatch.setattr(importlib.import_module("bilateral_rl.config.resolve"), "_defaults_table", lambda: tuned)
    assert resolve(algo, None).hyperparameters.action_traces == (0.5,)
    assert resolve(None, None, [values]).hyperparameters.action_traces == ()
    assert resolve(None, None, [values, {"seed": 3}]).hyperparameters.action_traces == ()
    assert resolve(algo, "hold_position", [values]).hyperparameters.action_traces == (0.5,)
