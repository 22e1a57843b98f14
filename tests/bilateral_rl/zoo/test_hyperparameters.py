"""The zoo's hyperparameter files hold what is tuned in ``defaults.yaml``."""

from argparse import Namespace

import pytest
import yaml

from bilateral_rl.config.resolve import resolve
from bilateral_rl.envs import ENVIRONMENT_IDS
from bilateral_rl.training.build import build_algorithm, linear_schedule
from bilateral_rl.zoo import ALGORITHMS
from bilateral_rl.zoo.hyperparameters import FOLDER, file_for, schedule, write

HYPERPARAMETERS = (
    "n_envs", "lr_schedule", "clip_range", "gamma", "loss", "weight_penalty", "reward_scale", "ent_coef", "n_steps",
    "gae_lambda", "vf_coef", "max_grad_norm", "batch_size", "n_epochs", "normalize_advantage", "buffer_size",
    "learning_starts", "tau", "gradient_steps", "train_freq", "target_entropy", "policy_delay", "target_policy_noise",
    "target_noise_clip",
)  # fmt: skip


def test_the_files_are_those_that_the_tuned_settings_give(tmp_path):
    """If this fails, run ``python -m bilateral_rl.zoo.hyperparameters``."""
    write(tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {path.name for path in FOLDER.iterdir()} == {f"{algo}.yml" for algo in ALGORITHMS} | {
        "ppo.yml", "a2c.yml", "sac.yml", "td3.yml",
    }  # fmt: skip
    for name in names:
        assert (tmp_path / name).read_text() == (FOLDER / name).read_text(), name


def course(value):
    """What a number or a schedule is at the start, in the middle and at the end of a training."""
    if isinstance(value, (str, tuple, type(None))):
        return value
    return [float(value(left) if callable(value) else value) for left in (1.0, 0.5, 0.0)]


@pytest.mark.parametrize("algo", ALGORITHMS)
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
    assert type(zoos) is type(ours) is ALGORITHMS[algo]
    assert experiment.n_timesteps == config.timesteps
    for name in HYPERPARAMETERS:
        assert course(getattr(zoos, name, None)) == course(getattr(ours, name, None)), name
    assert repr(getattr(zoos, "action_noise", None)) == repr(getattr(ours, "action_noise", None))
    shapes = [{name: value.shape for name, value in model.policy.state_dict().items()} for model in (zoos, ours)]
    assert shapes[0] == shapes[1]
    for model in (zoos, ours):
        model.env.close()


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("lin_0.015", linear_schedule(0.015, 0.0)),
        ("lin_1e-05", linear_schedule(1e-5, 0.0)),
        ("lin_0.01_0.002", linear_schedule(0.01, 0.002)),
        ("auto", None),
        ("CallosalPolicy", None),
    ],
)
def test_schedules_in_words(text, found):
    assert schedule(text) == found


@pytest.mark.parametrize(
    ("algo", "env_id", "name"),
    [
        ("hemispheric_sac", "bilateral_rl/RandomReach-v0", "hemispheric_sac.yml"),
        ("hemispheric_sac", "Pendulum-v1", "hemispheric_sac.yml"),
        ("ppo", "bilateral_rl/HoldPosition-v0", "ppo.yml"),
        ("ppo", "Pendulum-v1", None),
        ("tqc", "bilateral_rl/RandomReach-v0", None),
    ],
)
def test_which_file_serves(algo, env_id, name):
    path = file_for(algo, env_id)
    assert (path.name if path else None) == name
    assert path is None or yaml.safe_load(path.read_text()).keys() & {env_id, "default"}
