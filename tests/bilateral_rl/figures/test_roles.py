"""Figures of two hands: what is drawn of which hand, role and lesion."""

import numpy as np
import pytest

from bilateral_rl.analysis.metrics import find_metric
from bilateral_rl.figures.roles import Panel, hand_panel, hands_and_roles, lesioned_arms, own_roles
from bilateral_rl.vocabulary import SIDES

MODELS = ("bi_s", "cc_s")


def of_hands(dominant, non_dominant):
    values = np.linspace(-0.1, 0.1, 5)
    return {model: dict(zip(SIDES, (dominant + values, non_dominant + values), strict=True)) for model in MODELS}


def marks(axes, what):
    return [line for line in axes.lines if line.get_gid() == what]


def test_each_hand_has_a_column_in_each_panel():
    panels = [
        hand_panel(find_metric("perpendicular_deviation_until_2cm"), "reach", of_hands(3, 4)),
        hand_panel(find_metric("hold_rms_error"), "hold", of_hands(2.5, 2)),
    ]
    figure = hands_and_roles(panels, "Reach and hold")
    reach, hold = figure.axes
    assert [float(mark.get_ydata()[0]) for mark in marks(reach, "mean")] == pytest.approx([3, 4, 3, 4])
    assert [float(mark.get_ydata()[0]) for mark in marks(hold, "mean")] == pytest.approx([2.5, 2, 2.5, 2])
    places = [float(mark.get_xdata()[0]) for mark in marks(reach, "mean")]
    assert places == sorted(places)
    filled = [mark.get_markerfacecolor() != "white" for mark in marks(reach, "mean")]
    assert filled == [True, False] * 2
    assert "Hands that hold" in hold.get_ylabel()
    assert [text.get_text() for text in hold.get_xticklabels()] == ["Bi-S", "CC-S"]


def test_what_counts_as_no_interaction_is_a_band():
    names = ("dominant hand in reach", "non-dominant hand in hold", "interaction")
    values = {model: dict.fromkeys(names, np.full(4, 12.0)) for model in MODELS}
    (axes,) = own_roles(values, "Reach and hold", margin=10).axes
    assert len(marks(axes, "mean")) == 6
    (band,) = axes.patches
    assert sorted({band.get_y(), band.get_y() + band.get_height()}) == [-10, 10]
    (without,) = own_roles(values, "Reach and hold").axes
    assert not without.patches


def test_a_model_without_values_of_a_lesion_shows_a_dash():
    panel = Panel("% of intact", {"bi_s": {"after": np.array([150.0, 170.0])}, "cc_s": {"after": np.array([np.nan])}})
    (axes,) = lesioned_arms([panel], "Reach and hold").axes
    assert len(marks(axes, "mean")) == 1
    assert [text.get_text() for text in axes.texts] == ["–"]
    assert any(np.allclose(line.get_ydata(), 100) for line in axes.lines)
