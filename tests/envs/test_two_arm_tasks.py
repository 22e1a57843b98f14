"""What trials of two arms are drawn from, and which settings, springs and trials of theirs are refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from bilateral_rl.envs import TASKS, ArmEnv, ArmParameters, RandomReach, TrialBatch, TrialSettings
from bilateral_rl.envs.body_frame import in_body_frame
from bilateral_rl.envs.doors import settings_for
from bilateral_rl.envs.kinematics import hand_position
from bilateral_rl.envs.stability import MOST_GROWTH, mobility
from bilateral_rl.envs.task import Spring
from bilateral_rl.envs.task_specs import TASK_SPECS
from bilateral_rl.envs.trial_checks import checked_trials

TWO_ARM_TASKS = [name for name, spec in TASK_SPECS.items() if spec.n_arms == 2]
ARM = ArmParameters()
UPPER = np.array(ARM.joint_upper_limit)


def draw(name, n=20_000, **given_settings):
    task = TASKS[name]()
    trial_settings = settings_for(task, given_settings)
    return task.trials(np.random.default_rng(0).random((n, task.n_uniform)), trial_settings), trial_settings


def hands_in_body(angles, shoulder_distance=0.36):
    return in_body_frame(hand_position(angles, ARM), shoulder_distance)


def assert_independent(columns):
    assert abs(np.corrcoef(columns.T) - np.eye(columns.shape[1])).max() < 0.03


def test_tasks_and_what_is_said_of_them_agree():
    for name, spec in TASK_SPECS.items():
        assert TASKS[name].n_arms == spec.n_arms
        assert TASKS[name].judged_by == spec.judged_by


def test_two_reaches_are_two_random_reaches():
    trials, trial_settings = draw("two_reaches")
    uniform = np.random.default_rng(0).random((20_000, 8))
    for arm in range(2):
        alone = RandomReach().trials(uniform[:, 4 * arm : 4 * arm + 4], trial_settings)
        np.testing.assert_array_equal(trials.start[:, arm], alone.start)
        np.testing.assert_array_equal(trials.goal[:, arm], alone.goal)
    assert_independent(np.hstack([*trials.start.swapaxes(0, 1), *trials.goal.swapaxes(0, 1)]))
    assert not trials.load.any()
    assert not np.any(trials.spring)


def test_two_holds_have_loads_of_their_own():
    trials, _ = draw("two_holds", max_load=7.0)
    np.testing.assert_array_equal(trials.start, trials.goal)
    assert abs(trials.load).max() == pytest.approx(7, rel=1e-3)
    assert_independent(np.hstack([*trials.start.swapaxes(0, 1), *trials.load.swapaxes(0, 1)]))


def test_one_hand_reaches_and_the_other_holds():
    trials, _ = draw("reach_and_hold")
    start, goal = hands_in_body(trials.start), hands_in_body(trials.goal)
    reaches = (trials.start != trials.goal).any(axis=2)
    assert (reaches.sum(axis=1) == 1).all()
    assert reaches[:, 0].mean() == pytest.approx(0.5, abs=0.02)
    np.testing.assert_array_equal(trials.spring.stiffness, 50)
    length = np.linalg.norm(goal - start, axis=2)[reaches]
    assert (length >= 0.1 - 1e-6).all()
    assert (length <= 0.2 + 1e-6).all()
    np.testing.assert_allclose([length.mean(), length.std()], [0.15, 0.1 / np.sqrt(12)], rtol=0.02)
    assert (start[:, 0, 0] >= 0.05).all()
    assert (start[:, 1, 0] <= -0.05).all()
    assert (start[..., 1] >= 0.1).all()
    assert start[..., 1].min() < 0.11
    assert abs(start[..., 0]).min() < 0.06
    assert (trials.goal >= 0).all()
    assert (trials.goal <= UPPER.astype(np.float32)).all()


def test_starts_of_reach_and_hold_are_as_likely_anywhere_where_hands_are_apart():
    """As postures that are drawn anew until the hand is where it should be, which would take any number of numbers."""
    trials, _ = draw("reach_and_hold")
    uniform = np.random.default_rng(1).random((60_000, 2)) * UPPER
    x, y = hand_position(uniform, ARM).T
    kept = uniform[(x + 0.18 >= 0.05) & (y >= 0.1)]
    for arm in range(2):
        np.testing.assert_allclose(trials.start[:, arm].mean(axis=0), kept.mean(axis=0), atol=0.03)
        np.testing.assert_allclose(trials.start[:, arm].std(axis=0), kept.std(axis=0), atol=0.02)
    between = np.corrcoef(trials.start.reshape(-1, 4).T)[:2, 2:]
    assert abs(between).max() < 0.03


@pytest.mark.parametrize(("roles", "reaching"), [("dominant_reaches", 0), ("non_dominant_reaches", 1)])
def test_roles_can_be_fixed_and_leave_the_rest_of_the_trial_as_it_was(roles, reaching):
    drawn, _ = draw("reach_and_hold", 200)
    fixed, _ = draw("reach_and_hold", 200, two_arms={"roles": roles})
    reaches = (fixed.start != fixed.goal).any(axis=2)
    assert reaches[:, reaching].all()
    assert not reaches[:, 1 - reaching].any()
    np.testing.assert_array_equal(fixed.start, drawn.start)
    alike = (drawn.start != drawn.goal).any(axis=2)[:, reaching]
    np.testing.assert_array_equal(fixed.goal[alike], drawn.goal[alike])


@settings(max_examples=25, deadline=None)
@given(
    uniform=arrays(np.float64, (8, 7), elements=st.floats(0, 1, exclude_max=True)),
    reach=st.sampled_from([(0.1, 0.2), (0.02, 0.3), (0.15, 0.15)]),
    shoulder_distance=st.sampled_from([0.2, 0.36, 0.5]),
)
def test_every_draw_is_a_trial_that_the_arms_can_do(uniform, reach, shoulder_distance):
    task = TASKS["reach_and_hold"]()
    trial_settings = settings_for(task, {"two_arms": {"reach": reach, "shoulder_distance": shoulder_distance}})
    task.check(trial_settings)
    trials = task.trials(uniform, trial_settings)
    rows = checked_trials(trials, 8, task, trial_settings)
    start = hands_in_body(trials.start, shoulder_distance)
    assert (start[..., 0] * [1, -1] >= 0.05).all()
    assert (start[..., 1] >= 0.1).all()
    length = np.linalg.norm(hand_position(rows.start, ARM) - hand_position(rows.goal, ARM), axis=1).reshape(8, 2)
    assert (length.min(axis=1) == 0).all()
    assert (length.max(axis=1) >= reach[0] - 1e-6).all()
    assert (length.max(axis=1) <= reach[1] + 1e-6).all()


@pytest.mark.parametrize(
    ("task", "given_settings", "sentence"),
    [
        ("random_reach", {"two_arms": {"shoulder_distance": 0.4}}, "two_arms has no effect on random_reach, whose"),
        ("two_holds", {"two_arms": {"roles": "dominant_reaches"}}, "two_arms.roles has no effect on two_holds, whose"),
        ("two_reaches", {"two_arms": {"reach": (0.1, 0.3)}}, "two_arms.reach has no effect on two_reaches, whose"),
        ("two_reaches", {"max_load": 3}, "max_load has no effect on two_reaches, whose trials have no load"),
        ("reach_and_hold", {"two_arms": {"reach": (0.2, 0.1)}}, "two_arms.reach must be [least, greatest], got"),
        ("reach_and_hold", {"two_arms": {"reach": (0.1, 0.6)}}, "two_arms.reach: from some starts this arm reaches no"),
        ("reach_and_hold", {"two_arms": {"reach": (0.05, 0.38)},  # for want of a target of two starts in ten thousand
                            "arm": {"joint_lower_limit": (0.3, 0.4), "joint_upper_limit": (1.2, 2.3)}},
         "two_arms.reach: from some starts this arm reaches no target 0.38 m away"),
        ("reach_and_hold", {"two_arms": {"shoulder_distance": 0.2}, "arm": {"joint_lower_limit": (2.0, 0.0)}},
         "shoulders 0.2 m apart leave this arm no start with its hand 0.05 m on its own side"),
        ("two_holds", {"two_arms": {"spring": {"stiffness": 400}}}, "a spring of 400 N/m with a damper of 0"),
    ],
)  # fmt: skip
def test_settings_that_cannot_be_are_refused_in_one_sentence(task, given_settings, sentence):
    with pytest.raises(ValueError) as refused:  # noqa: PT011
        ArmEnv(task, **given_settings)
    assert str(refused.value).startswith(sentence)
    assert "\n" not in str(refused.value)


def test_springs_are_refused_from_where_the_time_step_makes_the_worst_pair_of_postures_swing():
    """Of all pairs of postures, by the growth of the four-dimensional motion of the hands relative to each other."""
    grid = np.stack(np.meshgrid(*(np.linspace(0, top, 9) for top in UPPER)), axis=-1).reshape(-1, 2)
    own, mirror = mobility(grid, ARM), np.diag([-1.0, 1.0])
    pairs = (own[:, None] + mirror @ own @ mirror).reshape(-1, 2, 2)
    task = TASKS["two_holds"]()
    refused = 0
    for stiffness, damping in ((100, 0), (150, 0), (200, 0), (400, 0), (1000, 5), (1000, 12), (0, 80), (0, 95)):
        a = np.zeros((len(pairs), 4, 4))
        a[:, :2, 2:] = np.eye(2)
        a[:, 2:, :2], a[:, 2:, 2:] = -stiffness * pairs, -damping * pairs
        z = np.linalg.eigvals(a) * ARM.timestep
        swings = (abs(1 + z) / np.exp(np.maximum(z.real, 0))).max() > MOST_GROWTH
        refused += swings
        trial_settings = TrialSettings(two_arms={"spring": {"stiffness": stiffness, "damping": damping}})
        if swings:
            with pytest.raises(
                ValueError, match=f"^a spring of {stiffness} N/m with a damper of {damping} N·s/m makes"
            ):
                TrialBatch(task, trial_settings, 1)
        else:
            task.check(trial_settings)
    assert refused == 4


def test_trials_of_two_arms_that_cannot_be_are_refused():
    trials, trial_settings = draw("two_holds", 3)
    task = TASKS["two_holds"]()
    for changes, sentence in (
        ({"spring": None}, "trials of two_holds must have a spring: n_arms is 2."),
        ({"start": trials.start[:, 0]}, "start must have shape (3, 2, 2), or be one row for all trials"),
        ({"spring": Spring(np.array(-1.0), np.zeros(3))}, "stiffness of the spring must be at least 0, got -1.0."),
        ({"spring": Spring(np.ones(3), np.array([np.nan] * 3))}, "damping of the spring must consist of finite"),
        ({"goal": trials.goal - 3}, "goal must lie within the joint limits"),
    ):  # fmt: skip
        with pytest.raises(ValueError) as refused:  # noqa: PT011
            checked_trials(trials._replace(**changes), 3, task, trial_settings)
        assert str(refused.value).startswith(sentence)
    alone = RandomReach().trials(np.full((3, 4), 0.5), TrialSettings())._replace(spring=trials.spring)
    with pytest.raises(ValueError, match=r"^trials of random_reach must have no spring: n_arms is 1\.$"):
        checked_trials(alone, 3, RandomReach(), TrialSettings())
