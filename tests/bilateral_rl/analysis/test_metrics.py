import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plain_trials import without_forces

from bilateral_rl.analysis import kinematics, smoothness
from bilateral_rl.analysis.metrics import (
    find_metric,
    measure,
    metric_name,
    metrics_of,
    preferred_metric,
)
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.envs.arm import ArmParameters
from bilateral_rl.envs.tasks import TASKS
from bilateral_rl.io.errors import UserError

RADII = (0.02, 0.045)
STEPS = 50


def make_record(hand, target, excitation=0.0, arm=None):
    """Trials of hands (n, T + 1, 2) in cm."""
    hand, target = np.asarray(hand, dtype=np.float32) / 100, np.asarray(target, dtype=np.float32) / 100
    n, steps = len(hand), hand.shape[1] - 1
    distance, load = np.linalg.norm(hand - target[:, None], axis=2), np.zeros((n, 2), dtype=np.float32)
    return TrialRecord(
        **without_forces(hand, target, load),
        joint=np.zeros((n, steps + 1, 2), dtype=np.float32),
        hand=hand,
        target=target,
        load=load,
        distance=distance[:, 1:],
        start_distance=distance[:, 0],
        observation=np.zeros((n, steps, 16), dtype=np.float32),
        excitation=np.full((n, steps, 6), excitation, dtype=np.float32),
        activation=np.zeros((n, steps, 6), dtype=np.float32),
        vector_return=np.arange(2 * n, dtype=np.float32).reshape(n, 2),
        arm=arm or ArmParameters(),
    )


@pytest.fixture
def record():
    """One hand jumps to 1 cm from its target in step 10, one stays where it is, one starts on its target and leaves."""
    hand = np.zeros((3, STEPS + 1, 2))
    hand[0, 10:] = [29, 0]
    hand[2, 25:] = [0, 10]
    return make_record(hand, [[30, 0], [0, 20], [0, 0]], excitation=0.5)


@pytest.fixture
def random_record():
    generator = np.random.default_rng(1)
    hand = generator.normal(size=(8, STEPS + 1, 2)).cumsum(axis=1)
    return make_record(hand, 10 * generator.normal(size=(8, 2)), excitation=0.1)


def value(record, name):
    return find_metric(name).value(record)


def test_values_are_means_over_the_trials_that_have_one_in_peoples_units(record):
    for name, expected in (
        ("goal_completion_5cm", 100 * 2 / 3),
        ("goal_completion_0.5cm", 100 / 3),
        ("speed_to_goal_5cm", 30 / 10),  # the third trial starts on its target
        ("speed_to_third_step_5cm", 30 / 12),
        ("time_to_goal_5cm", (10 + 50 + 1) / 3),
        ("time_to_goal_0.5cm", (50 + 50 + 1) / 3),
        ("time_in_goal_5cm", (41 + 0 + 24) / 3),
        ("final_error", (1 + 20 + 10) / 3),
        ("path_length_ratio", (29 / 30 + 0) / 2),  # the third trial starts on its target
        ("perpendicular_deviation", 0),
        ("initial_direction_error", 0),  # of the first alone: the second never moves
        ("peak_speed", (2900 + 0 + 1000) / 3),
        ("time_to_peak_speed", (95 + 245) / 2),
        ("hold_rms_error", (np.sqrt((9 * 900 + 41) / 50) + 20 + np.sqrt(26 * 100 / 50)) / 3),
        ("hold_speed", (29 + 0 + 10) / 0.5 / 3),
        ("effort", 6 * 0.25 * 0.5),
        ("return_dominant", (0 + 2 + 4) / 3),
        ("return_non_dominant", (1 + 3 + 5) / 3),
    ):
        assert value(record, name) == pytest.approx(expected, rel=1e-5, abs=1e-9)


def test_end_point_variability_is_in_centimeters(record):
    errors = np.array([[-1, 0], [0, -20], [0, 10]])
    expected = np.sqrt(((errors - errors.mean(axis=0)) ** 2).sum(axis=1).mean())
    assert value(record, "end_point_variability") == pytest.approx(expected, rel=1e-5)


def test_smoothness_is_that_of_the_hands_speed(random_record):
    speed = kinematics.hand_speed(random_record.hand, 0.01)
    assert value(random_record, "sparc") == pytest.approx(smoothness.sparc(speed, 0.01).mean())
    assert value(random_record, "ldlj") == pytest.approx(smoothness.ldlj(speed, 0.01).mean())


def test_directions_are_in_degrees():
    record = make_record([[[0, 0], [0, 3]]], [[5, 0]])
    assert value(record, "initial_direction_error") == pytest.approx(90)
    assert value(record, "perpendicular_deviation") == pytest.approx(3)


def test_the_arm_gives_the_timestep_and_the_forces():
    arm = ArmParameters(timestep=0.02, max_isometric_force=(1.0, 1.0, 1.0, 1.0, 1.0, 7.0))
    record = make_record([[[0, 0], [3, 0], [4, 0]]], [[4, 0]], excitation=0.5, arm=arm)
    assert value(record, "peak_speed") == pytest.approx(150)
    assert value(record, "time_to_peak_speed") == pytest.approx(10)
    assert value(record, "effort") == pytest.approx(6 * 0.25 * 0.04)
    assert value(record, "force_effort") == pytest.approx((5 * 0.25 + 3.5**2) * 0.25 * 0.04)


def test_they_agree_with_what_evaluate_reports(random_record):
    summary = random_record.summary(0.05)
    assert value(random_record, "goal_completion_5cm") == pytest.approx(summary["goal_completion_percent"])
    assert value(random_record, "speed_to_goal_5cm") == pytest.approx(summary["speed_to_goal_cm_per_step"], nan_ok=True)
    assert value(random_record, "time_in_goal_5cm") == pytest.approx(summary["time_in_goal_steps"])
    assert value(random_record, "final_error") == pytest.approx(summary["final_error_cm"])
    assert value(random_record, "return_dominant") == pytest.approx(summary["return_dominant"])


def test_a_seed_whose_trials_all_lack_a_value_has_nan_and_nobody_is_warned():
    hand = np.zeros((2, STEPS + 1, 2))
    with warnings.catch_warnings(), np.errstate(all="raise"):
        warnings.simplefilter("error")
        values = measure(make_record(hand, hand[:, 0] + 20), metrics_of("random_reach", [0.05]))
        no_value = {name for name, v in values.items() if np.isnan(v)}
    assert no_value == {
        "speed_to_goal_5cm", "speed_to_third_step_5cm", "initial_direction_error", "time_to_peak_speed",
        "sparc", "ldlj",
    }  # fmt: skip


def test_a_reach_has_shapes_and_a_hold_has_posture():
    reach = {metric.name for metric in metrics_of("random_reach", RADII)}
    hold = {metric.name for metric in metrics_of("hold_position", RADII)}
    both = {"time_in_goal_2cm", "time_in_goal_4.5cm", "final_error", "end_point_variability"}
    both |= {"effort", "force_effort", "return_dominant", "return_non_dominant"}
    assert hold == both | {"hold_rms_error", "hold_speed"}
    assert reach == both | {
        "goal_completion_2cm", "goal_completion_4.5cm", "speed_to_goal_2cm", "speed_to_goal_4.5cm",
        "speed_to_third_step_2cm", "speed_to_third_step_4.5cm", "time_to_goal_2cm", "time_to_goal_4.5cm",
        "path_length_ratio", "perpendicular_deviation", "initial_direction_error", "peak_speed",
        "time_to_peak_speed", "sparc", "ldlj",
    }  # fmt: skip


def test_the_time_to_a_goal_is_the_only_metric_of_a_goal_of_which_less_is_better():
    at_goal = {name for metric in metrics_of("random_reach", [0.05]) if (name := metric.name).endswith("_5cm")}
    assert {name for name in at_goal if find_metric(name).better == "lower"} == {"time_to_goal_5cm"}


def test_radii_that_are_written_alike_count_once():
    names = [metric.name for metric in metrics_of("hold_position", [0.05, 0.02, 0.05, 0.05000001])]
    assert names[:2] == ["time_in_goal_5cm", "time_in_goal_2cm"]
    assert len(set(names)) == len(names)


@given(
    st.sampled_from(["goal_completion", "speed_to_goal", "speed_to_third_step", "time_to_goal", "time_in_goal"]),
    st.floats(1e-12, 1e12),
)
def test_a_metric_at_any_radius_is_found_by_its_name(start, radius):
    metric = find_metric(metric_name(start, radius))
    assert metric.name == metric_name(start, radius)
    (same,) = (m for m in metrics_of("random_reach", [radius, radius]) if m.name.startswith(start))
    assert (same.name, same.label) == (metric.name, metric.label)


def test_metrics_without_a_goal_are_named_alike_at_every_radius():
    assert metric_name("effort", 0.05) == "effort"


def test_every_metric_of_a_task_is_found_by_its_name_and_measures_the_same(random_record):
    for task in TASKS:
        metrics = metrics_of(task, RADII)
        found = [find_metric(metric.name) for metric in metrics]
        for one, other in zip(metrics, found, strict=True):
            assert (one.name, one.label, one.unit, one.needs) == (other.name, other.label, other.unit, other.needs)
        assert measure(random_record, metrics) == pytest.approx(measure(random_record, found), nan_ok=True)
        assert list(measure(random_record, metrics)) == [metric.name for metric in metrics]


def test_what_a_task_is_judged_by_is_a_metric_of_it_and_higher_is_better():
    for task in TASKS:
        preferred = find_metric(preferred_metric(task, 0.045))
        assert preferred.name in {metric.name for metric in metrics_of(task, RADII)}
        assert preferred.better == "higher"


def test_reaches_are_judged_by_completion_and_holds_by_time():
    assert preferred_metric("random_reach", 0.05) == "goal_completion_5cm"
    assert preferred_metric("hold_position", 0.045) == "time_in_goal_4.5cm"


def test_radii_are_spelled_in_centimeters():
    for radius, name in (
        (0.05, "5cm"),
        (0.045, "4.5cm"),
        (0.03, "3cm"),
        (0.07, "7cm"),
        (0.1, "10cm"),
        (0.0125, "1.25cm"),
    ):
        assert metric_name("time_in_goal", radius) == f"time_in_goal_{name}"
        distance = np.float64(radius)
        hand = np.zeros((1, STEPS + 1, 2))
        record = make_record(hand, [[100 * distance - 0.01, 0]])
        assert value(record, f"time_in_goal_{name}") == STEPS
        record = make_record(hand, [[100 * distance + 0.01, 0]])
        assert value(record, f"time_in_goal_{name}") == 0


def test_an_unknown_metric_is_refused_with_those_there_are():
    for name in (
        "speed",
        "goal_completion",
        "goal_completion_cm",
        "goal_completion_0cm",
        "goal_completion_1e-05cm",
        "final_error_5cm",
        "sparc_5cm",
        "",
    ):
        with pytest.raises(UserError, match=f"'{name}'.*path_length_ratio.*time_in_goal_<radius>cm"):
            find_metric(name)


def test_an_unknown_task_is_refused_with_those_there_are():
    for ask in (lambda task: metrics_of(task, [0.05]), lambda task: preferred_metric(task, 0.05)):
        with pytest.raises(UserError, match=r"'juggle'.*random_reach.*hold_position"):
            ask("juggle")
