"""Every argument of every algorithm: another value shows in what is learned, or is refused with what to do instead."""

import inspect
import warnings

import numpy as np
import pytest
import torch
from hemispheric_models import ALGORITHMS, OFF_POLICY, ON_POLICY, arm, weights
from stable_baselines3.common.buffers import ReplayBuffer, RolloutBuffer
from stable_baselines3.common.noise import NormalActionNoise

from bilateral_rl import algorithms
from bilateral_rl.algorithms import HemisphericA2C, HemisphericPPO, HemisphericSAC, HemisphericTD3

each_algorithm = pytest.mark.parametrize("algorithm", ALGORITHMS)
pytestmark = pytest.mark.filterwarnings("ignore:You have specified a mini-batch size")

N_ENVS = 2
_TINY = {"policy_kwargs": {"units": 4, "critic_arch": (4,)}, "learning_rate": 0.02}
_ON = {"n_steps": 9, "ent_coef": 0.01}
_OFF = {"buffer_size": 100, "learning_starts": 4, "batch_size": 8, "train_freq": 3, "gradient_steps": 2}
TINY = {
    HemisphericPPO: _TINY | _ON | {"batch_size": 9, "n_epochs": 2},
    HemisphericA2C: _TINY | _ON,
    HemisphericSAC: _TINY | _OFF,
    HemisphericTD3: _TINY | _OFF | {"policy_delay": 2},
}

SHOWS = {
    "policy": "BilateralPolicy",
    "env": lambda: arm(3),
    "loss": "combined",
    "weight_penalty": 0.5,
    "penalty_weights": [1.0, 0.5],
    "reward_scale": 2.0,
    "critic_rate_factor": 3.0,
    "network_epsilon": 0.1,
    "action_traces": (0.5,),
    "frozen": "dominant",
    "learning_rate": 0.01,
    "gamma": 0.5,
    "stats_window_size": 3,
    "policy_kwargs": {"units": 6, "critic_arch": (4,)},
    "verbose": 1,
    "seed": 1,
    "_init_setup_model": False,
    "n_steps": 12,
    "batch_size": 6,
    "n_epochs": 3,
    "gae_lambda": 0.5,
    "normalize_advantage": {HemisphericPPO: False, HemisphericA2C: True},
    "clip_range": 1e-3,
    "clip_range_vf": 1e-3,
    "ent_coef": 0.5,
    "vf_coef": 0.1,
    "max_grad_norm": 1e-9,
    "target_kl": 1e-9,
    "use_rms_prop": False,
    "rms_prop_eps": 0.1,
    "critic_warm_up": 5,
    "standardize_inputs": True,
    "actor_value": {HemisphericSAC: "first", HemisphericTD3: "mean"},
    "normalize_streams": True,
    "buffer_size": 8,
    "learning_starts": 16,
    "tau": 0.5,
    "train_freq": 2,
    "gradient_steps": 1,
    "action_noise": NormalActionNoise(np.zeros(6), np.ones(6)),
    "replay_buffer_kwargs": {"handle_timeout_termination": False},
    "target_update_interval": 2,
    "target_entropy": -1.0,
    "policy_delay": {HemisphericSAC: 2, HemisphericTD3: 1},
    "target_policy_noise": 0.5,
    "target_noise_clip": 0.01,
}
"""Another value than the default, or than in TINY; of some, one for each algorithm."""
REFUSED = {
    "use_sde": (True, "state-dependent exploration"),
    "sde_sample_freq": (4, "state-dependent exploration"),
    "use_sde_at_warmup": (True, "state-dependent exploration"),
    "rollout_buffer_class": (RolloutBuffer, None),
    "rollout_buffer_kwargs": ({"gamma": 0.5}, "gamma of the buffer follows from the algorithm"),
    "replay_buffer_class": (ReplayBuffer, "needs its own replay buffer"),
    "optimize_memory_usage": (True, "keeps next observations"),
    "device": ("nowhere", "nowhere"),
}
REFUSED_OFF_POLICY = {"n_steps": (3, "no returns of several steps")}


def arguments_of(algorithm):
    return dict(inspect.signature(algorithm).parameters)


def another(name, algorithm):
    value = SHOWS[name]
    return value.get(algorithm, value) if isinstance(value, dict) else value


def make(algorithm, env=None, policy="CallosalPolicy", **arguments):
    env = env() if env else arm(N_ENVS)
    return algorithm(policy, env, **({"seed": 0, "device": "cpu"} | TINY[algorithm] | arguments))


def learned(model):
    """What a model has become by 36 steps: its weights, and what else its user sees of it."""
    if not hasattr(model, "rollout_buffer") and getattr(model, "replay_buffer", None) is None:
        return "not built"
    model.learn(27)
    state = {name: (tensor.shape, tensor.numpy().tobytes()) for name, tensor in weights(model).items()}
    return state, model._n_updates, len(model.ep_info_buffer)


@each_algorithm
def test_every_argument_shows_or_is_refused(algorithm, tmp_path, capsys):
    refused = REFUSED | (REFUSED_OFF_POLICY if algorithm in OFF_POLICY else {})
    names = arguments_of(algorithm).keys()
    missing = names - SHOWS.keys() - refused.keys() - {"tensorboard_log"}
    assert not missing, f"say here what other values of {missing} change, or that they are refused"
    plain = learned(make(algorithm))
    assert plain == learned(make(algorithm)), "or nothing is shown below"
    for name in names - {"tensorboard_log", "rollout_buffer_class"}:
        if name in refused:
            value, message = refused[name]
            with pytest.raises((ValueError, RuntimeError), match=message):
                make(algorithm, **{name: value})
            continue
        value = another(name, algorithm)
        capsys.readouterr()
        shown = learned(make(algorithm, **{name: value}))
        if name == "verbose":
            assert "Using cpu device" in capsys.readouterr().out
        else:
            assert shown != plain, name
    make(algorithm, tensorboard_log=tmp_path).learn(18)
    assert list(tmp_path.rglob("events*"))


def test_every_public_class_is_looked_at():
    public = [getattr(algorithms, name) for name in algorithms.__all__]
    assert {cls for cls in public if inspect.isclass(cls)} == {*ALGORITHMS, algorithms.Hemispheric}


class OwnBuffer(RolloutBuffer):
    """A buffer of a user's."""


@pytest.mark.parametrize("algorithm", ON_POLICY)
def test_the_rollout_buffer_is_the_one_that_is_used(algorithm):
    with pytest.raises(ValueError, match="needs its own rollout buffer: leave rollout_buffer_class out"):
        make(algorithm, rollout_buffer_class=OwnBuffer)
    model = make(algorithm)
    model.learn(18)
    assert np.abs(model.rollout_buffer.rewards).min() > 0
    model.rollout_buffer = OwnBuffer(9, model.observation_space, model.action_space, n_envs=N_ENVS)
    with pytest.raises(ValueError, match="leave rollout_buffer as it is"):
        model.learn(18)


@each_algorithm
def test_numbers_of_numpy_lists_and_switches_are_as_good_as_pythons(algorithm):
    on = {"n_steps": np.int64(9), "ent_coef": np.float64(0.01), "normalize_advantage": 1, "gae_lambda": np.float32(0.5)}
    off = {"train_freq": [np.int8(3), "step"], "batch_size": np.int16(8), "buffer_size": np.uint8(100)}
    off |= {"gradient_steps": np.int32(2), "learning_starts": torch.tensor(4), "standardize_inputs": np.True_}
    given = on if algorithm in ON_POLICY else off
    given |= {"learning_rate": np.float64(0.02), "seed": np.int64(3), "device": torch.device("cpu")}
    given |= {"action_traces": [np.float32(0.5)], "weight_penalty": np.float64(0.01)}
    plain = {"normalize_advantage": True} if algorithm in ON_POLICY else {"train_freq": 3, "standardize_inputs": True}
    plain |= {"gae_lambda": 0.5} if algorithm in ON_POLICY else {}
    plain |= {"seed": 3, "action_traces": (0.5,), "weight_penalty": 0.01}
    model = make(algorithm, **given)
    assert learned(model) == learned(make(algorithm, **plain))
    assert all(type(getattr(model, name)) in (int, float, bool) for name in given.keys() & {"seed", "n_steps", "gamma"})


@each_algorithm
def test_a_learning_rate_may_be_any_function_of_the_remaining_progress(algorithm):
    seen = []
    model = make(algorithm, learning_rate=lambda left: seen.append(left) or 0.01 * left)
    model.learn(36)
    assert max(seen) == 1
    assert min(seen) < 1


BAD = [
    ({"gamma": 99}, "gamma must be at most 1, got 99"),
    ({"gamma": float("nan")}, "gamma must be a finite number, got nan"),
    ({"gamma": "0.9"}, r"gamma must be a finite number, got '0\.9'"),
    ({"weight_penalty": -0.1}, r"weight_penalty must be at least 0, got -0\.1"),
    ({"penalty_weights": 2.0}, r"penalty_weights takes two numbers, .* got 2\.0"),
    ({"penalty_weights": (0, 1, 2)}, r"penalty_weights takes two numbers, .* got \(0, 1, 2\)"),
    ({"penalty_weights": (0, -1)}, "each number of penalty_weights must be at least 0, got -1"),
    ({"reward_scale": 0}, "reward_scale must be above 0, got 0"),
    ({"learning_rate": -1}, "learning_rate must be at least 0, got -1"),
    ({"learning_rate": "fast"}, "learning_rate must be a finite number, got 'fast'"),
    ({"seed": -1}, "seed must be at least 0, got -1"),
    ({"seed": 1.5}, r"seed must be a whole number, got 1\.5"),
    ({"stats_window_size": 0}, "stats_window_size must be at least 1, got 0"),
    ({"n_steps": 20.0}, r"n_steps must be a whole number, got 20\.0"),
    ({"n_steps": "20"}, "n_steps must be a whole number, got '20'"),
    ({"n_epochs": 0}, "n_epochs must be at least 1"),
    ({"batch_size": True}, "batch_size must be a whole number, got True"),
    ({"clip_range": 0}, "clip_range must be above 0"),
    ({"gae_lambda": 1.1}, "gae_lambda must be at most 1"),
    ({"max_grad_norm": None}, "max_grad_norm must be a finite number, got None"),
    ({"normalize_advantage": "no"}, "normalize_advantage must be True or False, got 'no'"),
    ({"critic_warm_up": -1}, "critic_warm_up must be at least 0, got -1"),
    ({"train_freq": (2, "step", 1)}, r"train_freq must be a number of steps or a pair like \(2, \"episode\"\)"),
    ({"train_freq": 0}, "train_freq must be at least 1"),
    ({"gradient_steps": -2}, "gradient_steps must be at least -1"),
    ({"action_noise": 0.1}, r"action_noise must be an ActionNoise of SB3, such as NormalActionNoise, .* got 0\.1"),
    ({"tau": 2}, "tau must be at most 1"),
    ({"normalize_streams": "yes"}, "normalize_streams must be True or False"),
    ({"ent_coef": "automatic"}, 'ent_coef must be a (finite )?number'),
    ({"ent_coef": "auto_0"}, 'ent_coef must be a (finite )?number'),
    ({"target_entropy": "high"}, "target_entropy must be a finite number"),
    ({"policy_kwargs": {"net_arch": [64, 64]}}, "units and layers, and the critics by critic_arch"),
    ({"policy_kwargs": {"use_sde": True}}, "state-dependent exploration"),
    ({"loss": "both"}, "unknown loss 'both'"),
]  # fmt: skip


@each_algorithm
def test_values_that_cannot_work_are_refused_by_name(algorithm):
    for arguments, message in BAD:
        (name,) = arguments
        if name in arguments_of(algorithm).keys() - ({"n_steps"} if algorithm in OFF_POLICY else set()):
            with pytest.raises(ValueError, match=message):
                make(algorithm, **arguments)


def test_what_another_argument_leaves_without_effect_is_refused():
    for algorithm, arguments, message in (
        (HemisphericA2C, {"use_rms_prop": False, "rms_prop_eps": 1e-3}, "rms_prop_eps has no effect without RMSprop"),
        (HemisphericA2C, {"policy_kwargs": {"optimizer_kwargs": {}}}, "no effect on A2C's own RMSprop"),
        (HemisphericSAC, {"ent_coef": 0.1, "target_entropy": -3.0}, "no effect on a temperature that is given"),
    ):
        with pytest.raises(ValueError, match=message):
            make(algorithm, **arguments)


@each_algorithm
def test_a_penalty_that_no_loss_weighs_warns(algorithm, tmp_path):
    for arguments in ({"loss": "dominant"}, {"penalty_weights": (0, 0)}):
        with pytest.warns(UserWarning, match=r"weight_penalty=0\.5 has no effect: the penalty weighs nothing"):
            make(algorithm, weight_penalty=0.5, **arguments)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for arguments in ({}, {"weight_penalty": 0.0}, {"weight_penalty": 0.5, "penalty_weights": (1, 0)}):
            make(algorithm, **{"loss": "dominant"} | arguments)
        make(algorithm, loss="dominant").save(tmp_path / "model")
        algorithm.load(tmp_path / "model")
    with pytest.warns(UserWarning, match=r"weight_penalty=0\.5 has no effect"):
        algorithm.load(tmp_path / "model", weight_penalty=0.5)


@pytest.mark.parametrize("algorithm", OFF_POLICY)
def test_a_warm_up_that_outlasts_every_update_warns(algorithm):
    model = make(algorithm, critic_warm_up=30)
    before = weights(model)
    with pytest.warns(UserWarning, match="only the critics have learned: critic_warm_up is 30, of 10 updates so far"):
        model.learn(27)
    network = [name for name in before if "actor.network" in name]
    assert network
    assert all(torch.equal(weights(model)[name], before[name]) for name in network)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model.learn(150, reset_num_timesteps=False)


# Attributes


NOT_SET_AFTERWARDS = {"policy", "env", "device", "_init_setup_model", "stats_window_size", "replay_buffer_kwargs"}
"""Arguments that are no attribute, or that concern what has long been made."""


@each_algorithm
def test_an_attribute_that_is_set_afterwards_shows_or_is_refused(algorithm):
    plain = learned(make(algorithm))
    names = arguments_of(algorithm).keys() & SHOWS.keys() - NOT_SET_AFTERWARDS
    fixed = {*algorithm.FIXED, "n_steps"}
    for name in names - {"verbose", "use_rms_prop", "rms_prop_eps"}:
        model = make(algorithm)
        value = another(name, algorithm)
        setattr(model, name, value)
        if name in fixed:
            with pytest.raises(ValueError, match=f"{name}.* to the constructor|leave n_steps out"):
                model.learn(36)
        else:
            assert learned(model) != plain, name


@each_algorithm
def test_an_attribute_that_cannot_work_is_refused(algorithm):
    for name, value in (("gamma", 3.0), ("learning_rate", "slow"), ("actor_value", "max"), ("train_freq", "often")):
        model = make(algorithm)
        if hasattr(model, name):
            setattr(model, name, value)
            with pytest.raises(ValueError, match=f"{name} must be"):
                model.learn(18)


# load


KEPT = {"policy", "loss", "action_traces", "standardize_inputs", "normalize_streams", "policy_kwargs", "use_rms_prop"}
KEPT |= {"rms_prop_eps"}
"""Arguments that a saved model keeps: load refuses another value."""


@each_algorithm
def test_load_takes_every_argument_or_says_that_the_model_keeps_it(algorithm, tmp_path):
    saved = make(algorithm)
    saved.save(tmp_path / "model")
    refused = REFUSED | (REFUSED_OFF_POLICY if algorithm in OFF_POLICY else {})
    given_otherwise = {"env", "device", "_init_setup_model", "rollout_buffer_class"}
    for name in arguments_of(algorithm).keys() - given_otherwise - {"tensorboard_log", "policy_kwargs"}:
        value = refused[name][0] if name in refused else another(name, algorithm)
        if name in refused.keys() | KEPT or (name, algorithm) == ("ent_coef", HemisphericSAC):
            with pytest.raises(ValueError, match=r"."):
                algorithm.load(tmp_path / "model", env=arm(N_ENVS), device="cpu", **{name: value})
        else:
            loaded = algorithm.load(tmp_path / "model", env=arm(N_ENVS), device="cpu", **{name: value})
            stored = getattr(loaded, {"stats_window_size": "_stats_window_size"}.get(name, name))
            assert stored != getattr(saved, name, None), name


@each_algorithm
def test_load_refuses_names_that_are_none(algorithm, tmp_path):
    make(algorithm).save(tmp_path / "model")
    with pytest.raises(ValueError, match=r"load\(\) has no argument 'wieght_penalty'; it takes those of Hemispheric"):
        algorithm.load(tmp_path / "model", wieght_penalty=0.1)


@each_algorithm
def test_load_takes_what_the_model_was_saved_with(algorithm, tmp_path):
    """As rl_zoo3 does, which gives all hyperparameters again."""
    streams = {"normalize_streams": True, "standardize_inputs": True} if algorithm in OFF_POLICY else {}
    optimizer = {"use_rms_prop": False} if algorithm is HemisphericA2C else {}
    arguments = {"loss": "combined", "action_traces": (0.5,)} | streams | optimizer
    make(algorithm, **arguments).save(tmp_path / "model")
    sizes = {name: value for name, value in TINY[algorithm].items() if name != "policy_kwargs"}
    algorithm.load(tmp_path / "model", env=arm(N_ENVS), device="cpu", **sizes, **arguments).learn(18)


@pytest.mark.parametrize("algorithm", OFF_POLICY)
def test_streams_that_are_normalized_or_not_stay_so_in_a_saved_model(algorithm, tmp_path):
    for was in (False, True):
        make(algorithm, normalize_streams=was).save(tmp_path / "model")
        with pytest.raises(ValueError, match=r"stream_scale: a saved model keeps normalize_streams"):
            algorithm.load(tmp_path / "model", normalize_streams=not was)
        with pytest.raises(ValueError, match=r"a saved model keeps normalize_streams"):
            make(algorithm, normalize_streams=not was).set_parameters(tmp_path / "model.zip")


def test_a_temperature_that_is_learned_or_given_stays_so_in_a_saved_model(tmp_path):
    for was, other in (("auto", 0.1), (0.1, "auto")):
        make(HemisphericSAC, ent_coef=was).save(tmp_path / "model")
        with pytest.raises(ValueError, match=r"ent_coef_optimizer: a saved model keeps .* temperature is learned"):
            HemisphericSAC.load(tmp_path / "model", ent_coef=other)


@each_algorithm
def test_custom_objects_replace_what_was_saved(algorithm, tmp_path):
    """What the models of the Hugging Face Hub are loaded with."""
    make(algorithm).save(tmp_path / "model")
    objects = {"learning_rate": 0.0, "lr_schedule": lambda _: 0.0, "clip_range": lambda _: 0.1}
    loaded = algorithm.load(tmp_path / "model", env=arm(N_ENVS), device="cpu", custom_objects=objects)
    before = {name: value for name, value in weights(loaded).items() if "target" not in name}
    loaded.learn(36)
    assert all(torch.equal(weights(loaded)[name], value) for name, value in before.items())
