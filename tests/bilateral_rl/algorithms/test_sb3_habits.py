"""Callbacks, wrappers and evaluation of stable-baselines3 work around the hemispheric algorithms."""

import warnings

import gymnasium
import numpy as np
import pytest
from hemispheric_models import make_model
from pendulum import make_pendulum
from stable_baselines3.common.callbacks import CheckpointCallback, EvalCallback, StopTrainingOnRewardThreshold
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import SubprocVecEnv, VecFrameStack, VecNormalize
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from bilateral_rl.algorithms import HemisphericPPO, HemisphericSAC
from bilateral_rl.envs import ArmVecEnv

ARM = "bilateral_rl/RandomReach-v0"
pytestmark = pytest.mark.filterwarnings("ignore:You have specified a mini-batch size")


@pytest.fixture(params=[HemisphericPPO, HemisphericSAC])  # A2C and TD3 collect and log by the same code
def make(request):
    """Builder of a small model of an on-policy and of an off-policy algorithm."""
    return lambda env, **settings: make_model(request.param, env=env, **settings)


def arms(n_envs=4):
    return ArmVecEnv(n_envs, trial_length=10, seed=0)


def test_evaluation_keeps_the_best_and_stops_at_a_threshold(make, tmp_path):
    enough = StopTrainingOnRewardThreshold(-1e9)
    evaluation = EvalCallback(
        arms(3), callback_on_new_best=enough, n_eval_episodes=6, eval_freq=20, best_model_save_path=tmp_path,
        log_path=tmp_path, verbose=0,
    )  # fmt: skip
    model = make(arms()).learn(800, callback=evaluation)
    assert model.num_timesteps < 160
    results = np.load(tmp_path / "evaluations.npz")
    assert results["timesteps"].tolist() == [80]
    assert results["ep_lengths"].tolist() == [[10] * 6]
    best = type(model).load(tmp_path / "best_model", device="cpu")
    mean, _ = evaluate_policy(best, arms(3), n_eval_episodes=6)
    assert mean == pytest.approx(results["results"].mean(), abs=1e-3)


def test_checkpoints(make, tmp_path):
    model = make(arms())
    model.learn(160, callback=CheckpointCallback(20, tmp_path, save_replay_buffer=True))
    names = {path.name for path in tmp_path.iterdir()}
    assert {"rl_model_80_steps.zip", "rl_model_160_steps.zip"} <= names
    assert ("rl_model_replay_buffer_80_steps.pkl" in names) == hasattr(model, "replay_buffer")
    assert type(model).load(tmp_path / "rl_model_80_steps", device="cpu").num_timesteps == 80


def test_a_gymnasium_wrapper_of_statistics(make):
    model = make(gymnasium.wrappers.RecordEpisodeStatistics(gymnasium.make(ARM))).learn(120)
    (episode, *_) = model.ep_info_buffer
    assert episode["l"] == 50
    assert episode["r"] == pytest.approx((episode["dominant"] + episode["non_dominant"]) / 2, abs=0.01)


def test_normalized_observations(make, tmp_path):
    env = VecNormalize(arms(), norm_reward=False)
    model = make(env).learn(160)
    assert env.obs_rms.count >= 160
    env.training = False
    env.save(tmp_path / "statistics.pkl")
    model.save(tmp_path / "model")
    again = VecNormalize.load(tmp_path / "statistics.pkl", arms())
    again.training = False
    loaded = type(model).load(tmp_path / "model", env=again, device="cpu")
    again.seed(0)
    env.seed(0)
    assert evaluate_policy(loaded, again, 4)[0] == pytest.approx(evaluate_policy(model, env, 4)[0])


def told(call):
    """What a call warns of normalization."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call()
    return [str(each.message) for each in caught if "normalized observations" in str(each.message)]


def test_normalization_that_is_lost_is_told(make, tmp_path):
    env = VecNormalize(arms())
    model = make(env)
    assert told(lambda: model.learn(80).learn(80, reset_num_timesteps=False)) == []
    env.save(tmp_path / "statistics.pkl")
    model.save(tmp_path / "model")
    load = type(model).load
    again = VecNormalize.load(tmp_path / "statistics.pkl", arms())
    assert told(lambda: load(tmp_path / "model", env=again).learn(80)) == []
    (lost,) = told(lambda: load(tmp_path / "model", env=arms()))
    assert lost.startswith("the model was trained on normalized observations, and its environment does not: wrap it by")
    (fresh,) = told(lambda: load(tmp_path / "model", env=VecNormalize(arms())))
    assert "begins with no statistics: load those of before" in fresh
    (lost_by_set_env,) = told(lambda: load(tmp_path / "model").set_env(arms()))
    assert lost_by_set_env == lost
    plain = make(arms()).learn(80)
    (gained,) = told(lambda: plain.set_env(VecNormalize(arms())))
    assert "the model was not trained on normalized observations, and its environment does" in gained
    assert told(lambda: plain.set_env(VecNormalize(arms(), norm_obs=False))) == []


def test_stacked_observations(make):
    model = make(VecFrameStack(arms(), 3)).learn(120)
    assert model.policy.motor_network.n_inputs == 48


def test_processes():
    env = SubprocVecEnv([make_pendulum])
    try:
        model = make_model(HemisphericPPO, env=env).learn(40)
    finally:
        env.close()
    assert model.num_timesteps == 40


@pytest.mark.filterwarnings("ignore:rich is experimental")
def test_a_progress_bar_and_tensorboard(make, tmp_path, capfd):
    make(arms(), tensorboard_log=tmp_path).learn(160, progress_bar=True, tb_log_name="run", log_interval=1)
    assert "160/160" in capfd.readouterr().out
    events = EventAccumulator(str(tmp_path / "run_1"))
    events.Reload()
    assert {"return/dominant", "return/non_dominant", "rollout/ep_rew_mean"} <= set(events.Tags()["scalars"])
