"""Two arms in one trial: each is the arm that it is alone, and only the spring, and what they see, joins them."""

from typing import NamedTuple

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rich_tasks import RICH_SETTINGS, RichPair
from skeletons import jacobian, kinetic_energy

from bilateral_rl.envs import (
    TASKS,
    ArmEnv,
    ArmParameters,
    ArmVectorEnv,
    HoldPosition,
    Task,
    TrialBatch,
    TrialSettings,
    TwoHolds,
    VectorReward,
)
from bilateral_rl.envs.body_frame import in_arm_frames, in_body_frame, in_frame_of_other_arm, vectors_between_frames
from bilateral_rl.envs.kinematics import hand_position, inverse_kinematics
from bilateral_rl.envs.task import HandForces, Spring, Timeline, Trials
from bilateral_rl.envs.vector import VectorReward as ManyRewards

MIRROR = np.diag([-1.0, 1.0])
APART = 0.36
SHOULDER = np.array([APART / 2, 0.0])
OF_ONE_ARM = ("joint", "muscle", "hand", "target", "load", "force", "excitation", "distance", "start_distance", "onset")


class OneArm(Task):
    """Any trials of one arm, with a timeline and forces."""

    id = "one_arm"
    has_timeline = has_forces = True

    def trials(self, uniform, settings):
        raise NotImplementedError


def mirrored_forces(forces):
    """The forces of the frame of the body that act on the non-dominant hand, in its own frame."""
    there = HandForces(*(np.asarray(field)[:, 1] for field in forces))
    return there._replace(
        velocity_gain=MIRROR @ there.velocity_gain @ MIRROR,
        position_gain=MIRROR @ there.position_gain @ MIRROR,
        center=np.float32(there.center) @ MIRROR - SHOULDER,
        pulse=there.pulse @ MIRROR,
    )


def alone(trials, arm):
    """Trials of one of the two arms, in its own frame."""
    timeline = None if trials.timeline is None else Timeline(*(field[:, arm] for field in trials.timeline))
    start, goal, load = (np.asarray(field)[:, arm] for field in trials[:3])
    if arm == 1:
        forces = None if trials.forces is None else mirrored_forces(trials.forces)
        return Trials(start, goal, load @ MIRROR, timeline, forces)
    forces = None
    if trials.forces is not None:
        forces = HandForces(*(field[:, 0] for field in trials.forces))
        forces = forces._replace(center=np.float32(forces.center) - SHOULDER)
    return Trials(start, goal, load, timeline, forces)


@pytest.mark.parametrize(
    ("pair", "single", "given_settings"),
    [(TwoHolds(), HoldPosition(), {"sensory_noise": 0.01, "motor_noise": 0.05, "feedback_delay": 2}),
     (RichPair(0.0, 0.0), OneArm(), RICH_SETTINGS)],
    ids=["holds", "rich"],
)  # fmt: skip
def test_arms_that_nothing_joins_are_two_single_arms_bit_for_bit(pair, single, given_settings):
    """The mirrored arm, then, is the arm under mirrored loads and pulses, and curls of the other handedness."""
    n, steps, rng = 12, 12, np.random.default_rng(3)
    trial_settings = TrialSettings(trial_length=steps, **given_settings)
    both, arms = TrialBatch(pair, trial_settings, n), [TrialBatch(single, trial_settings, n) for _ in range(2)]
    trials = pair.trials(rng.random((n, pair.n_uniform)), trial_settings)
    noise = rng.standard_normal((n, 2, steps + 1, 20))
    both.start(np.arange(n), trials, noise.reshape(2 * n, steps + 1, 20))
    for arm, batch in enumerate(arms):
        batch.start(np.arange(n), alone(trials, arm), noise[:, arm])
    for _ in range(steps):
        action = rng.uniform(-1.2, 1.2, (n, 2, 6))
        both.step(action.reshape(n, 12))
        for arm, batch in enumerate(arms):
            batch.step(action[:, arm])
            for name in OF_ONE_ARM:
                np.testing.assert_array_equal(getattr(both, name)[arm::2], getattr(batch, name), err_msg=name)
            view = both.observation[:, 20 * arm :][:, :20]
            np.testing.assert_array_equal(view[:, :14], batch.observation[:, :14])
            np.testing.assert_array_equal(view[:, 16:18], batch.observation[:, 14:])
        rewards = np.stack([batch.vector_reward for batch in arms])
        np.testing.assert_allclose(both.vector_reward, rewards.mean(axis=0), rtol=3e-7)
        np.testing.assert_array_equal(both.reward, both.vector_reward.mean(axis=1))
        ours = in_body_frame(both.hand.reshape(n, 2, 2), APART)
        theirs = np.stack([arms[0].hand + SHOULDER, arms[1].hand @ MIRROR - SHOULDER], axis=1)
        np.testing.assert_array_max_ulp(ours, theirs, 1)


def test_either_arm_sees_the_other_as_it_sees_itself_in_a_mirror():
    noisy = TrialSettings(trial_length=9, sensory_noise=0.02, proprioception_delay=1, vision_delay=3)
    batch, rng = TrialBatch(TwoHolds(), noisy, 6), np.random.default_rng(0)
    trials = TASKS["two_reaches"]().trials(rng.random((6, 8)), noisy)
    batch.start(np.arange(6), trials, rng.standard_normal((12, 10, 20)))
    for _ in range(9):
        batch.step(rng.uniform(-1, 1, (6, 12)))
        views = batch.observation.reshape(6, 2, 20)
        for own, other in ((12, 14), (16, 18)):
            in_mirror = views[:, ::-1, own : own + 2] @ MIRROR.astype(np.float32) - np.float32([APART, 0])
            np.testing.assert_array_equal(views[:, :, other : other + 2], in_mirror)
        np.testing.assert_array_equal(views[:, :, 16:18].reshape(12, 2), batch.target)
    low, high = noisy.observation_bounds(2)
    assert ((low <= batch.observation) & (batch.observation <= high)).all()


class Pulled(NamedTuple):
    """What the joined hands did: work (J) that was done on them, and where it came from and went to."""

    work: float
    stored: float
    damped: float
    kinetic: float


class Joined(Task):
    """The same trial of two hands every time."""

    id = "joined"
    n_uniform = 0
    n_arms = 2

    def __init__(self, stiffness, damping):
        self.spring = Spring(np.float32([stiffness]), np.float32([damping]))

    def trials(self, uniform, settings):
        start = np.array([[0.6, 1.5], [0.9, 1.2]])
        return Trials(start, start, np.zeros((2, 2)), spring=self.spring)


def begun(kind, timestep, stiffness, damping, **arm):
    parameters = ArmParameters(timestep=timestep, **arm)
    two = {"spring": {"kind": kind}, "shoulder_distance": APART}
    task = Joined(stiffness, damping)
    batch = TrialBatch(task, TrialSettings(trial_length=round(0.4 / timestep), two_arms=two, arm=parameters), 1)
    batch.start(np.arange(1), task.trials(np.zeros((1, 0)), batch.settings))
    batch.joint[:, 2:] = [[2.0, -1.0], [1.0, 0.5]]
    return batch


def in_body(batch):
    """Positions (2, 2) and velocities of both hands in the frame of the body, in double precision."""
    joint = batch.joint.astype(np.float64)
    velocity = np.einsum("nij,nj->ni", jacobian(joint[:, :2]), joint[:, 2:])
    return in_body_frame(hand_position(joint[:, :2], batch.settings.arm), APART), vectors_between_frames(velocity)


def pulled(kind, timestep, stiffness=60.0, damping=3.0):
    """Follow two arms whose muscles cannot pull."""
    batch = begun(kind, timestep, stiffness, damping, max_isometric_force=(1e-12,) * 6)
    start, _ = in_body(batch)
    rest, before = start[1] - start[0], kinetic_energy(batch.joint.astype(np.float64)).sum()
    work = damped = 0.0
    for _ in range(batch.settings.trial_length):
        position, velocity = in_body(batch)
        apart, rate = position[1] - position[0], velocity[1] - velocity[0]
        if kind == "distance":
            rate = apart @ rate / np.linalg.norm(apart)
        batch.step(np.full((1, 12), -1.0))
        work += (vectors_between_frames(batch.force) * velocity).sum() * timestep
        damped += damping * np.sum(rate**2) * timestep
    position, _ = in_body(batch)
    stretch = position[1] - position[0] - rest
    if kind == "distance":
        stretch = np.linalg.norm(position[1] - position[0]) - np.linalg.norm(rest)
    stored = 0.5 * stiffness * np.sum(stretch**2)
    return Pulled(work, stored, damped, kinetic_energy(batch.joint.astype(np.float64)).sum() - before)


@pytest.mark.parametrize("kind", ["vector", "distance"])
def test_the_work_on_the_hands_is_what_the_spring_loses_and_the_damper_takes_to_first_order(kind):
    runs = [pulled(kind, timestep) for timestep in (0.004, 0.002, 0.001)]
    assert runs[-1].stored > 0.02
    assert runs[-1].damped > 0.2
    for missing in ([run.work + run.stored + run.damped for run in runs], [run.work - run.kinetic for run in runs]):
        assert abs(missing[2]) < 0.02
        assert missing[0] / missing[1] == pytest.approx(2, rel=0.05)
        assert missing[1] / missing[2] == pytest.approx(2, rel=0.05)


@pytest.mark.parametrize("kind", ["vector", "distance"])
def test_the_springs_forces_are_those_of_its_law_and_sum_to_zero(kind):
    stiffness, damping = 80.0, 4.0
    batch, rng = begun(kind, 0.01, stiffness, damping), np.random.default_rng(1)
    start, _ = in_body(batch)
    rest = start[1] - start[0]
    for _ in range(20):
        position, velocity = in_body(batch)
        apart, rate = position[1] - position[0], velocity[1] - velocity[0]
        expected = stiffness * (apart - rest) + damping * rate
        if kind == "distance":
            along = apart / np.linalg.norm(apart)
            expected = (stiffness * (np.linalg.norm(apart) - np.linalg.norm(rest)) + damping * along @ rate) * along
        batch.step(rng.uniform(-1, 1, (1, 12)))
        on_hands = vectors_between_frames(batch.force)
        np.testing.assert_array_equal(on_hands.sum(axis=0), 0)
        np.testing.assert_allclose(on_hands[0], expected, rtol=1e-4, atol=2e-4)
    assert abs(on_hands).max() > 1


def test_hands_at_one_place_are_pulled_with_a_finite_force():
    batch = begun("distance", 0.01, 80.0, 4.0)
    batch.joint[:] = [*inverse_kinematics([-APART / 2, 0.4], ArmParameters()), 0, 0]
    position, _ = in_body(batch)
    np.testing.assert_allclose(position[0], position[1], atol=1e-6)
    batch.step(np.zeros((1, 12)))
    assert np.isfinite(batch.force).all()
    assert np.linalg.norm(batch.force[0]) < 80 * 0.6


angles = st.tuples(st.floats(0.1, 2.2), st.floats(0.1, 2.6))
newtons = st.tuples(st.floats(-5, 5), st.floats(-5, 5))


@settings(max_examples=20, deadline=None)
@given(start=st.tuples(angles, angles), load=st.tuples(newtons, newtons), kind=st.sampled_from(["vector", "distance"]))
def test_arms_that_change_places_do_the_same_in_a_mirror(start, load, kind):
    trial_settings = TrialSettings(trial_length=10, two_arms={"spring": {"stiffness": 50, "damping": 2, "kind": kind}})
    start, load = np.array(start), np.array(load)
    spring = Spring(np.array([50.0]), np.array([2.0]))
    one, other = (TrialBatch(TwoHolds(), trial_settings, 1) for _ in range(2))
    one.start(np.arange(1), Trials(start, start[::-1], load, spring=spring))
    other.start(np.arange(1), Trials(start[::-1], start, load[::-1] @ MIRROR, spring=spring))
    action = np.linspace(-1, 1, 12)[None]
    for _ in range(10):
        one.step(action)
        other.step(np.roll(action, 6, axis=1))
        np.testing.assert_allclose(other.joint, one.joint[::-1], rtol=1e-4, atol=1e-4)
        np.testing.assert_allclose(other.force, one.force[::-1], rtol=1e-3, atol=1e-3)
        np.testing.assert_allclose(np.roll(other.observation, 20), one.observation, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(other.vector_return, one.vector_return, rtol=1e-4)


def test_a_success_takes_both_hands_and_measures_are_by_hand():
    env = ArmEnv("two_holds", trial_length=5)
    env.reset(options={"start": [[0.6, 1.5], [0.6, 1.5]], "goal": [[0.6, 1.5], [1.2, 1.0]]})
    for _ in range(5):
        *_, info = env.step(np.full(12, -1.0, dtype=np.float32))
    assert info["is_success"] is False
    assert info["goal_completion"].tolist() == [True, False]
    assert info["time_in_goal"].tolist() == [5, 0]
    assert info["final_error"].shape == info["speed_to_goal"].shape == info["vector_return"].shape == (2,)
    np.testing.assert_allclose(info["distance"], info["final_error"])


def test_hands_that_hold_succeed_by_being_in_their_goals_at_the_end():
    env, still, away = ArmEnv("two_holds", trial_length=5), np.full(12, -1.0), np.r_[np.full(6, -1.0), [1, -1] * 3]
    for action, success in ((still, True), (away, False)):
        env.reset(options={"start": [[0.6, 1.5], [0.6, 1.5]]})
        for _ in range(5):
            *_, info = env.step(action)
        assert info["is_success"] is success
        assert (info["final_error"] <= 0.05).tolist() == [True, success]
        assert info["goal_completion"].tolist() == [True, True]  # by the first three steps


def test_reset_options_are_in_the_frame_of_the_body():
    env = ArmEnv("reach_and_hold", two_arms={"shoulder_distance": 0.3})
    places = {"start": [[0.5, 1.5], [0.7, 1.2]], "goal": [[1.0, 0.5], [0.7, 1.2]], "load": [[3.0, -2.0], [1.0, 4.0]]}
    observation, _ = env.reset(options=places)
    np.testing.assert_array_equal(env.batch.joint[:, :2], np.float32(places["start"]))
    np.testing.assert_array_equal(env.batch.load, [[3, -2], [-1, 4]])
    np.testing.assert_array_equal(env.batch.state_array("stiffness"), [50.0])
    np.testing.assert_allclose(observation[16:18], hand_position((1.0, 0.5), ArmParameters()), atol=1e-6)
    for start in ([0.5, 1.5], [[0.5, 1.5]], [[0.5, 1.5], [0.5, np.nan]]):
        with pytest.raises(ValueError, match="start must be two finite numbers for each of two arms"):
            env.reset(options={"start": start})


@given(positions=arrays(np.float64, (2, 2), elements=st.floats(-1, 1)), distance=st.floats(0.1, 1))
def test_frames_lead_to_each_other_and_back(positions, distance):
    body = in_body_frame(positions, distance)
    np.testing.assert_allclose(in_arm_frames(body, distance), positions, atol=1e-15)
    np.testing.assert_array_equal(vectors_between_frames(vectors_between_frames(positions)), positions)
    np.testing.assert_allclose(body[0] - positions[0], [distance / 2, 0], atol=1e-15)
    np.testing.assert_allclose(body[1] - positions[1] @ MIRROR, [-distance / 2, 0], atol=1e-15)
    seen = in_frame_of_other_arm(positions[::-1], distance)
    np.testing.assert_allclose(seen - positions, vectors_between_frames(body[::-1] - body), atol=1e-15)


def test_pairs_of_rewards_see_both_hands():
    command = np.linspace(-1, 1, 12, dtype=np.float32)

    def of(distance):
        return -distance[..., 0], -distance[..., 1]

    one = VectorReward(gymnasium.make("bilateral_rl/TwoReaches-v0"), lambda step: of(step.info["distance"]))
    many = ManyRewards(ArmVectorEnv(2, "two_reaches"), lambda step: of(step.info["distance"]))
    one.reset(seed=0)
    many.reset(seed=0)
    for _ in range(50):
        *_, info = one.step(command)
        *_, infos = many.step(np.tile(command, (2, 1)))
        np.testing.assert_allclose(info["vector_reward"], -info["distance"], rtol=1e-6)
        np.testing.assert_allclose(infos["vector_reward"][0], info["vector_reward"], rtol=1e-6)
    np.testing.assert_allclose(infos["final_info"]["vector_return"][0], info["vector_return"], rtol=1e-5)
