"""Measures hand by hand, on paths whose measures can be told by hand."""

import numpy as np
import pytest
from plain_trials import a_record

from bilateral_rl.analysis.hands import MEASURES, OF_HOLDS, OF_REACHES, hand_means, hand_table
from bilateral_rl.vocabulary import SIDES


def two_hands():
    """Two trials of 10 steps: the dominant hand reaches along x in the first, and keeps its place in the second.

    Reaches go 1 cm a step and are 1 cm off at their middle, holds are 1.5 cm off from the sixth step on.
    """
    path = np.zeros((11, 2))
    path[:, 0] = np.arange(11) / 100
    path[5, 1] = 0.01
    still = np.zeros((11, 2))
    still[6:, 1] = 0.015
    hand = np.stack([path, still, still, path])
    target = np.array([[0.0995, 0], [0, 0], [0, 0], [0.0995, 0]])
    return a_record(hand, target, trial=[0, 0, 1, 1], hand=[*SIDES] * 2)


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


def test_means_are_by_hand_and_role():
    means = hand_means(hand_table(two_hands()))
    assert means.index.tolist() == [(hand, role) for hand in SIDES for role in ("hold", "reach")]
    assert (means["trials"] == 1).all()
    assert means.loc[("dominant", "reach"), "max_deviation_m"] == pytest.approx(0.01)
    assert np.isnan(means.loc[("dominant", "hold"), "max_deviation_m"])
    assert means.loc[("non_dominant", "hold"), "drift_m"] == pytest.approx(0.015)
