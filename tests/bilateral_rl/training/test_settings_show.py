"""Every setting of every algorithm: another value shows in what is built or in the run's folder, or is refused."""

import numpy as np
import pytest
import torch
from stable_baselines3.common.logger import TensorBoardOutputFormat
from torch.utils.tensorboard import SummaryWriter

from bilateral_rl.config.catalogue import ALGORITHMS
from bilateral_rl.config.parse import flat
from bilateral_rl.config.resolve import resolve
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.policies import policy_arguments
from bilateral_rl.training import evaluation, supervised
from bilateral_rl.training.build import algorithm_arguments
from bilateral_rl.training.run import train


@pytest.fixture(autouse=True)
def no_pictures(monkeypatch):
    """They take longer than these trainings."""
    monkeypatch.setattr(supervised, "hand_paths", lambda *_: None)
    monkeypatch.setattr(evaluation, "hand_paths", lambda *_: None)
    monkeypatch.setattr(TensorBoardOutputFormat, "write", lambda *_, **__: None)
    monkeypatch.setattr(SummaryWriter, "add_figure", lambda *_, **__: None)


NAMES = {"algo", "model", "task", "experiment"}
"""What a training is of."""
MACHINE = {"threads", "device", "track"}
"""What concerns the machine and who watches, and not the result."""
SHARED = {
    "seed", "seeds", "init_from", "frozen", "timesteps", "n_envs", "evaluation.every", "evaluation.trials",
    "evaluation.checkpoint_every", "evaluation.lesion_probe_every", "evaluation.seed",
    "blocks.every", "blocks.trials",
}  # fmt: skip
"""Settings of every reinforcement learning that are no arguments of an algorithm or a policy."""
OF_TWO_ARMS = {"network.ipsilateral_share": 0.3, "network.trained_combination": True}
"""Other values of settings that have an effect on two arms alone."""
RL = [algo for algo in ALGORITHMS if algo != "bptt"]


def settings_of(algo):
    values = resolve(algo, None).to_values()
    return {name: value for name, value in flat(values) if not name.startswith("trial.")} | {"trial": None}


def nested(name, value):
    for part in reversed(name.split(".")):
        value = {part: value}
    return value


def another(name, value):
    """Another value that the setting may have."""
    special = {"actor_value": "first", "batch_size": 37, "buffer_size": 500, "ent_coef": 0.123, "target_entropy": -3.0}
    name = name.rpartition(".")[2]
    if name in special:
        return "min" if value == "first" else special[name]
    if isinstance(value, bool):
        return not value
    if isinstance(value, list):
        return [*value, 8] if name == "critic_arch" else [0.25]
    return 2 * value + 2 if isinstance(value, int) else 0.9 * value if value else 0.01


@pytest.mark.parametrize("algo", RL)
def test_every_hyperparameter_reaches_the_algorithm_or_its_policy(algo):
    """Whose every argument shows: ``test_arguments.py``, ``test_policy_arguments.py``."""
    defaults = settings_of(algo)
    hyperparameters = {name for name in defaults if name.startswith((f"{algo}.", "network."))}
    assert defaults.keys() == hyperparameters | NAMES | MACHINE | SHARED | {"trial"}

    def built(*layers, task=None):
        config = resolve(algo, task, layers)
        return repr((algorithm_arguments(config), policy_arguments(config)))

    for name in hyperparameters - OF_TWO_ARMS.keys():
        assert built(nested(name, another(name, defaults[name]))) != built(), name
    for name, value in OF_TWO_ARMS.items():
        assert built(nested(name, value), task="two_reaches") != built(task="two_reaches"), name


SMALL = {
    "ppo": {"timesteps": 80, "n_envs": 4, "ppo": {"n_steps": 5}, "evaluation": {"every": 40, "trials": 2}},
    "bptt": {"epochs": 2, "bptt": {"trials": 8, "batch_size": 4, "validation_trials": 2}},
}
SHOWS = {
    "ppo": {
        "seed": 1, "timesteps": 120, "n_envs": 5, "evaluation.every": 20, "evaluation.trials": 3,
        "evaluation.checkpoint_every": 40, "evaluation.lesion_probe_every": 40, "evaluation.seed": 5,
        "frozen": ["dominant"],
        "trial": {"motor_noise": 0.1},
    },
    "bptt": {
        "seed": 1, "seeds": 2, "epochs": 3, "profile": "released", "network.units": 8, "network.layers": 3,
        "network.hidden_noise": 0.1, "frozen": "shared",
        "trial": {"trial_length": 4}, "bptt.learning_rate": 0.01, "bptt.epsilon": 1e-3, "bptt.clip_norm": 1e-3,
        "bptt.batch_size": 2, "bptt.trials": 4, "bptt.validation_trials": 3, "bptt.penalty": "activity",
        "bptt.penalty_coefficient": 0.5, "bptt.final_learning_rate": 0.01,
    },
}  # fmt: skip
"""Other values, each of which shows in the run's folder."""


def trained(algo, out, *layers, task=None):
    """What a run's folder shows, but for its settings and times."""
    config = resolve(algo, task, [{"trial": {"trial_length": 5}}, SMALL[algo], *layers])
    folder = train(config, out).folder
    names = sorted(path.name for path in folder.path.rglob("*") if "tfevents" not in path.name)
    weights = {name: folder.weights_hash(name) for name in folder.weight_names()}
    tables = [path.read_text() for path in folder.path.glob("*.csv") if path.name != "monitor.csv"]
    return names, weights, sorted(tables)


@pytest.mark.parametrize("algo", SMALL)
def test_every_other_setting_shows_in_the_run(algo, tmp_path):
    told_elsewhere = {"blocks.every", "blocks.trials"}  # test_blocks.py
    told_elsewhere |= {"seeds"} if algo == "ppo" else {"bptt.patience"}
    shown = {name for name in SHOWS[algo] if algo == "bptt" or name in SHARED | {"trial"}}
    expected = (
        SHARED | {"trial"} if algo == "ppo" else settings_of("bptt").keys() - NAMES - MACHINE - OF_TWO_ARMS.keys()
    )
    assert shown | told_elsewhere | {"init_from"} == expected, "say here what another value shows"
    plain = trained(algo, tmp_path)
    assert plain == trained(algo, tmp_path), "or nothing is shown below"
    for name, value in SHOWS[algo].items():
        assert trained(algo, tmp_path, nested(name, value)) != plain, name
    if algo == "bptt":
        both = trained(algo, tmp_path, task="two_reaches")
        for name, value in OF_TWO_ARMS.items():
            assert trained(algo, tmp_path, nested(name, value), task="two_reaches") != both, name
    assert trained(algo, tmp_path, {"device": "cpu"}) == plain
    with pytest.raises(UserError, match="There is no run nowhere"):
        trained(algo, tmp_path, {"init_from": "nowhere"})
    if not torch.cuda.is_available():
        with pytest.raises(UserError, match="There is no CUDA device here"):
            trained(algo, tmp_path, {"device": "cuda"})


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"timesteps": 9_000}, "There would be no update: td3.learning_starts is 10,000 of 9,000 timesteps"),
        (
            {"timesteps": 10_640, "n_envs": 64, "td3": {"gradient_steps": 4}},
            "The network would never be updated: td3.critic_warm_up is 500 of 44 updates. Give fewer",
        ),
        (
            {"timesteps": 10_640, "td3": {"gradient_steps": 4, "critic_warm_up": 0, "policy_delay": 45}},
            "critic_warm_up is 0 of 44 updates with td3.policy_delay 45",
        ),
    ],
)
def test_a_training_that_updates_nothing_is_refused(settings, message, tmp_path):
    with pytest.raises(UserError, match=message):
        train(resolve("td3", None, [settings]), tmp_path)
    assert not list(tmp_path.iterdir())


def test_what_a_given_temperature_leaves_without_effect_is_refused():
    for name, value in (("initial_ent_coef", 0.5), ("target_entropy", -3.0)):
        with pytest.raises(UserError, match=rf"sac\.{name} is of a learned temperature, and sac\.ent_coef gives one"):
            resolve("sac", None, [{"sac": {"ent_coef": 0.1}}, {"sac": {name: value}}])
    run = resolve("sac", None, [{"sac": {"ent_coef": 0.1}}]).to_values()
    assert resolve(None, None, [run]).sac.ent_coef == 0.1


def test_numbers_paths_and_devices_of_every_kind_are_settings(tmp_path):
    given = {
        "seed": np.int64(3),
        "device": torch.device("cpu"),
        "init_from": tmp_path,
        "track": np.False_,
        "network": {"critic_arch": np.array([8, 4]), "units": np.int8(6)},
        "ppo": {"gamma": np.float32(0.5), "learning_rate": "1e-3", "n_steps": "50", "action_traces": (0.5,)},
    }
    plain = {
        "seed": 3,
        "device": "cpu",
        "init_from": str(tmp_path),
        "track": False,
        "network": {"critic_arch": [8, 4], "units": 6},
        "ppo": {"gamma": 0.5, "learning_rate": 0.001, "n_steps": 50, "action_traces": [0.5]},
    }
    assert resolve("ppo", None, [given]).to_values() == resolve("ppo", None, [plain]).to_values()
