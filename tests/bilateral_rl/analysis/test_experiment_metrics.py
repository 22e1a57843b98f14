"""Metrics of experiments: of records worked out by hand, and of the trials of an experiment with everything at once."""

import dataclasses

import numpy as np
import pytest
import torch
from everything import SETTINGS, everything
from plain_trials import a_record

from bilateral_rl.analysis.metrics import find_metric, means_something, measure, metrics_of, preferred_metric
from bilateral_rl.analysis.trial_parts import chosen, cued, since
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.config.resolve import resolve
from bilateral_rl.envs.experiments.task import ExperimentTask
from bilateral_rl.envs.tasks import NEVER, TASKS, make_task
from bilateral_rl.runs.policies import build_policy


@pytest.fixture(scope="module")
def task():
    return everything()


@pytest.fixture(scope="module")
def record(task):
    torch.manual_seed(0)
    return Evaluator(task, SETTINGS, 64, seed=0).run(build_policy(resolve(None, "random_reach")))


def value(record, name):
    return find_metric(name).value(record)


def test_a_reach_is_measured_from_its_cue_on_and_not_where_none_comes():
    detour = [[0, 0], [0, 0.3], [0, 0], [0.05, 0], [0.1, 0]]  # 30 cm aside and back before the cue, then straight
    record = a_record([detour, detour], [[0.1, 0], [0, 0]], go=[2, NEVER], condition=["null", "no_go"])
    assert value(record, "path_length_ratio") == pytest.approx(1)
    assert value(record, "perpendicular_deviation") == pytest.approx(0)
    assert value(record, "peak_speed") == pytest.approx(500)
    assert value(record, "final_error") == pytest.approx(0)
    assert value(record, "time_in_goal_6cm") == 2
    assert value(record, "premature_movement") == pytest.approx(30)
    assert value(record, "reaction_time") == 0
    assert np.isnan(value(record, "final_error_in_no_go"))
    assert value(record, "premature_movement_in_no_go") == pytest.approx(30)
    assert record.summary(0.01)["final_error_cm"] == pytest.approx(0)


def test_trials_of_which_none_has_a_cue_complete_no_goal():
    record = a_record([[[0, 0]] * 5] * 2, [[0, 0]] * 2, go=[NEVER] * 2, condition=["no_go"] * 2)
    summary = record.summary(0.05)
    assert np.isnan([value for name, value in summary.items() if "goal" in name]).all()
    assert summary["final_error_cm"] == pytest.approx(0)


def test_a_metric_of_a_condition_is_that_of_its_trials_alone():
    hand = np.zeros((3, 5, 2))
    target = [[0.1, 0], [0.2, 0], [0.4, 0]]
    record = a_record(hand, target, condition=["field", "null", "field+jump"])
    assert value(record, "final_error") == pytest.approx(70 / 3)
    assert value(record, "final_error_in_null") == pytest.approx(20)
    assert value(record, "final_error_in_field") == pytest.approx(25)
    assert value(record, "final_error_in_jump") == pytest.approx(40)
    assert np.isnan(value(record, "final_error_in_channel"))


def test_times_are_in_milliseconds_and_distances_in_centimeters():
    path = np.zeros((1, 9, 2))
    path[0, 5:, 1] = [0.03, 0.06, 0.06, 0.01]
    jumped = a_record(path, [[0, 0.06]], jump=[2], goal=[[0, 0]])
    assert value(jumped, "jump_latency") == pytest.approx(20)
    assert value(jumped, "jump_return_time_4cm") == pytest.approx(60)  # outside after the last step
    pushed = a_record(path, [[0, 0]], pulse=[[3, 5]], pulse_force=[[0, 2]])
    assert value(pushed, "pulse_deviation") == pytest.approx(6)
    assert value(pushed, "pulse_latency") == pytest.approx(30)
    assert value(pushed, "pulse_return_time_2cm") == pytest.approx(40)


def test_the_channels_force_is_what_is_left_without_the_load():
    hand = np.stack([np.linspace(0, 0.1, 6), np.zeros(6)], axis=1)[None]
    bell = np.array([0, 1, 2, 1, 0.0])
    record = a_record(hand, [[0.1, 0]], condition=["channel"])
    field = np.stack([0 * bell, -3 * bell], axis=1)[None]  # to the right
    load = np.array([[1.0, 5.0]])
    record = dataclasses.replace(record, load=load, field_force=field, force=0.5 * field + load[:, None])
    assert value(record, "channel_peak_force") == pytest.approx(3)
    assert value(record, "channel_compensation") == pytest.approx(0.5)
    other = dataclasses.replace(record, plan=dataclasses.replace(record.plan, condition=np.array(["field"])))
    assert np.isnan(value(other, "channel_compensation"))


def test_every_metric_of_an_experiment_with_everything_has_a_value(record, task):
    values = measure(record, metrics_of(task, [0.02]))
    alike = metrics_of(ExperimentTask(task.experiment.with_condition("field")), [0.02])
    assert len(values) == 4 * len(alike) + 2  # those of the channel are of its trials anyway
    lost = {name for name, one in values.items() if np.isnan(one)}
    assert all(name.startswith(("speed_to", "jump_latency")) for name in lost), lost  # fresh networks hardly reach


def test_onsets_and_distances_are_those_of_the_arms(record):
    plan, steps = record.plan, record.distance.shape[1]
    comes = plan.onset < steps
    assert 0 < comes.sum() < len(comes)
    for i in np.flatnonzero(comes):
        at_onset = np.linalg.norm(record.hand[i, plan.onset[i]] - record.target[i])
        assert record.start_distance[i] == pytest.approx(at_onset, abs=1e-5)
        np.testing.assert_allclose(
            record.seen_target[i, : plan.go[i]], np.tile(record.hand[i, 0], (plan.go[i], 1)), atol=1e-6
        )
        np.testing.assert_allclose(record.seen_target[i, plan.go[i]], plan.goal[i], atol=1e-5)
    np.testing.assert_allclose(record.target[~comes], record.hand[~comes, 0], atol=1e-6)


def test_the_force_of_field_trials_is_load_field_and_pulse(record):
    plan, step = record.plan, np.arange(record.distance.shape[1])
    in_pulse = (step >= plan.pulse[:, :1]) & (step < plan.pulse[:, 1:])
    pulse = in_pulse[..., None] * plan.pulse_force[:, None]
    expected = record.load[:, None] + pulse
    for condition, field in (("field", record.field_force), ("null", 0 * record.field_force)):
        rows = plan.has(condition)
        assert rows.any()
        np.testing.assert_allclose(record.force[rows], (expected + field)[rows], atol=1e-3)
    assert np.abs(record.field_force[plan.has("channel")]).max() > 0.1


def test_targets_are_numbered_as_they_are_listed(record):
    angle = np.degrees(record.plan.target_angle.astype(float)) % 360
    np.testing.assert_allclose(angle, 90.0 * record.plan.target_index, atol=0.01)
    assert set(record.plan.target_index) == {0, 1, 2, 3}


def test_the_cue_the_jump_and_the_shares_tell_what_can_be_measured(task):
    assert task.features == {"cue", "jump", "field", "pulse", "channel"}
    assert task.mixes == ("field", "null", "channel")
    alike = ExperimentTask(task.experiment.with_condition("null"))
    assert alike.mixes == ()
    assert alike.features == {"cue", "jump", "field", "pulse"}
    for name, features in (
        ("center_out", set()),
        ("curl_field", {"field"}),
        ("target_jump", {"jump"}),
        ("delayed_reach", {"cue"}),
    ):
        assert make_task(name).features == features
        assert make_task(name).mixes == ()
    assert all(not make_task(name).features for name in TASKS)


def test_mixed_trials_are_judged_by_those_of_the_field(task):
    assert preferred_metric(task, 0.02) == "goal_completion_2cm_in_field"
    assert preferred_metric("curl_field", 0.02) == "goal_completion_2cm"
    assert means_something(find_metric("reaction_time"), task)
    assert not means_something(find_metric("reaction_time"), "curl_field")
    assert not means_something(find_metric("hold_speed_in_null"), task)


def test_parts_of_a_record_are_of_the_same_trials(record):
    rows = record.plan.has("no_go")
    np.testing.assert_array_equal(cued(record).hand, record.hand[~rows])
    part = since(chosen(record, ~rows), 5)
    assert part.hand.shape == ((~rows).sum(), 20, 2)
    assert part.distance.shape[1] == part.force.shape[1] == 19
    np.testing.assert_array_equal(part.plan.goal, record.plan.goal[~rows])
    np.testing.assert_array_equal(part.plan.forces.walls, record.plan.forces.walls[~rows])
