"""Measures hand by hand, on paths whose measures can be told by hand."""

import dataclasses

import numpy as np
import pytest
from plain_trials import a_record, two_hands

from bilateral_rl.analysis.hands import MEASURES, OF_HOLDS, OF_REACHES, hand_table
from bilateral_rl.analysis.metrics import find_metric, means_something, measure, metrics_of, preferred_by_hand
from bilateral_rl.io.errors import UserError
from bilateral_rl.vocabulary import SIDES


def test_each_row_is_of_one_hand_of_one_trial():
    table = hand_table(two_hands())
    assert list(table.columns) == ["trial", "hand", "role", *MEASURES]
    assert list(table["trial"]) == [0, 0, 1, 1]
    assert list(table["hand"]) == [*SIDES] * 2
    assert list(table["role"]) == ["reach", "hold", "hold", "reach"]


def test_measures_are_those_of_the_role():
    table = hand_table(two_hands())
    reach, hold = table.iloc[0], table.iloc[1]
    assert reach[list(OF_HOLDS)].isna().all()
    assert hold[list(OF_REACHES)].isna().all()
    assert reach["max_deviation_m"] == pytest.approx(0.01)
    # Two of the eight steps until 2 cm from the target are sqrt(2) cm long; the fastest ends at (5, 1) cm.
    assert reach["path_ratio"] == pytest.approx((6 + 2 * np.sqrt(2)) / 8, rel=1e-5)
    assert reach["direction_error_rad"] == pytest.approx(np.arctan2(1, 5), rel=1e-5)
    assert reach["extent"] == pytest.approx(0.1 / 0.0995)
    assert list(reach[["reached_2cm", "completion_3cm", "completion_5cm"]]) == [1, 1, 1]
    assert reach["speed_to_goal_m_per_step"] == pytest.approx(0.0995 / 6)
    assert list(hold[["steps_1cm", "steps_2cm", "steps_5cm"]]) == [5, 10, 10]
    assert hold["rms_error_m"] == pytest.approx(0.015 / np.sqrt(2))
    assert hold["drift_m"] == pytest.approx(0.015)
    assert hold["final_error_m"] == pytest.approx(0.015)


def test_what_happens_about_the_target_counts_over_the_whole_trial_alone():
    path = np.zeros((1, 21, 2))
    path[0, :11, 0] = np.arange(11) / 100
    path[0, 11:, 0], path[0, 11:, 1] = 0.1, 0.03 * (np.arange(10) % 2)
    record = a_record(path, [[0.1, 0]])
    on_the_way, whole = (hand_table(record, near).iloc[0] for near in (0.02, None))
    assert on_the_way["max_deviation_m"] == pytest.approx(0, abs=1e-9)
    assert on_the_way["path_ratio"] == pytest.approx(1, rel=1e-5)
    assert whole["max_deviation_m"] == pytest.approx(0.03)
    assert whole["path_ratio"] == pytest.approx(1 + 9 * 0.3, rel=1e-5)


def test_an_undershoot_is_straight_and_short():
    path = np.linspace([0, 0], [0.04, 0], 11)[None]
    row = hand_table(a_record(path, [[0.1, 0]])).iloc[0]
    assert row["max_deviation_m"] == pytest.approx(0, abs=1e-9)
    assert row["extent"] == pytest.approx(0.4)
    assert row["reached_2cm"] == 0


def test_the_mirrored_direction_has_the_other_sign():
    record = a_record(np.array([[[0, 0], [0.03, 0.01]], [[0, 0], [0.03, -0.01]]]), [[0.1, 0], [0.1, 0]])
    left, right = hand_table(record)["direction_error_rad"]
    assert left == pytest.approx(-right)
    assert left > 0


def test_metrics_are_of_each_hand_in_its_role():
    alike, unlike = ({metric.name for metric in metrics_of(task, [0.05])} for task in ("two_reaches", "reach_and_hold"))
    assert {"goal_completion_5cm", "goal_completion_5cm_of_dominant", "extent_of_non_dominant"} < alike
    assert not any("hold" in name for name in alike)
    both = {f"final_error_of_{hand}_{role}" for hand in SIDES for role in ("reach", "hold")}
    assert {*both, "extent_of_dominant_reach", "hold_drift_of_non_dominant_hold", "hold_drift"} < unlike
    assert not {"extent_of_dominant_hold", "hold_drift_of_dominant_reach", "return_dominant_of_dominant"} & unlike
    assert not any("_of_" in metric.name or "_until_" in metric.name for metric in metrics_of("random_reach", [0.05]))


def test_a_metric_of_a_hand_is_found_by_its_name_and_says_whose_it_is():
    for metric in metrics_of("reach_and_hold", [0.05]):
        found = find_metric(metric.name)
        assert (found.name, found.label, found.part) == (metric.name, metric.label, metric.part)
        assert means_something(found, "reach_and_hold")
    metric = find_metric("final_error_of_non_dominant_hold")
    assert metric.label == "Final error, non-dominant hand that holds"
    assert not means_something(metric, "random_reach")
    assert not means_something(metric, "two_reaches")
    for wrong in ("return_dominant_of_dominant", "final_error_of_left", "final_error_of_dominant_rest"):
        with pytest.raises(UserError, match="of one hand of two, as in final_error_of_dominant"):
            find_metric(wrong)


def test_metrics_count_the_hands_that_they_are_of():
    record = two_hands()
    values = measure(record, metrics_of("reach_and_hold", [0.05]))
    table = hand_table(record).set_index(["hand", "role"])
    for hand in SIDES:
        assert values[f"goal_completion_5cm_of_{hand}_reach"] == 100
        of_reach, of_hold = table.loc[(hand, "reach")], table.loc[(hand, "hold")]
        assert values[f"final_error_of_{hand}_hold"] == pytest.approx(1.5)
        assert values[f"hold_drift_of_{hand}_hold"] == pytest.approx(100 * of_hold["drift_m"])
        name = "perpendicular_deviation_until_2cm"
        assert values[f"{name}_of_{hand}_reach"] == pytest.approx(100 * of_reach["max_deviation_m"])
        assert values[f"initial_direction_until_2cm_of_{hand}_reach"] == pytest.approx(np.degrees(np.arctan2(1, 5)))
    assert values["hold_drift"] == pytest.approx(1.5)
    assert values["final_error"] == pytest.approx((1.5 + 0.05) / 2, rel=1e-4)


def test_a_table_has_a_row_a_hand_in_the_frame_of_the_body():
    table = two_hands().table(0.05)
    assert list(table)[:3] == ["trial", "hand", "role"]
    assert table["start_x_m"].tolist() == pytest.approx([0.18, -0.18] * 2)
    assert table["target_x_m"].tolist() == pytest.approx([0.18 + 0.0995, -0.18, 0.18, -0.18 - 0.0995])
    assert table["target_y_m"].tolist() == [0] * 4


def test_vectors_of_the_non_dominant_arm_are_mirrored_and_not_moved():
    record = two_hands()
    vectors = np.tile(np.float32([1, 2]), (4, 3, 1))
    expected = np.tile([[[1, 2]], [[-1, 2]]], (2, 3, 1))
    np.testing.assert_array_equal(record.body_vectors(vectors), expected)
    np.testing.assert_allclose(
        record.body_positions(vectors), expected + np.tile([[[0.18, 0]], [[-0.18, 0]]], (2, 3, 1))
    )
    alone = dataclasses.replace(record, shoulder_distance=None)
    assert alone.body_vectors(vectors) is alone.body_positions(vectors) is vectors


def test_a_summary_counts_completions_of_the_hands_that_reach():
    record = two_hands()
    assert record.summary(0.01)["goal_completion_percent"] == 0  # of holds it would be 100
    assert record.summary(0.01)["time_in_goal_steps"] == pytest.approx((2 + 5) / 2)
    by_hand = record.summaries_by_hand(0.05)
    assert list(by_hand) == [(hand, role) for hand in SIDES for role in ("reach", "hold")]
    assert by_hand["dominant", "reach"]["goal_completion_percent"] == 100
    assert by_hand["dominant", "hold"] == {"time_in_goal_steps": 10, "final_error_cm": pytest.approx(1.5)}


def test_each_hand_is_judged_by_what_its_role_is():
    assert preferred_by_hand("two_holds", 0.05) == [f"time_in_goal_5cm_of_{hand}" for hand in SIDES]
    assert preferred_by_hand("reach_and_hold", 0.05) == [
        f"{name}_5cm_of_{hand}_{role}"
        for hand in SIDES
        for name, role in (("goal_completion", "reach"), ("time_in_goal", "hold"))
    ]
    assert preferred_by_hand("random_reach", 0.05) == []
