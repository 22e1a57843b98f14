"""Training, watching and going on through the real rl_zoo3."""

import re

import matplotlib.pyplot as plt
import numpy as np
import pytest
from stable_baselines3 import A2C, PPO, SAC, TD3

from bilateral_rl.envs import ArmVecEnv
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.zoo import ZOO_ALGORITHMS

pytest.importorskip("rl_zoo3")

EVERY_ALGORITHM = ZOO_ALGORITHMS | {"ppo": PPO, "a2c": A2C, "sac": SAC, "td3": TD3}


@pytest.mark.parametrize("algo", EVERY_ALGORITHM)
def test_every_algorithm_trains_and_is_enjoyed(algo, train, zoo, tmp_path):
    task = "HoldPosition" if algo == "hemispheric_ppo" else "RandomReach"
    train(algo, f"bilateral_rl/{task}-v0", steps=400)
    folder = tmp_path / "logs" / algo / f"bilateral_rl-{task}-v0_1"
    model = EVERY_ALGORITHM[algo].load(folder / f"bilateral_rl-{task}-v0.zip", device="cpu")
    assert isinstance(model.policy, MotorPolicy)
    assert model.num_timesteps == 400
    observation = ArmVecEnv(3, seed=0).reset()
    action, _ = model.predict(observation, deterministic=True)
    with model.policy.motor_network.lesioned("callosum"):
        lesioned, _ = model.predict(observation, deterministic=True)
    assert (action != lesioned).any()
    said = zoo(f"enjoy --algo {algo} --env bilateral_rl/{task}-v0 -f logs --no-render -n 100 --device cpu")
    assert "2 Episodes" in said
    assert "Mean reward: -" in said


def test_arms_are_simulated_at_once_and_their_trials_written_down(train, tmp_path):
    train(options="--env-kwargs trial_length:20 threshold:0.4", params="env_kwargs:None")
    (folder,) = (tmp_path / "logs" / "hemispheric_ppo").iterdir()
    _, columns, *rows = (folder / "0.monitor.csv").read_text().splitlines()
    assert columns == "r,l,t,is_success"
    assert len(rows) == 16
    assert {row.split(",")[1] for row in rows} == {"20"}
    assert not (folder / "1.monitor.csv").exists()


@pytest.fixture
def environments(monkeypatch):
    """The environments that algorithms of the zoo are given."""
    import rl_zoo3

    given = []

    class Watched(ZOO_ALGORITHMS["hemispheric_ppo"]):
        def __init__(self, *args, env, **kwargs):
            given.append(env)
            super().__init__(*args, env=env, **kwargs)

    from bilateral_rl.zoo.__main__ import register

    register()
    monkeypatch.setattr("bilateral_rl.zoo.__main__.register", lambda: None)
    monkeypatch.setitem(rl_zoo3.ALGOS, "hemispheric_ppo", Watched)
    return given


@pytest.mark.parametrize(
    ("params", "batched"),
    [("", True), ("frame_stack:2", True), ("env_wrapper:\"'rl_zoo3.wrappers.ActionNoiseWrapper'\"", False)],
)
def test_only_a_wrapper_of_each_arm_needs_arms_one_by_one(train, environments, params, batched):
    train(steps=80, params=params)
    (env,) = environments
    assert isinstance(env.unwrapped, ArmVecEnv) == batched
    assert env.num_envs == 4


def test_observations_normalized(train, zoo, tmp_path):
    train(params="normalize:\"{'norm_reward': False}\"")
    (folder,) = (tmp_path / "logs" / "hemispheric_ppo").iterdir()
    assert (folder / "bilateral_rl-RandomReach-v0" / "vecnormalize.pkl").exists()
    said = zoo("enjoy --algo hemispheric_ppo --env bilateral_rl/RandomReach-v0 -f logs --no-render -n 50")
    assert "Loading running average" in said


def test_rewards_normalized(train, environments):
    train(params="normalize:True")
    from stable_baselines3.common.vec_env import VecNormalize

    (env, *_) = environments
    assert isinstance(env, VecNormalize)
    assert env.ret_rms.count > 100


def plots(zoo, arm):
    """Both plots of a training, which find it by the environment's name."""
    for command in (f"plot_train {arm} -f logs -w 2", f"all_plots {arm} -f logs --no-million -o all"):
        plt.close("all")
        said = zoo(command)
        assert [len(axes.lines) for axes in plt.gcf().axes] == [1], command
    assert re.search(r"RandomReach-v0\s*\|-\d+", said)


def test_evaluations_checkpoints_and_going_on(zoo, tmp_path):
    quick = "-params n_envs:4 n_steps:20 batch_size:40"
    arm = "--algo hemispheric_ppo --env bilateral_rl/RandomReach-v0"
    zoo(f"train {arm} -n 320 --eval-freq 160 --eval-episodes 2 --save-freq 160 {quick}")
    first = tmp_path / "logs" / "hemispheric_ppo" / "bilateral_rl-RandomReach-v0_1"
    names = {path.name for path in first.iterdir()}
    assert {"best_model.zip", "rl_model_160_steps.zip", "rl_model_320_steps.zip"} <= names
    assert np.load(first / "evaluations.npz")["timesteps"].tolist() == [160, 320]
    trained = ZOO_ALGORITHMS["hemispheric_ppo"].load(first / "bilateral_rl-RandomReach-v0.zip", device="cpu")
    plots(zoo, arm.replace("--algo", "-a"))
    zoo(f"train {arm} -n 80 --eval-freq -1 -i {first}/bilateral_rl-RandomReach-v0.zip {quick} learning_rate:1e-12")
    second = first.with_name("bilateral_rl-RandomReach-v0_2")
    went_on = ZOO_ALGORITHMS["hemispheric_ppo"].load(second / "bilateral_rl-RandomReach-v0.zip", device="cpu")
    for name, value in trained.policy.motor_network.state_dict().items():
        np.testing.assert_allclose(went_on.policy.motor_network.state_dict()[name], value, atol=1e-6)


def test_ones_own_environment_and_model(train, zoo, tmp_path, monkeypatch):
    package = tmp_path / "my_pendulum.py"
    package.write_text(
        "import gymnasium\n"
        "from bilateral_rl.envs import VectorReward\n"
        "def make(**settings):\n"
        "    env = gymnasium.make('Pendulum-v1', **settings)\n"
        "    return VectorReward(env, lambda t: (-t.observation[0], -t.action[0] ** 2))\n"
        "gymnasium.register('mine/Pendulum-v0', make)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    options = "--gym-packages my_pendulum"
    train("hemispheric_td3", "mine/Pendulum-v0", 240, "policy:\"'BilateralPolicy'\" loss:\"'combined'\"", options)
    zoo(f"record_video --algo hemispheric_td3 --env mine/Pendulum-v0 -f logs -n 5 {options}")
    (folder,) = (tmp_path / "logs" / "hemispheric_td3").iterdir()
    assert [path.suffix for path in (folder / "videos").iterdir()] == [".mp4"]
    model = ZOO_ALGORITHMS["hemispheric_td3"].load(folder / "mine-Pendulum-v0.zip", device="cpu")
    assert model.policy.motor_network.architecture == "bilateral"
    assert (model.loss, model.n_envs) == ("combined", 4)
    assert model.action_noise is not None
    assert "learning_starts" in (folder / "mine-Pendulum-v0" / "config.yml").read_text()
