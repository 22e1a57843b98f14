"""Infos of every face say which of two hands is to hold, and those of one arm say nothing of it."""

import numpy as np
import pytest
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from rich_tasks import RichPair
from stable_baselines3.common.vec_env import DummyVecEnv

from bilateral_rl.analysis.trial_plans import plan_of
from bilateral_rl.envs import ArmEnv, ArmVecEnv, ArmVectorEnv
from bilateral_rl.envs.trial_checks import checked_trials

LENGTH, N, TASK = 3, 8, "reach_and_hold"
STILL = np.zeros((N, 12), dtype=np.float32)
SAME, NEXT, DISABLED = AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED


class Cued(RichPair):
    """A cue comes late, if at all, and in half of the trials a hand's goal is its start; there are no channels."""

    id = "cued"

    def trials(self, uniform, settings):
        trials = super().trials(uniform, settings)
        stays = uniform[:, [3, 5]] < 0.5  # numbers of goals, of which nothing is left then
        forces = trials.forces._replace(walls=np.zeros_like(trials.forces.walls))
        return trials._replace(goal=np.where(stays[..., None], trials.start, trials.goal), forces=forces)


def of_infos(infos):
    return np.array([info["holds"] for info in infos])


def at_the_start(batch):
    """Which targets are where the hands are, as trials without a cue begin."""
    return (batch.target == batch.hand).all(axis=1).reshape(-1, 2)


def sb3_trials(venv, n):
    """What was said when each of ``n`` trials began, and when it ended."""
    venv.reset()
    for _ in range(n):
        begun = of_infos(venv.reset_infos)
        for _ in range(LENGTH):
            _, _, dones, infos = venv.step(STILL)
        assert dones.all()
        yield begun, of_infos(infos)


def test_the_hand_whose_goal_is_its_start_holds_from_reset_to_the_last_step():
    env, said = ArmEnv(TASK, trial_length=LENGTH), []
    for trial in range(12):
        _, info = env.reset(seed=9 if trial == 0 else None)
        assert info["holds"].dtype == np.bool_
        np.testing.assert_array_equal([info["holds"]], at_the_start(env.batch))
        said.append(info["holds"].tolist())
        told = [env.step(STILL[0])[-1].get("holds") for _ in range(LENGTH)]
        assert told[:-1] == [None] * (LENGTH - 1)
        assert told[-1].tolist() == said[-1]
    assert sorted(map(tuple, set(map(tuple, said)))) == [(False, True), (True, False)]


@pytest.mark.parametrize(
    ("task", "settings", "holds"),
    [
        (TASK, {"two_arms": {"roles": "dominant_reaches"}}, [False, True]),
        (TASK, {"two_arms": {"roles": "non_dominant_reaches"}}, [True, False]),
        ("two_reaches", {}, [False, False]),
        ("two_holds", {}, [True, True]),
    ],
)
def test_where_it_is_always_the_same_it_is_always_said(task, settings, holds):
    for trial in sb3_trials(ArmVecEnv(N, task, seed=0, trial_length=LENGTH, **settings), 2):
        np.testing.assert_array_equal(trial, np.broadcast_to(holds, (2, N, 2)))


@pytest.mark.parametrize("task", [TASK, Cued()], ids=["reach and hold", "with cues"])
def test_sb3_is_told_of_each_trial_that_begins_and_ends_as_by_its_own_environments(task):
    ours = ArmVecEnv(N, task, seed=4, trial_length=LENGTH)
    theirs = DummyVecEnv([lambda: ArmEnv(task, trial_length=LENGTH)] * N)
    theirs.seed(4)
    begun, ended = [], []
    for mine, reference in zip(sb3_trials(ours, 3), sb3_trials(theirs, 3), strict=True):
        np.testing.assert_array_equal(mine, reference)
        begun.append(mine[0])
        ended.append(mine[1])
    np.testing.assert_array_equal(begun, ended)
    assert len(np.unique(np.reshape(begun, (-1, 2)), axis=0)) == (2 if task == TASK else 4)


def test_an_environment_that_goes_on_from_a_saved_state_knows_who_holds():
    venv, twin = (ArmVecEnv(N, Cued(), seed=seed, trial_length=LENGTH) for seed in (4, 5))
    venv.reset()
    for _ in range(LENGTH + 1):
        venv.step(STILL)
    twin.set_state_arrays(venv.state_arrays())
    np.testing.assert_array_equal(of_infos(twin.reset_infos), of_infos(venv.reset_infos))
    for env in (venv, twin):
        env.step(STILL)
    ours, theirs = (of_infos(env.step(STILL)[3]) for env in (venv, twin))
    np.testing.assert_array_equal(theirs, ours)


@pytest.mark.parametrize("mode", [SAME, NEXT, DISABLED], ids=lambda mode: mode.value)
def test_gymnasium_is_told_of_each_trial_that_begins_and_ends_and_whose_it_is(mode):
    venv = ArmVectorEnv(N, TASK, autoreset_mode=mode, trial_length=LENGTH)
    _, infos = venv.reset(seed=4)
    begun, some = infos["holds"], np.arange(N) < 3
    assert infos["_holds"].all()
    venv.step(STILL)
    _, again = venv.reset(options={"reset_mask": some})
    np.testing.assert_array_equal(again["_holds"], some)
    begun[some] = again["holds"][some]
    for _ in range(3 * LENGTH):
        before, runs = begun.copy(), venv._ended.copy()
        _, _, _, ended, infos = venv.step(STILL)
        starts = {SAME: ended, NEXT: runs, DISABLED: np.zeros(N, dtype=bool)}[mode]
        last = infos.get("final_info", {}) if mode is SAME else infos
        if ended.any():
            np.testing.assert_array_equal(last["holds"][ended], before[ended])
        if starts.any():
            np.testing.assert_array_equal(infos["_holds"], starts if mode is SAME else starts | ended)
            begun[starts] = infos["holds"][starts]
            np.testing.assert_array_equal(begun[starts], at_the_start(venv.batch)[starts])
        if mode is DISABLED and ended.any():
            begun[ended] = venv.reset(options={"reset_mask": ended})[1]["holds"][ended]


@pytest.mark.parametrize("mode", [SAME, NEXT, DISABLED], ids=lambda mode: mode.value)
def test_gymnasium_is_told_the_same_by_its_own_environments(mode):
    ours = ArmVectorEnv(N, Cued(), autoreset_mode=mode, trial_length=LENGTH)
    theirs = SyncVectorEnv([lambda: ArmEnv(Cued(), trial_length=LENGTH)] * N, autoreset_mode=mode)
    pairs = [[env.reset(seed=4)[1] for env in (ours, theirs)]]
    pairs += [[env.step(STILL)[-1] for env in (ours, theirs)] for _ in range(LENGTH if mode is DISABLED else 9)]
    for mine, reference in pairs:
        for name in ("holds", "_holds"):
            np.testing.assert_array_equal(mine.get(name), reference.get(name))
            one, other = (infos.get("final_info", {}).get(name) for infos in (mine, reference))
            np.testing.assert_array_equal(one, other)


def test_it_is_the_role_that_tables_and_recordings_have():
    env = ArmEnv(Cued())
    for seed in range(20):
        _, info = env.reset(seed=seed)
        uniform = np_random(seed)[0].random((1, env.task.n_uniform))
        rows = checked_trials(env.task.trials(uniform, env.settings), 1, env.task, env.settings)
        role = plan_of(rows, np.full(2, -1, dtype=np.int32), env.settings, n_arms=2).role
        np.testing.assert_array_equal(info["holds"], role == "hold")


def test_it_goes_where_words_do_not_into_tensors():
    torch = pytest.importorskip("torch")
    pytest.importorskip("array_api_compat")  # which Gymnasium's conversions need
    from gymnasium.wrappers import NumpyToTorch
    from gymnasium.wrappers.vector import NumpyToTorch as NumpyToTorchOfMany

    _, info = NumpyToTorch(ArmEnv(TASK)).reset(seed=4)
    _, infos = NumpyToTorchOfMany(ArmVectorEnv(2, TASK, autoreset_mode=NEXT)).reset(seed=4)
    assert infos["holds"].dtype == torch.bool
    assert infos["holds"][0].tolist() == info["holds"].tolist()


def test_nothing_is_said_of_one_arm():
    assert ArmEnv("hold_position").reset()[1] == {}
    assert ArmVectorEnv(2, "hold_position").reset()[1] == {}
    venv = ArmVecEnv(2, "hold_position", trial_length=1)
    venv.reset()
    _, _, _, infos = venv.step(STILL[:2, :6])
    assert venv.reset_infos == [{}, {}]
    assert not any("holds" in info for info in infos)
