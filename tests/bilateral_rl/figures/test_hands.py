"""Figures of two arms: paths in the frame of the body, and panels by hand and role."""

import dataclasses

import numpy as np
import pytest
from plain_trials import two_hands

from bilateral_rl.figures import hand_paths
from bilateral_rl.figures.center_out import reaches_by_force
from bilateral_rl.figures.hands import HAND_STYLES
from bilateral_rl.figures.trials import muscle_activity, speed_profiles

REACH = 0.642


@pytest.fixture(scope="module")
def record():
    return two_hands()


def test_both_hands_are_drawn_in_the_frame_of_the_body_and_holds_as_rings(record, assert_texts_are_apart):
    figure = hand_paths(record, 0.05, REACH)
    (axes,) = figure.axes
    for hand, sign in (("dominant", 1), ("non_dominant", -1)):
        (path,) = [line for line in axes.lines if line.get_gid() == f"{hand} reach"]
        np.testing.assert_allclose(path.get_xdata(), sign * (18 + np.arange(11)), atol=1e-4)
        np.testing.assert_allclose(path.get_ydata()[5], 1)
        assert path.get_color() == HAND_STYLES[hand, "reach"].color
    goals = {patch.center: patch.get_fill() for patch in axes.patches if patch.get_radius() == pytest.approx(5)}
    assert sorted((round(float(x), 2), filled) for (x, _), filled in goals.items()) == [
        (-27.95, True), (-18.0, False), (18.0, False), (27.95, True),
    ]  # fmt: skip
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [
        "dominant hand", "non-dominant hand", "starts to reach", "holds",
    ]  # fmt: skip
    assert assert_texts_are_apart(figure) > 10


def test_speeds_and_muscles_have_panels_for_each_hand_in_each_role(record, assert_texts_are_apart):
    activation = np.zeros((4, 10, 6), dtype=np.float32)
    activation[2, :, 4] = 0.5  # of the dominant arm, which holds in the second trial
    figure = speed_profiles({"cc_s": [record]}, "Reach and hold: speed of the hand")
    parts = [axes.get_ylabel().splitlines()[1] for axes in figure.axes]
    assert parts == [f"{hand} hand, {role}" for hand in ("dominant", "non-dominant") for role in ("reach", "hold")]
    for axes, expected in zip(figure.axes, (100, 0, 100, 0), strict=True):
        (line,) = axes.lines
        assert line.get_ydata()[0] == pytest.approx(expected, abs=1e-3)
    assert assert_texts_are_apart(figure) > 10
    figure = muscle_activity({"cc_s": [dataclasses.replace(record, activation=activation)]}, "Muscles")
    active = [i for i, axes in enumerate(figure.axes) if axes.lines[0].get_ydata().any()]
    assert active == [6 + 4]  # the second row, of six panels
    assert assert_texts_are_apart(figure) > 20


def test_a_few_targets_have_panels_by_hand_and_what_holds_is_none_of_their_reaches(record):
    reaches = reaches_by_force(record)
    assert [*reaches] == ["dominant hand", "non-dominant hand"]
    np.testing.assert_allclose(reaches["non-dominant hand"].target[0], (-0.18 - 0.0995, 0), atol=1e-6)
    in_field = dataclasses.replace(record.plan, condition=np.array(["field", "null", "null", "null"]))
    assert [*reaches_by_force(dataclasses.replace(record, plan=in_field))] == [
        "dominant hand, field", "non-dominant hand, null",
    ]  # fmt: skip
