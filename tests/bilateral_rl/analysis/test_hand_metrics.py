"""Measures of each hand in each role, under the names that they have in tables of results."""

import dataclasses

import numpy as np
import pytest
from plain_trials import a_record

from bilateral_rl.analysis.hand_metrics import COMBINED_LOSS, HAND_METRICS, hand_metric, measure_hands
from bilateral_rl.analysis.hands import MEASURES
from bilateral_rl.vocabulary import SIDES


@pytest.fixture(scope="module")
def record():
    """The dominant hand reaches, once to the left and once to the right of the line, and the other one drifts off."""
    left = np.stack([np.arange(11) / 100, np.linspace(0, 0.02, 11)], axis=1)
    still = np.zeros((11, 2))
    still[6:, 1] = 0.015
    made = a_record(
        np.stack([left, still, left * [1, -1], still]), [[0.1, 0], [0, 0]] * 2, trial=[0, 0, 1, 1], hand=[*SIDES] * 2
    )
    returns = np.array([[-1, -3], [-1, -3], [-2, -4], [-2, -4]], dtype=np.float32)  # of the trial, for both its hands
    return dataclasses.replace(made, vector_return=returns)


def test_numbers_have_the_unit_of_their_metric(record):
    values = measure_hands(record)
    assert values["reach_max_deviation_dominant"] == pytest.approx(2)  # cm
    assert values["hold_rms_error_non_dominant"] == pytest.approx(1.5 / np.sqrt(2))
    assert values["reach_extent_dominant"] == pytest.approx(100)
    assert values["hold_steps_1cm_non_dominant"] == 5
    assert values["reach_completion_5cm_dominant"] == 100


def test_errors_of_direction_to_both_sides_do_not_cancel(record):
    assert measure_hands(record)["reach_direction_error_dominant"] == pytest.approx(np.degrees(np.arctan2(2, 10)))


def test_a_way_ends_near_the_target_and_a_trial_at_its_end(record):
    values = measure_hands(record)
    assert values["reach_max_deviation_until_2cm_dominant"] == pytest.approx(2)
    far = dataclasses.replace(record, target=record.target + np.float32([0.1, 0]))
    assert measure_hands(far)["reach_path_ratio_until_2cm_dominant"] == pytest.approx(
        np.hypot(0.1, 0.02) / 0.18, rel=1e-4
    )
    assert measure_hands(far)["reach_path_ratio_dominant"] == pytest.approx(np.hypot(0.1, 0.02) / 0.2, rel=1e-4)


def test_only_roles_that_hands_have_and_measures_that_mean_something_in_them(record):
    names = {name for name in measure_hands(record) if name != COMBINED_LOSS}
    assert names == {
        hand_metric(name, hand, role).name
        for name, metric in HAND_METRICS.items()
        for hand, role in (("dominant", "reach"), ("non_dominant", "hold"))
        if role in metric.roles
    }


def test_the_combined_loss_is_half_of_both_over_trials_and_steps(record):
    assert measure_hands(record)[COMBINED_LOSS] == pytest.approx((1 + 3 + 2 + 4) / 4 / 10)


def test_a_metric_computes_what_the_table_has(record):
    metric = hand_metric("final_error", "non_dominant", "hold")
    assert (metric.unit, metric.better) == ("cm", "lower")
    assert metric.value(record) == measure_hands(record)[metric.name] == pytest.approx(1.5)


def test_columns_are_those_that_hands_are_measured_by():
    assert {metric.column for metric in HAND_METRICS.values()} == {*MEASURES} - {"reached_2cm"}
