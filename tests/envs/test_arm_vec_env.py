"""The stable-baselines3 face: a batch of arms is so many ArmEnvs, and SB3 trains on it."""

import copy
import csv
import pickle

import numpy as np
import pytest
from arm_faces import SETTINGS, assert_same, each_setting
from one_arm_tasks import ONE_ARM_TASKS
from rich_tasks import RICH_SETTINGS, Rich, RichPair
from stable_baselines3 import PPO
from stable_baselines3.common.logger import configure
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecNormalize

from bilateral_rl.envs import ArmEnv, ArmVecEnv

LENGTH = 5
MEASURES = ("is_success", "speed_to_goal", "time_in_goal", "final_error")
CASES = {
    **{
        f"{getattr(task, 'id', task)}, {name}": (task, settings)
        for task in (*ONE_ARM_TASKS, Rich())
        for name, settings in SETTINGS.items()
    },
    "two arms": ("reach_and_hold", SETTINGS["noisy and delayed"]),
    "two rich arms": (RichPair(), RICH_SETTINGS),
}


def actions(steps, n, seed=0, arms=1):
    return np.random.default_rng(seed).uniform(-1.2, 1.2, (steps, n, 6 * arms)).astype(np.float32)


def make(n, task="random_reach", seed=7, **settings):
    venv = ArmVecEnv(n, task, seed=seed, trial_length=LENGTH, **settings)
    venv.reset()
    return venv


def run(venv, commands):
    """Observations, rewards, dones and infos of each step, without the wall-clock times."""
    steps = [venv.step(command) for command in commands]
    for *_, infos in steps:
        for info in infos:
            if "episode" in info:
                del info["episode"]["t"]
    return steps


def assert_arm_is_env(step, arm, vector_reward, env_step, next_observation):
    """Arm ``arm`` of a batch did what a single environment did; where its trial ended, the next one began."""
    (observations, rewards, dones, infos), (observation, reward, _, truncated, info) = step, env_step
    assert rewards[arm] == np.float32(reward) == vector_reward[arm].mean()
    np.testing.assert_array_equal(vector_reward[arm], info["vector_reward"])
    assert dones[arm] == truncated
    if not truncated:
        np.testing.assert_array_equal(observations[arm], observation)
        assert infos[arm] == {}
        return
    np.testing.assert_array_equal(infos[arm]["terminal_observation"], observation)
    np.testing.assert_array_equal(observations[arm], next_observation)
    np.testing.assert_array_equal(infos[arm]["vector_return"], info["vector_return"])
    for name in MEASURES:
        np.testing.assert_equal(infos[arm][name], info[name])


@pytest.mark.parametrize(("task", "settings"), CASES.values(), ids=map(str, CASES))
def test_a_batch_is_so_many_single_environments_over_several_trials(task, settings):
    n = 4
    venv = ArmVecEnv(n, task, seed=7, trial_length=LENGTH, **settings)
    envs = [ArmEnv(task, trial_length=LENGTH, **settings) for _ in range(n)]
    np.testing.assert_array_equal(venv.reset(), [env.reset(seed=7 + i)[0] for i, env in enumerate(envs)])
    for command in actions(4 * LENGTH + 2, n, arms=venv.batch.n_arms):
        step = venv.step(command)
        for arm, env in enumerate(envs):
            alone = env.step(command[arm])
            next_observation = env.reset()[0] if alone[3] else None
            assert_arm_is_env(step, arm, venv.last_vector_reward, alone, next_observation)


@pytest.mark.parametrize("task", [Rich(), RichPair()], ids=["one arm", "two arms"])
def test_an_arm_s_trials_do_not_depend_on_how_many_arms_there_are(task):
    few, many = (ArmVecEnv(n, task, seed=7, trial_length=LENGTH, **RICH_SETTINGS) for n in (2, 9))
    np.testing.assert_array_equal(few.reset(), many.reset()[:2])
    for command in actions(4 * LENGTH, 9, arms=task.n_arms):
        ours, theirs = few.step(command[:2]), many.step(command)
        for i in range(3):
            np.testing.assert_array_equal(ours[i], theirs[i][:2])
        np.testing.assert_array_equal(few.batch.force, many.batch.force[: few.batch.n_hands])


def test_a_long_run_of_trials_is_the_single_environments():
    """Further than any number of trials that might be drawn ahead."""
    venv, env = ArmVecEnv(2, seed=0, trial_length=1), ArmEnv(trial_length=1)
    observation, command = venv.reset()[1], np.zeros((2, 6), dtype=np.float32)
    np.testing.assert_array_equal(observation, env.reset(seed=1)[0])
    for _ in range(200):
        observation = venv.step(command)[0][1]
        np.testing.assert_array_equal(observation, env.reset()[0])


@each_setting
def test_arms_with_clocks_of_their_own_stay_single_environments(settings):
    """Arm 1 starts its next trial three steps into the first one, and every trial of it ends at another step."""
    venv = make(2, **settings)
    envs = [ArmEnv(trial_length=LENGTH, **settings) for _ in range(2)]
    for i, env in enumerate(envs):
        env.reset(seed=7 + i)
    ends = []
    for t, command in enumerate(actions(3 * LENGTH, 2)):
        if t == 3:
            venv._streams.start(np.array([1], dtype=np.int32))
            np.testing.assert_array_equal(venv.batch.observation[1], envs[1].reset()[0])
            assert venv.batch.clock.tolist() == [3, 0]
        step = venv.step(command)
        for arm, env in enumerate(envs):
            alone = env.step(command[arm])
            next_observation = env.reset()[0] if alone[3] else None
            assert_arm_is_env(step, arm, venv.last_vector_reward, alone, next_observation)
        ends.append(step[2].tolist())
    assert [t for t, (first, _) in enumerate(ends) if first] == [4, 9, 14]
    assert [t for t, (_, second) in enumerate(ends) if second] == [7, 12]


def test_the_end_of_a_trial_is_told_as_sb3_expects_it():
    venv = make(3)
    steps = run(venv, actions(LENGTH, 3))
    rewards = np.array([reward for _, reward, _, _ in steps])
    assert [done.tolist() for _, _, done, _ in steps] == [[False] * 3] * (LENGTH - 1) + [[True] * 3]
    assert all(info == {} for *_, infos in steps[:-1] for info in infos)
    observations, _, _, infos = steps[-1]
    for arm, info in enumerate(infos):
        assert set(info) == {
            "terminal_observation", "TimeLimit.truncated", "episode", "vector_return", *MEASURES,
        }  # fmt: skip
        assert info["TimeLimit.truncated"] is True
        assert info["terminal_observation"].shape == (16,)
        assert not np.array_equal(info["terminal_observation"], observations[arm])
        assert info["episode"]["l"] == LENGTH
        assert info["episode"]["r"] == pytest.approx(rewards[:, arm].sum(), rel=1e-5)
        streams = info["episode"]["dominant"], info["episode"]["non_dominant"]
        assert streams == tuple(info["vector_return"].tolist())
        assert info["episode"]["r"] == pytest.approx(sum(streams) / 2)


def test_episode_times_do_not_run_backwards():
    venv = make(2)
    times = [info["episode"]["t"] for c in actions(3 * LENGTH, 2) for info in venv.step(c)[3] if info]
    assert times == sorted(times)
    assert len(times) == 6
    assert times[0] >= 0


def test_the_end_of_a_trial_of_two_arms_says_so_by_hand():
    venv = make(3, "two_reaches")
    infos = run(venv, actions(LENGTH, 3, arms=2))[-1][3]
    for info in infos:
        assert set(info) == {
            "terminal_observation", "TimeLimit.truncated", "episode", "vector_return", "goal_completion", "holds",
            *MEASURES,
        }  # fmt: skip
        assert info["terminal_observation"].shape == (40,)
        assert info["is_success"] is bool(info["goal_completion"].all())
        assert {info[name].shape for name in MEASURES[1:]} == {(2,)}


def test_returned_types_are_those_of_a_vecenv():
    venv = make(3)
    observations, rewards, dones, infos = venv.step(actions(1, 3)[0])
    assert (observations.shape, observations.dtype) == ((3, 16), np.float32)
    assert (rewards.shape, rewards.dtype) == ((3,), np.float32)
    assert (dones.shape, dones.dtype) == ((3,), np.bool_)
    assert [type(info) for info in infos] == [dict] * 3
    assert (venv.last_vector_reward.shape, venv.last_vector_reward.dtype) == ((3, 2), np.float32)
    assert venv.observation_space == ArmEnv().observation_space
    assert venv.action_space == ArmEnv().action_space


def test_the_same_seed_gives_the_same_trials_and_another_other_ones():
    one, two, other = make(3), make(3), make(3, seed=8)
    assert_same(run(one, actions(12, 3)), run(two, actions(12, 3)))
    np.testing.assert_array_equal(make(3, seed=7).batch.observation[1:], other.batch.observation[:2])
    assert not np.array_equal(ArmVecEnv(2).reset(), ArmVecEnv(2).reset())


def test_seeding_takes_effect_at_the_next_reset_and_only_there():
    venv = make(2)
    first = venv.batch.observation.copy()
    assert not np.array_equal(venv.reset(), first)
    assert venv.seed(7) == [7, 8]
    np.testing.assert_array_equal(venv.reset(), first)
    assert not np.array_equal(venv.reset(), first)


@each_setting
def test_resetting_in_the_middle_begins_the_next_trial_of_each_stream(settings):
    cut, whole = make(2, **settings), make(2, **settings)
    run(cut, actions(2, 2))
    after = run(whole, actions(LENGTH, 2))[-1][0]
    np.testing.assert_array_equal(cut.reset(), after)
    assert_same(run(cut, actions(2 * LENGTH, 2)), run(whole, actions(2 * LENGTH, 2)))


@pytest.mark.parametrize(
    ("task", "settings"), [*(("random_reach", settings) for settings in SETTINGS.values()), (RichPair(), RICH_SETTINGS)]
)
def test_copies_made_in_the_middle_of_a_trial_go_on_identically(task, settings):
    venv = make(3, task, **settings)
    arms = venv.batch.n_arms
    run(venv, actions(LENGTH + 2, 3, arms=arms))
    unpickled, copied = pickle.loads(pickle.dumps(venv)), copy.deepcopy(venv)
    expected = run(venv, actions(3 * LENGTH, 3, seed=1, arms=arms))
    for twin in (unpickled, copied):
        assert_same(expected, run(twin, actions(3 * LENGTH, 3, seed=1, arms=arms)))


def test_what_a_call_returned_is_never_changed_by_later_ones():
    venv = ArmVecEnv(2, seed=0, trial_length=LENGTH)
    kept = [venv.reset()]
    snapshots = copy.deepcopy(kept)
    for command in actions(3 * LENGTH, 2):
        returned = [venv.step(command), venv.last_vector_reward]
        kept.append(returned)
        snapshots.append(copy.deepcopy(returned))
    assert_same(kept, snapshots)


def test_writing_to_what_a_call_returned_does_not_disturb_the_arms():
    vandal, witness = make(2), make(2)
    for command in actions(3 * LENGTH, 2):
        given = command.copy()
        step = vandal.step(given)
        given[:] = 99
        expected = witness.step(command)
        assert_same(step[:3], expected[:3])
        for array in step[:3]:
            array[:] = 1
        for info in step[3]:
            info.clear()


def test_a_step_before_the_first_reset_is_an_error():
    with pytest.raises(RuntimeError, match="reset"):
        ArmVecEnv(2).step(np.zeros((2, 6), dtype=np.float32))


def test_actions_of_another_shape_are_an_error():
    venv = make(3)
    for shape in ((6,), (1, 6), (2, 6), (3, 1)):
        with pytest.raises(ValueError, match="shape"):
            venv.step(np.zeros(shape, dtype=np.float32))


def test_attributes_belong_to_all_arms():
    venv = make(3)
    assert venv.get_attr("render_mode") == [None] * 3
    assert venv.get_attr("settings", indices=[0, 2]) == [venv.settings] * 2
    assert venv.get_attr("threshold", 1) == [0.05]
    with pytest.raises(ValueError, match="share"):
        venv.set_attr("reset_infos", [], indices=[1])
    with pytest.raises(AttributeError, match="step"):
        venv.env_method("step")
    assert venv.env_is_wrapped(Monitor) == [True] * 3
    assert venv.env_is_wrapped(VecNormalize) == [False] * 3


def test_stock_ppo_learns_and_logs_the_success_rate(tmp_path):
    venv = ArmVecEnv(8, trial_length=10)
    model = PPO("MlpPolicy", venv, n_steps=20, batch_size=80, n_epochs=2, seed=0, device="cpu")
    model.set_logger(configure(str(tmp_path), ["csv"]))
    before = [p.detach().clone() for p in model.policy.parameters()]
    model.learn(2 * 8 * 20)
    assert model.num_timesteps == 320
    assert any((p != q).any() for p, q in zip(model.policy.parameters(), before, strict=True))
    with (tmp_path / "progress.csv").open() as file:
        log = list(csv.DictReader(file))[-1]
    assert 0 <= float(log["rollout/success_rate"]) <= 1
    assert float(log["rollout/ep_len_mean"]) == 10
    assert float(log["rollout/ep_rew_mean"]) < 0


def test_reset_options_are_refused_rather_than_ignored():
    """ArmEnv's options set its trial; a VecEnv takes them through set_options."""
    venv = make(2)
    venv.set_options({"start": (1.0, 1.0)})
    with pytest.raises(ValueError, match="options"):
        venv.reset()


def test_sb3s_seed_seeds_the_arms():
    model = PPO("MlpPolicy", ArmVecEnv(2), n_steps=4, batch_size=8, seed=11, device="cpu")
    model._setup_learn(8)
    np.testing.assert_array_equal(model._last_obs, [ArmEnv().reset(seed=seed)[0] for seed in (11, 12)])
