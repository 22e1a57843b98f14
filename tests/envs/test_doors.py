"""What users bring is checked at the door: it works, or is refused by its name, and no kernel sees it."""

import dataclasses
import gc
import pickle

import gymnasium
import numpy as np
import pytest
import torch
from given_actions import acting

from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.bptt.trials import training_trials
from bilateral_rl.envs import Arm, ArmEnv, ArmParameters, ArmVecEnv, ArmVectorEnv, Task, Trials, TrialSettings
from bilateral_rl.envs.tasks import PLACES
from bilateral_rl.envs.trials import TrialBatch

POSTURE = [0.8, 1.5]
START = np.array([POSTURE], np.float32)


class Gives(Task):
    """Trials of postures and loads that are given, whatever is drawn."""

    def __init__(self, start=START, goal=START, load=(0.0, 0.0), n_uniform=4):
        self.given, self.n_uniform = (start, goal, load), n_uniform

    def trials(self, uniform, settings):
        return Trials(*(part(len(uniform)) if callable(part) else part for part in self.given))


def still(n):
    """A policy that does nothing."""
    return acting(np.zeros((n, 6), np.float32))


DOORS = {
    "ArmEnv": lambda task: ArmEnv(task).reset(seed=0),
    "ArmVecEnv": lambda task: ArmVecEnv(4, task).reset(),
    "ArmVectorEnv": lambda task: ArmVectorEnv(4, task).reset(seed=0),
    "Evaluator": lambda task: Evaluator(task, TrialSettings(), 4, seed=0).run(still(4)),
    "supervised training": lambda task: training_trials(0, 4, task, TrialSettings()),
}
each_door = pytest.mark.parametrize("door", DOORS.values(), ids=DOORS)


@pytest.mark.parametrize("rows", [START, POSTURE, [POSTURE] * 4, np.array([POSTURE] * 8)[::2], np.float16([POSTURE])])
def test_one_row_is_for_all_trials_and_any_real_numbers_do(rows):
    env = ArmVecEnv(4, Gives(start=rows, goal=(1, 1)))
    env.reset()
    np.testing.assert_allclose(env.batch.joint, [[*POSTURE, 0, 0]] * 4, rtol=1e-3)
    (start, *_) = training_trials(0, 4, Gives(start=rows, goal=(1, 1)), TrialSettings())
    np.testing.assert_allclose(start, [POSTURE] * 4, rtol=1e-3)


@each_door
@pytest.mark.parametrize("field", PLACES)
@pytest.mark.parametrize(
    "value",
    [lambda n: np.zeros(n + 2), lambda n: np.zeros((n + 1, 2)), 0.5, np.zeros((4, 3)), [np.nan, 0.5], [1e300, 0.5]],
)
def test_trials_that_no_arm_can_do_are_refused_at_every_door_by_their_name(door, field, value):
    with pytest.raises(ValueError, match=f"^{field} must"):
        door(Gives(**{field: value}))


@each_door
def test_postures_outside_the_joints_range_are_refused_at_every_door(door):
    for field in ("start", "goal"):
        for posture in ([-0.1, 1], [1, 2.8]):
            with pytest.raises(ValueError, match=rf"^{field} must lie within the joint limits, \[0.0, 0.0\] to \[2.35"):
                door(Gives(**{field: posture}))


@each_door
@pytest.mark.parametrize("value", [None, "abc", [[1, None]], np.array([[1j, 1]]), np.ones((1, 2), dtype=bool)])
def test_what_is_no_number_is_refused_at_every_door(door, value):
    with pytest.raises((TypeError, ValueError), match="start must be an array of real numbers"):
        door(Gives(start=value))


@each_door
def test_what_is_no_trials_is_refused_at_every_door(door):
    for returned in (None, [START, START, START], (START, START)):
        task = Gives()
        task.trials = lambda uniform, settings, returned=returned: returned
        with pytest.raises(TypeError, match="must return Trials"):
            door(task)


def test_a_task_says_how_many_numbers_it_takes_and_keeps_to_it():
    for n_uniform in (-1, 2.0, "4", None, True):
        with pytest.raises((TypeError, ValueError), match="n_uniform of a task must be"):
            ArmVecEnv(2, Gives(n_uniform=n_uniform))
    assert ArmVecEnv(2, Gives(n_uniform=np.int8(0))).reset().shape == (2, 16)
    env = ArmEnv(Gives())
    env.batch.task.n_uniform = 5
    with pytest.raises(ValueError, match="n_uniform of a task cannot change"):
        env.reset()
    with pytest.raises(TypeError, match=r"give Gives\(\), not Gives"):
        ArmEnv(Gives)


@pytest.mark.parametrize("arms", [[2], [-1], [0, 0], [[0]], 0, [0.0], [True], ["0"], [2**31], np.uint64([2**63])])
def test_a_batch_starts_different_arms_that_there_are(arms):
    batch = TrialBatch(Gives(), TrialSettings(), 2)
    with pytest.raises((TypeError, ValueError), match=r"^arms must be"):
        batch.start(arms, Trials(START, START, START))


def test_a_batch_starts_some_arms_and_the_others_stand_still():
    batch = TrialBatch(Gives(), TrialSettings(trial_length=3), 3)
    with pytest.raises(RuntimeError, match="no trial has begun"):
        batch.step(np.zeros((3, 6)))
    batch.start([], Trials(START, START, START))
    batch.start([2, 0], Trials(START, START, (1.0, 0.0)))
    assert batch.clock.tolist() == [0, 3, 0]
    batch.step(np.zeros((3, 6)))
    batch.start([2], Trials([[1.0, 1.0]], START, START))
    for clocks in ([2, 3, 1], [3, 3, 2], [3, 3, 3]):
        batch.step(np.ones((3, 6)))
        assert batch.clock.tolist() == clocks
        assert (batch.vector_reward[1] == 0).all()
    assert (batch.joint[1] == 0).all()
    assert batch.reward[0] == 0 > batch.reward[2]  # whose trial is over, and goes on
    with pytest.raises(RuntimeError, match="all are over"):
        batch.step(np.zeros((3, 6)))


def test_noise_is_given_where_the_settings_have_it_and_only_there():
    trials, noise = Trials(START, START, START), np.zeros((1, 4, 20))
    noisy = TrialBatch(Gives(), TrialSettings(trial_length=3, motor_noise=0.1), 2)
    noisy.start([1], trials, noise)
    for wrong in (None, noise[:, 1:], noise[0], np.zeros((2, 4, 20)), noise * np.nan):
        with pytest.raises(ValueError, match=r"^noise must be .*\(1, 4, 20\)"):
            noisy.start([1], trials, wrong)
    with pytest.raises(ValueError, match="noise must be None"):
        TrialBatch(Gives(), TrialSettings(trial_length=3), 2).start([1], trials, noise)


@pytest.mark.parametrize(
    "action", [np.zeros((2, 6), complex), np.zeros((2, 6), object), np.zeros((2, 6), "M8[s]"), [["a"] * 6] * 2, None]
)
def test_actions_that_are_no_numbers_are_refused(action):
    env = ArmVecEnv(2)
    env.reset()
    with pytest.raises(TypeError, match="actions must be an array of real numbers"):
        env.step(action)


def test_actions_of_any_real_type_do():
    env, twin = ArmVecEnv(2, seed=0), ArmVecEnv(2, seed=0)
    env.reset(), twin.reset()
    for action in ([[1] * 6] * 2, torch.ones(2, 6), np.full((2, 6), 1e300), np.ones((6, 2), np.int8).T):
        np.testing.assert_array_equal(env.step(action)[0], twin.step(np.ones((2, 6), np.float32))[0])


RUNNING = {
    "ArmEnv": ArmEnv,
    "ArmVecEnv": lambda **settings: ArmVecEnv(3, **settings),
    "ArmVectorEnv": lambda **settings: ArmVectorEnv(3, **settings),
}
each_running = pytest.mark.parametrize("make", RUNNING.values(), ids=RUNNING)


@each_running
@pytest.mark.parametrize("name", ["settings", "batch", "task", "n", "device", "render_mode", "threshold", "arm"])
def test_what_arms_run_by_cannot_be_replaced_and_the_words_say_what_to_do(make, name):
    env = make()
    with pytest.raises(
        AttributeError, match=f"^{name} of a running Arm.*Env cannot be changed: make a new environment"
    ):
        setattr(env, name, 60)
    if isinstance(env, ArmVecEnv):
        for indices in (None, [1]):
            with pytest.raises(AttributeError, match=f"^{name} of a running"):
                env.set_attr(name, 60, indices)
    elif isinstance(env, ArmEnv):
        with pytest.raises(AttributeError, match=f"^{name} of a running"):
            env.set_wrapper_attr(name, 60)


@each_running
def test_settings_can_be_read_by_name(make):
    env = make(task="hold_position", threshold=0.02, max_load=3)
    assert (env.threshold, env.max_load, env.trial_length, env.arm) == (0.02, 3, 50, ArmParameters())
    assert env.task.id == "hold_position"
    for copy in (env, pickle.loads(pickle.dumps(env))):
        assert copy.threshold == 0.02
        with pytest.raises(AttributeError, match="thresold"):
            copy.thresold  # noqa: B018


def test_attributes_are_read_and_set_as_in_stable_baselines3():
    env = ArmVecEnv(3, threshold=0.02)
    assert env.get_attr("threshold") == [0.02] * 3
    with pytest.raises(AttributeError, match="'thresold': setting it would have no effect"):
        env.set_attr("thresold", 0.01)


def test_gymnasiums_wrappers_find_settings_and_cannot_hide_them():
    env = gymnasium.make("bilateral_rl/RandomReach-v0", threshold=0.02)
    assert env.get_wrapper_attr("threshold") == 0.02
    with pytest.raises(AttributeError, match="threshold of a running ArmEnv cannot be changed"):
        env.set_wrapper_attr("threshold", 0.01)


@pytest.mark.parametrize("name", ["joint", "load", "clock", "observation", "task", "settings", "n", "device"])
def test_the_arrays_of_a_batch_are_written_into_and_not_replaced(name):
    batch = ArmVecEnv(3).batch
    with pytest.raises(AttributeError, match=f"^{name} of running arms cannot be replaced"):
        setattr(batch, name, getattr(batch, name))


def test_a_load_that_is_written_in_acts_on_the_next_step():
    env, twin = ArmVecEnv(2, seed=0), ArmVecEnv(2, seed=0)
    env.reset(), twin.reset()
    env.batch.load[1] = 5.0
    for _ in range(3):
        one, two = env.step(np.zeros((2, 6)))[0], twin.step(np.zeros((2, 6)))[0]
    np.testing.assert_array_equal(one[0], two[0])
    assert (one[1, 12:14] != two[1, 12:14]).all()


def test_an_array_of_a_batch_outlives_it():
    batch = ArmVecEnv(500).batch
    load = batch.load
    load[:] = 3.0
    del batch
    gc.collect()
    others = [ArmVecEnv(500) for _ in range(3)]
    assert (load == 3).all()
    assert others


def test_a_clock_that_was_tampered_with_stays_inside_the_arrays():
    env = ArmVecEnv(3, seed=0)
    env.reset()
    with pytest.raises(ValueError, match="read-only"):
        env.batch.clock[:] = 10
    env.batch.state_arrays()["clock"][:] = [10**6, -(10**6), 3]
    env.step(np.zeros((3, 6)))
    assert env.batch.clock[2] == 4
    assert env.batch.reward.tolist()[:2] == [0, 0]


def test_settings_that_were_changed_by_force_are_checked_again():
    for target, name, value in (
        (settings := TrialSettings(), "trial_length", -1),
        (settings, "trial_length", 50),
        (settings, "feedback_delay", 1.5),
        (settings.arm, "link_length", (0.3, 0.3, 0.3)),
        (settings.arm, "timestep", np.nan),
    ):
        kept = getattr(target, name)
        object.__setattr__(target, name, value)
        if value == 50:
            TrialBatch(Gives(), settings, 2)
        else:
            with pytest.raises(ValueError, match=name):
                TrialBatch(Gives(), settings, 2)
            if target is settings.arm:
                with pytest.raises(ValueError, match=name):
                    Arm(settings.arm)
        object.__setattr__(target, name, kept)
    with pytest.raises(TypeError, match="settings must be TrialSettings, got dict"):
        TrialBatch(Gives(), {"trial_length": 3}, 2)


def test_settings_that_are_changed_by_force_later_change_nothing():
    settings = TrialSettings(trial_length=3)
    batch = TrialBatch(Gives(), settings, 2)
    object.__setattr__(settings, "trial_length", 60)
    assert batch.settings.trial_length == 3
    env = ArmVecEnv(2, trial_length=3)
    env.reset()
    object.__setattr__(env.settings, "trial_length", 60)
    for _ in range(3):
        env.step(np.zeros((2, 6)))
    with pytest.raises(RuntimeError, match="all are over"):
        env.step(np.zeros((2, 6)))


def test_a_subclass_of_the_settings_reaches_the_task():
    @dataclasses.dataclass(frozen=True)
    class Further(TrialSettings):
        distance: float = 0.1

    batch = TrialBatch(Gives(), Further(trial_length=3, distance=0.2), 2)
    assert (batch.settings.distance, batch.settings.trial_length, batch.distance.shape) == (0.2, 3, (2, 3))


@pytest.mark.parametrize("n", [np.int64(3), np.uint8(3), np.array(3), torch.tensor(3), 3])
def test_the_number_of_arms_is_any_whole_number(n):
    assert ArmVecEnv(n).reset().shape == ArmVectorEnv(n).reset()[0].shape == (3, 16)


@pytest.mark.parametrize("n", [3.0, "3", None, True, np.bool_(True), [3], -1, 0])
def test_anything_else_is_no_number_of_arms(n):
    with pytest.raises((TypeError, ValueError), match=r"the number of arms must be a whole number|at least"):
        ArmVecEnv(n)


def test_more_arms_than_any_memory_holds_are_refused():
    for n in (1_000_001, 2**31, 2**40, 10**30):
        with pytest.raises(ValueError, match=r"at most 1,000,000 arms can run at once, got [\d,]+\."):
            ArmVecEnv(n)


def test_a_device_is_a_name_or_torchs_device():
    for device in ("cpu", "cpu:0", torch.device("cpu")):
        assert ArmVecEnv(2, device=device).device == "cpu"
        assert Arm(device=device).device == torch.device("cpu")
    for device in ("gpu", "meta", "mps", "cuda:99", None, 3.5, "auto"):
        for make in (lambda device: ArmVecEnv(2, device=device), lambda device: Arm(device=device)):
            with pytest.raises(ValueError, match="device must be 'cpu' or a CUDA device of this machine"):
                make(device)


def test_settings_are_numbers_of_any_kind():
    env = ArmVecEnv(
        2, "hold_position",
        threshold=np.float32(0.1), trial_length=torch.tensor(7), feedback_delay=np.array(2), max_load=np.int8(3),
        load=np.str_("direction"), arm={"timestep": np.float64(0.005), "link_length": (np.float32(0.3), 0.4)},
    )  # fmt: skip
    expected = TrialSettings(
        threshold=float(np.float32(0.1)), trial_length=7, feedback_delay=2, max_load=3.0, load="direction",
        arm=ArmParameters(timestep=0.005, link_length=(float(np.float32(0.3)), 0.4)),
    )  # fmt: skip
    assert env.settings == expected
    for lengths in (np.array([0.3, 0.4]), torch.tensor([0.25, 0.5]), [0.3, 0.4]):
        assert ArmParameters(link_length=lengths).link_length == tuple(map(float, lengths))


@pytest.mark.parametrize("value", [np.bool_(True), np.array(True), torch.tensor(True), True, np.array([5]), 5j])
def test_truth_values_and_rows_are_no_numbers(value):
    with pytest.raises(ValueError, match=r"^trial_length must be a (whole )?number, got"):
        TrialSettings(trial_length=value)


def test_a_constant_of_the_arm_among_the_settings_is_told_its_place():
    with pytest.raises(
        ValueError, match=r"^Unknown setting 'link_length' among the settings; it is arm\.link_length\."
    ):
        ArmVecEnv(2, link_length=(0.3, 0.3))
    with pytest.raises(ValueError, match=r"'stiffness' among the settings; it is two_arms\.spring\.stiffness\."):
        ArmVecEnv(2, stiffness=0)
    with pytest.raises(ValueError, match=r"it is losses\.dominant\.penalty or losses\.non_dominant\.penalty\."):
        ArmVecEnv(2, penalty=0)


def test_seeds_are_whole_numbers_of_any_kind():
    first = ArmEnv().reset(seed=3)[0]
    np.testing.assert_array_equal(ArmEnv().reset(seed=np.int64(3))[0], first)
    np.testing.assert_array_equal(ArmVecEnv(2, seed=np.uint8(3)).reset()[0], first)
    np.testing.assert_array_equal(ArmVectorEnv(2).reset(seed=np.uint8(3))[0][0], first)
    env = ArmVecEnv(2)
    env.seed_arms(np.array([7, 3]))
    np.testing.assert_array_equal(env.reset()[1], first)
    for seed in (-1, 1.5, "1", True):
        with pytest.raises((TypeError, ValueError), match="seed must be"):
            ArmVecEnv(2, seed=seed)
        with pytest.raises((TypeError, ValueError), match="seed must be"):
            ArmEnv().reset(seed=seed)
        with pytest.raises((TypeError, ValueError), match="seed must be"):
            ArmVectorEnv(2).reset(seed=[1, seed])
    with pytest.raises(ValueError, match="2 arms need 2 seeds, got 3"):
        env.seed_arms([1, 2, 3])


@pytest.mark.parametrize("limit", [200, 20])
def test_gymnasiums_own_limit_is_the_trials_length(limit):
    env = gymnasium.make("bilateral_rl/RandomReach-v0", max_episode_steps=limit)
    again = gymnasium.make(env.spec)
    for one in (env, again):
        one.reset(seed=0)
        steps = [one.step(np.zeros(6, np.float32)) for _ in range(limit)]
        assert [truncated for *_, truncated, _ in steps] == [False] * (limit - 1) + [True]
        assert "vector_return" in steps[-1][-1]
    assert gymnasium.make("bilateral_rl/RandomReach-v0", max_episode_steps=-1).get_wrapper_attr("trial_length") == 50
    with pytest.raises(ValueError, match="contradict each other: give trial_length alone"):
        gymnasium.make("bilateral_rl/RandomReach-v0", max_episode_steps=limit, trial_length=50)
    for mode in ("vector_entry_point", "sync"):
        many = gymnasium.make_vec("bilateral_rl/RandomReach-v0", 2, vectorization_mode=mode, max_episode_steps=limit)
        many.reset(seed=0)
        ends = [many.step(np.zeros((2, 6), np.float32))[3].all() for _ in range(limit)]
        assert ends == [False] * (limit - 1) + [True]


@pytest.mark.parametrize("options", [[1], 5, "start", {("start",): 1}, {"start": None}, {"start": "ab"}, np.zeros(2)])
def test_reset_options_are_a_dictionary_of_numbers(options):
    with pytest.raises((TypeError, ValueError), match=r"options must be|options takes|start must be"):
        ArmEnv().reset(options=options)


def test_a_picture_of_another_mode_is_refused():
    env = ArmVecEnv(2, render_mode="rgb_array")
    env.reset()
    assert env.render("rgb_array").shape[-1] == 3
    with pytest.raises(ValueError, match="render_mode='rgb_array', and cannot render 'human'"):
        env.render("human")


@pytest.mark.parametrize(
    "wrong",
    [
        np.zeros((3, 6)), torch.zeros(6), torch.zeros(2, 6), torch.zeros(3, 6, dtype=torch.cfloat), None,
        torch.zeros(3, 6).to_sparse(), torch.zeros(3, 6, device="meta"), torch.ones(3, 6, dtype=torch.bool), "ab",
    ],
)  # fmt: skip
def test_the_torch_operation_takes_dense_real_tensors_of_its_shapes(wrong):
    arm = Arm()
    state = arm.rest(torch.ones(3, 2))
    with pytest.raises((TypeError, ValueError), match=r"excitation (of 3 arms )?must"):
        arm.step(state, wrong)
    for field in state._fields[:2]:
        with pytest.raises((TypeError, ValueError), match="must"):
            arm.step(state._replace(**{field: wrong}), torch.zeros(3, 6))
    for call in (arm.rest, arm.state):
        with pytest.raises((TypeError, ValueError), match="must"):
            call(wrong)
    with pytest.raises(TypeError, match="state must be an ArmState"):
        arm.step(tuple(state), torch.zeros(3, 6))


def test_no_arms_are_some():
    state = Arm().step(Arm().rest(torch.zeros(0, 2)), torch.zeros(0, 6))
    assert [tuple(part.shape) for part in state] == [(0, 4), (0, 7, 6), (0, 4)]


def test_the_torch_operation_takes_any_memory_layout():
    arm = Arm(dtype=torch.float64)
    state = arm.rest(torch.ones(3, 2))
    expected = arm.step(state, torch.full((3, 6), 0.5))
    for excitation in (
        torch.full((1, 1), 0.5).expand(3, 6),
        torch.full((6, 3), 0.5).t(),
        torch.full((6, 12), 0.5, dtype=torch.float16)[::2, ::2],
    ):
        given = excitation.clone(memory_format=torch.preserve_format).requires_grad_()
        after = arm.step(state, given)
        assert all(torch.equal(a, b) for a, b in zip(after, expected, strict=True))
        after.joint.sum().expand(2).sum().backward()
        assert given.grad.shape == (3, 6)
    for upstream in (torch.ones(3, 4, dtype=torch.float64), torch.ones(1, 1, dtype=torch.float64).expand(3, 4)):
        given = torch.full((3, 6), 0.5, dtype=torch.float64, requires_grad=True)
        gradients = [
            torch.autograd.grad(arm.step(state, given).joint, given, way)[0] for way in (upstream, upstream.to_sparse())
        ]
        assert torch.equal(*gradients)
