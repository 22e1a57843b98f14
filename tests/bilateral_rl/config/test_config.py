import dataclasses
import importlib.resources
import json

import pytest
import torch
import yaml
from hypothesis import given
from hypothesis import strategies as st

from bilateral_rl.config.catalogue import ALGORITHMS, MODELS, TASK_DESCRIPTIONS
from bilateral_rl.config.parse import merge, parse_overrides
from bilateral_rl.config.resolve import from_values, resolve, tuned_defaults
from bilateral_rl.config.schema import BPTTConfig, PPORunConfig, RLConfig
from bilateral_rl.envs import TASKS
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.yaml_files import read_settings
from bilateral_rl.policies import make_network


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("algo", ALGORITHMS)
def test_every_algorithm_task_and_model_has_working_defaults(algo, task, model):
    config = resolve(algo, task, model=model)
    assert (config.algo, config.task, config.model) == (algo, task, model)


def test_the_bare_command_trains_the_callosal_specialized_model_to_reach_with_ppo():
    config = resolve(None, None)
    assert (config.algo, config.task, config.model) == ("ppo", "random_reach", "cc_s")


def test_later_layers_win_over_earlier_ones_and_over_the_tuned_defaults():
    tuned = tuned_defaults("ppo", "random_reach")
    config = resolve(None, None, [{"ppo": {"gamma": 0.5, "n_epochs": 3}}, {"ppo": {"gamma": 0.6}}])
    assert (config.ppo.gamma, config.ppo.n_epochs) == (0.6, 3)
    assert config.ppo.learning_rate == tuned.get("ppo", {}).get("learning_rate", PPORunConfig().ppo.learning_rate)


def test_tuned_defaults_name_only_settings_that_exist():
    for algo in ALGORITHMS:
        for task in TASKS:
            from_values({"algo": algo} | tuned_defaults(algo, task))


def test_tuned_defaults_are_for_algorithms_and_tasks_that_exist():
    table = yaml.safe_load(importlib.resources.files("bilateral_rl.config").joinpath("defaults.yaml").read_text())
    assert set(table) <= set(ALGORITHMS)
    for algo, by_task in table.items():
        assert set(by_task) <= {"any_task", *TASKS}
        for values in by_task.values():
            assert not {"algo", "model", "task", "seed"} & set(values)
            assert set(values) - {f.name for f in dataclasses.fields(RLConfig)} <= {algo}


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_a_configuration_survives_yaml_and_json(tmp_path, algo):
    config = resolve(algo, "hold_position", [{"trial": {"threshold": 0.02, "arm": {"link_length": [0.3, 0.31]}}}])
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


@pytest.mark.parametrize(
    ("values", "names"),
    [
        ({"model": "cc"}, "uni_b"),
        ({"task": "reach"}, "random_reach"),
        ({"algo": "dqn"}, "ppo"),
        ({"modle": "cc_s"}, "modle"),
        ({"ppo": {"lr": 1}}, "learning_rate"),
        ({"ppo": 3}, "ppo"),
        ({"timesteps": 0}, "timesteps"),
        ({"timesteps": 1.5}, "timesteps"),
        ({"timesteps": True}, "timesteps"),
        ({"seed": -1}, "seed"),
        ({"device": "tpu"}, "cuda"),
        ({"n_envs": 1, "ppo": {"n_steps": 1}}, "n_steps"),
        ({"ppo": {"gamma": 1.5}}, "gamma"),
        ({"ppo": {"gamma": float("nan")}}, "gamma"),
        ({"ppo": {"learning_rate": "fast"}}, "learning_rate"),
        ({"network": {"units": 7}}, "odd"),
        ({"network": {"layers": 1}}, "layers"),
        ({"network": {"critic_arch": []}}, "critic_arch"),
        ({"network": {"critic_arch": 64}}, "critic_arch"),
        ({"trial": {"threshold": -1}}, "threshold"),
        ({"trial": {"arm": {"link_length": [0.3]}}}, "link_length"),
        ({"evaluation": {"trials": 0}}, "trials"),
    ],
)
def test_what_cannot_work_is_refused_by_name(values, names):
    with pytest.raises(UserError, match=names):
        resolve(None, None, [values])


@pytest.mark.parametrize("model", ["uni_b", "bi_s", "cc_s"])
@pytest.mark.parametrize("units", range(-1, 7))
@pytest.mark.parametrize("layers", range(-1, 4))
def test_exactly_the_networks_that_cannot_be_built_are_refused(model, units, layers):
    try:
        make_network(MODELS[model].architecture, 16, 6, units, layers)
    except ValueError:
        with pytest.raises(UserError, match=r"units|layers"):
            resolve(None, None, [{"network": {"units": units, "layers": layers}}], model=model)
    else:
        assert (
            resolve(None, None, [{"network": {"units": units, "layers": layers}}], model=model).network.units == units
        )


def test_reading_a_configuration_draws_no_random_numbers():
    before = torch.get_rng_state()
    resolve(None, None)
    assert torch.equal(torch.get_rng_state(), before)


def test_the_catalogue_describes_the_tasks_there_are():
    assert TASK_DESCRIPTIONS.keys() == TASKS.keys()


ON_POLICY = ("ppo", "a2c")
OFF_POLICY = ("sac", "td3")
BAD_HYPERPARAMETERS = [
    (("ppo", "a2c", "sac", "td3"), "learning_rate", (0, -1, "fast", float("inf"))),
    (("ppo", "a2c", "sac", "td3"), "final_learning_rate", (-0.1,)),
    (("ppo", "a2c", "sac", "td3"), "gamma", (-0.1, 1.01)),
    (("ppo", "a2c", "sac", "td3"), "weight_penalty", (-0.001,)),
    (("ppo", "a2c", "sac", "td3"), "reward_scale", (0, -1)),
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
    (("sac",), "ent_coef", (-0.1, "auto")),
    (("sac",), "initial_ent_coef", (0,)),
    (("sac",), "target_entropy", ("auto", float("nan"))),
    (("td3",), "action_noise", (-0.1,)),
    (("td3",), "policy_delay", (0,)),
    (("td3",), "target_policy_noise", (0,)),
    (("td3",), "target_noise_clip", (0,)),
]


@pytest.mark.parametrize(
    ("algo", "name", "value"),
    [(algo, name, value) for algos, name, values in BAD_HYPERPARAMETERS for algo in algos for value in values],
)
def test_a_hyperparameter_that_cannot_work_is_refused_by_name(algo, name, value):
    with pytest.raises(UserError, match=rf"{algo}\.{name}"):
        resolve(algo, None, [{algo: {name: value}}])


def test_every_hyperparameter_has_values_that_are_refused():
    covered = {(algo, name) for algos, name, _ in BAD_HYPERPARAMETERS for algo in algos}
    configs = {algo: resolve(algo, None) for algo in (*ON_POLICY, *OFF_POLICY)}
    fields = {(algo, f.name) for algo, c in configs.items() for f in dataclasses.fields(c.hyperparameters)}
    assert covered == fields


@pytest.mark.parametrize("algo", [*ON_POLICY, *OFF_POLICY])
@pytest.mark.parametrize("other", [*ON_POLICY, *OFF_POLICY])
def test_the_settings_of_another_algorithm_are_refused(algo, other):
    values = parse_overrides([f"{other}.gamma=0.9"])
    if other == algo:
        assert resolve(algo, None, [values]).hyperparameters.gamma == 0.9
        return
    with pytest.raises(UserError, match=f"{other} is a setting of another algorithm than {algo}"):
        resolve(algo, None, [values])


@pytest.mark.parametrize("item", ["gamma", "=3", ""])
def test_an_override_of_another_form_is_refused(item):
    with pytest.raises(UserError, match="key=value"):
        parse_overrides([item])


@pytest.mark.parametrize("text", ["- 1\n- 2\n", "a: [1", "!!python/object/apply:os.getcwd []", "\x00"])
def test_a_file_that_is_no_configuration_is_refused(tmp_path, text):
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


@pytest.mark.parametrize(
    ("values", "penalty", "coefficient"),
    [
        ({}, "weights", 0.001),
        ({"profile": "released"}, "released", 0.01),
        ({"bptt": {"penalty": "activity"}}, "activity", 0.01),
        ({"profile": "released", "bptt": {"penalty": "weights"}}, "weights", 0.001),
        ({"bptt": {"penalty_coefficient": 0.1}}, "weights", 0.1),
        ({"profile": "released", "bptt": {"penalty_coefficient": 0}}, "released", 0.0),
    ],
)
def test_the_penalty_is_the_given_one_or_the_profiles(values, penalty, coefficient):
    config = resolve("bptt", None, [values])
    assert (config.penalty, config.penalty_coefficient) == (penalty, coefficient)


@pytest.mark.parametrize(
    ("values", "names"),
    [
        ({"timesteps": 1000}, "timesteps"),
        ({"n_envs": 4}, "n_envs"),
        ({"ppo": {"gamma": 0.9}}, "ppo"),
        ({"evaluation": {"trials": 3}}, "evaluation"),
        ({"network": {"critic_arch": [4]}}, "critic_arch"),
        ({"network": {"units": 7}}, "odd"),
        ({"seeds": 0}, "seeds"),
        ({"seeds": 1001}, "seeds"),
        ({"seeds": 1.5}, "seeds"),
        ({"seed": 2**32 - 2, "seeds": 3}, "seed"),
        ({"epochs": 0}, "epochs"),
        ({"threads": -1}, "threads"),
        ({"profile": "text"}, "paper, released"),
        ({"init_from": 3}, "init_from"),
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
        ({"bptt": {"lr": 1}}, "learning_rate"),
        ({"trial": {"sensory_noise": 0.01}}, "sensory_noise"),
        ({"trial": {"motor_noise": 0.01}}, "motor_noise"),
        ({"trial": {"feedback_delay": 1}}, "feedback_delay"),
    ],
)
def test_what_supervised_training_cannot_do_is_refused_by_name(values, names):
    with pytest.raises(UserError, match=names):
        resolve("bptt", None, [values])


@pytest.mark.parametrize("algo", [*ON_POLICY, *OFF_POLICY])
@pytest.mark.parametrize("name", ["seeds", "epochs", "profile", "bptt"])
def test_reinforcement_refuses_the_settings_of_supervised_training(algo, name):
    value = BPTTConfig().to_values()[name]
    with pytest.raises(UserError, match=name):
        resolve(algo, None, [{name: value}])


def test_a_supervised_configuration_survives_yaml_and_json(tmp_path):
    values = {"seeds": 3, "profile": "released", "init_from": "a:1", "bptt": {"epsilon": 1e-8, "penalty": "activity"}}
    config = resolve("bptt", "hold_position", [values], model="bi_s")
    for name, text in (("c.yaml", yaml.safe_dump(config.to_values())), ("c.json", json.dumps(config.to_values()))):
        (tmp_path / name).write_text(text)
        assert resolve(None, None, [read_settings(tmp_path / name)]) == config
