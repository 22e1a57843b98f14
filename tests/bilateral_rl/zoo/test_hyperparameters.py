"""The zoo's hyperparameters are those that are tuned in ``defaults.yaml``."""

import importlib
from argparse import Namespace

import pytest
import yaml

from bilateral_rl.algorithms.schedules import linear_schedule
from bilateral_rl.config.resolve import resolve
from bilateral_rl.envs import ENVIRONMENT_IDS
from bilateral_rl.training.build import build_algorithm
from bilateral_rl.zoo import ZOO_ALGORITHMS
from bilateral_rl.zoo.hyperparameters import hyperparameters, parse_schedule, tuned_module

HYPERPARAMETERS = (
    "n_envs", "lr_schedule", "clip_range", "gamma", "loss", "weight_penalty", "reward_scale", "ent_coef", "n_steps",
    "gae_lambda", "vf_coef", "max_grad_norm", "batch_size", "n_epochs", "normalize_advantage", "buffer_size",
    "learning_starts", "tau", "gradient_steps", "train_freq", "target_entropy", "policy_delay", "target_policy_noise",
    "target_noise_clip",
)  # fmt: skip


def test_rl_zoo3_imports_them_anew_each_time_as_plain_values():
    for algo in (*ZOO_ALGORITHMS, "ppo", "a2c", "sac", "td3"):
        env_id = "bilateral_rl/HoldPosition-v0"
        module = importlib.import_module(tuned_module(algo, env_id))
        module.hyperparams[env_id].clear()  # rl_zoo3 writes into what it reads
        assert module.hyperparams == hyperparameters(algo)
        assert module.hyperparams[env_id]["policy"] == "CallosalPolicy"
        assert yaml.safe_load(yaml.safe_dump(module.hyperparams)) == module.hyperparams
        stock = algo not in ZOO_ALGORITHMS
        assert stock == ("reward_scale" not in module.hyperparams[env_id])
        assert stock == ("default" not in module.hyperparams)


def course(value):
    """What a number or a schedule is at the start, in the middle and at the end of a training."""
    if isinstance(value, (str, tuple, type(None))):
        return value
    return [float(value(left) if callable(value) else value) for left in (1.0, 0.5, 0.0)]


@pytest.mark.parametrize("algo", ZOO_ALGORITHMS)
@pytest.mark.parametrize("task", ENVIRONMENT_IDS)
def test_the_zoo_builds_what_our_own_training_does(algo, task, tmp_path):
    pytest.importorskip("rl_zoo3")
    from bilateral_rl.zoo.__main__ import register
    from bilateral_rl.zoo.experiment import Experiment

    register()
    config = resolve(algo.removeprefix("hemispheric_"), task)
    experiment = Experiment(Namespace(), algo, ENVIRONMENT_IDS[task], str(tmp_path), eval_freq=-1, device="cpu")
    zoos, _ = experiment.setup_experiment()
    ours = build_algorithm(config)
    assert type(zoos) is type(ours) is ZOO_ALGORITHMS[algo]
    assert experiment.n_timesteps == config.timesteps
    for name in HYPERPARAMETERS:
        assert course(getattr(zoos, name, None)) == course(getattr(ours, name, None)), name
    assert repr(getattr(zoos, "action_noise", None)) == repr(getattr(ours, "action_noise", None))
    shapes = [{name: value.shape for name, value in model.policy.state_dict().items()} for model in (zoos, ours)]
    assert shapes[0] == shapes[1]
    for model in (zoos, ours):
        model.env.close()


def test_schedules_in_words():
    for text, found in (
        ("lin_0.015", linear_schedule(0.015, 0.0)),
        ("lin_1e-05", linear_schedule(1e-5, 0.0)),
        ("lin_0.01_0.002", linear_schedule(0.01, 0.002)),
        ("auto", None),
        ("CallosalPolicy", None),
    ):
        assert parse_schedule(text) == found


def test_where_ours_serve():
    for algo, env_id, ours in (
        ("hemispheric_sac", "bilateral_rl/RandomReach-v0", True),
        ("hemispheric_sac", "Pendulum-v1", True),
        ("ppo", "bilateral_rl/HoldPosition-v0", True),
        ("ppo", "Pendulum-v1", False),
        ("tqc", "bilateral_rl/RandomReach-v0", False),
    ):
        assert (tuned_module(algo, env_id) is not None) == ours
        assert not ours or hyperparameters(algo).keys() & {env_id, "default"}
