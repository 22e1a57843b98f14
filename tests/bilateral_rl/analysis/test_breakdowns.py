"""Trials taken apart, worked out by hand."""

import dataclasses
import itertools

import numpy as np
import pytest
from plain_trials import a_record, two_hands

from bilateral_rl.analysis.breakdowns import breakdown
from bilateral_rl.analysis.metrics import find_metric
from bilateral_rl.envs.tasks import NEVER
from bilateral_rl.io.errors import UserError
from bilateral_rl.vocabulary import SIDES

METRICS = [find_metric("final_error"), find_metric("peak_speed")]


@pytest.fixture
def record():
    """Three hands: one rests for two steps, and goes 10 cm to the right; two stay, one of them without a cue."""
    hand = np.zeros((3, 5, 2))
    hand[0, 3:, 0] = [0.04, 0.1]
    target = [[0.1, 0], [0, 0.2], [0, 0]]
    return a_record(
        hand, target, go=[2, 2, NEVER], target_index=[0, 1, 1], condition=["field", "null", "no_go"],
        goal=[[0.1, 0], [0, 0.2], [0, 0.2]], target_angle=[0, np.pi / 2, np.pi / 2],
    )  # fmt: skip


def test_by_target_there_is_a_row_a_target_with_its_direction(record):
    table = breakdown(record, "target", METRICS)
    assert list(table) == ["target", "target_angle_deg", "trials", "final_error", "peak_speed"]
    assert table["trials"].tolist() == [1, 2]
    np.testing.assert_allclose(table["target_angle_deg"], [0, 90])
    np.testing.assert_allclose(table["final_error"], [0, 20], atol=1e-6)  # of the second target's trial with a cue
    np.testing.assert_allclose(table["peak_speed"], [600, 0], atol=1e-3)


def test_by_condition_there_is_a_row_a_condition_that_there_is(record):
    table = breakdown(record, "condition", METRICS)
    assert table["condition"].tolist() == ["field", "null_field", "no_go"]
    np.testing.assert_allclose(table["final_error"], [0, 20, np.nan], atol=1e-6)


def test_by_phase_there_is_a_hold_before_the_cue_and_a_reach_after_it(record):
    force = np.zeros((3, 4, 2))
    force[0, 2:] = [3, 4]
    table = breakdown(dataclasses.replace(record, force=force), "phase", []).set_index("phase")
    assert table.index.tolist() == ["hold", "reach"]
    assert table["trials"].tolist() == [3, 2]  # without a cue it is all a hold
    assert table.loc["reach", "error_cm"] == pytest.approx((6 / 2 + 20) / 2, rel=1e-5)
    assert table.loc["reach", "speed_cm_per_s"] == pytest.approx((1000 / 2 + 0) / 2, rel=1e-5)
    assert table.loc["hold", "speed_cm_per_s"] == 0
    assert table["force_N"].tolist() == pytest.approx([0, 2.5])


def test_by_hand_and_role_there_is_a_row_for_each_that_there_is():
    record = two_hands()
    by_both = breakdown(record, "hand,role", METRICS)
    assert list(by_both)[:3] == ["hand", "role", "trials"]
    assert list(zip(by_both["hand"], by_both["role"], strict=True)) == [*itertools.product(SIDES, ("reach", "hold"))]
    np.testing.assert_allclose(by_both["final_error"], [0.05, 1.5, 0.05, 1.5], atol=1e-5)
    assert breakdown(record, "hand", METRICS)["trials"].tolist() == [2, 2]
    by_role = breakdown(record, "role", [find_metric("goal_completion_5cm"), find_metric("hold_rms_error")])
    assert by_role["role"].tolist() == ["reach", "hold"]
    assert by_role["goal_completion_5cm"].isna().tolist() == by_role["hold_rms_error"].notna().tolist() == [False, True]


def test_by_target_two_hands_are_told_apart_and_a_hand_that_holds_has_none():
    record = two_hands()  # what one hand does in exchange for the other is mirrored in the frame of the body
    plan = dataclasses.replace(record.plan, target_index=np.array([4, -1, -1, 4]))
    table = breakdown(dataclasses.replace(record, plan=plan), "target", METRICS)
    assert list(table)[:4] == ["target", "hand", "target_angle_deg", "trials"]
    assert list(zip(table["target"], table["hand"], table["trials"], strict=True)) == [(4, hand, 1) for hand in SIDES]
    np.testing.assert_allclose(table["target_angle_deg"], [0, 180])


def test_phases_of_two_arms_tell_hands_that_reach_from_those_that_hold():
    table = breakdown(two_hands(), "phase", [])
    assert table["phase"].tolist() == ["reach", "hold"]
    assert table["trials"].tolist() == [2, 2]
    assert table["error_cm"].tolist() == pytest.approx([4.47, 0.75], rel=1e-3)


def test_one_arm_has_no_hands_to_tell_apart(record):
    with pytest.raises(UserError, match="--by hand,role tells two hands apart"):
        breakdown(record, "hand,role", METRICS)


def test_what_is_no_list_or_no_part_is_refused(record):
    plan = dataclasses.replace(record.plan, target_index=np.full(3, -1))
    with pytest.raises(UserError, match="no list"):
        breakdown(dataclasses.replace(record, plan=plan), "target", METRICS)
    with pytest.raises(UserError, match="role, or 'hand,role' for both, got 'hour'"):
        breakdown(record, "hour", METRICS)
