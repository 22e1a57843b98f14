import math

import pytest

from bilateral_rl.analysis.intervals import Interval
from bilateral_rl.figures.specification_curve import Specification, specification_curve

SAME = {"load": "each axis"}


def specification(value, verdict, half=0.1, **choices):
    return Specification(Interval(value, value - half, value + half, 5), verdict, SAME | choices)


THREE = [
    specification(0.3, "supported", retraining="output", radius="5 cm"),
    specification(-0.2, "not supported", retraining="everything", radius="5 cm"),
    specification(0.05, "undecided", retraining="output", radius="1 cm"),
]


def places(figure, artists, gid):
    """(x, y) of what was drawn with a group id, from left to right."""
    lines = [line for axes in figure.axes for line in artists(axes, gid)]
    return sorted((float(x), float(y)) for line in lines for x, y in zip(*line.get_data(), strict=True))


def test_effects_rise_from_left_to_right_in_percent(artists):
    figure = specification_curve(THREE, "C4")
    assert places(figure, artists, "effect") == [(0, pytest.approx(-20)), (1, pytest.approx(5)), (2, pytest.approx(30))]
    bars = [bar.get_segments()[0][:, 1].tolist() for bar in artists(figure.axes[0], "interval")]
    assert bars == [pytest.approx([-30, -10]), pytest.approx([-5, 15]), pytest.approx([20, 40])]


def test_each_column_has_a_dot_for_each_of_its_choices_and_what_all_choose_is_left_out(artists):
    figure = specification_curve(THREE, "C4")
    labels = [label.get_text() for label in figure.axes[1].get_yticklabels()]
    assert labels == ["retraining:  output", "everything", "radius:  5 cm", "1 cm"]
    assert places(figure, artists, "choice") == [(0, 1), (0, 2), (1, 0), (1, 3), (2, 0), (2, 2)]


def test_verdicts_differ_in_color_and_marker(artists):
    figure = specification_curve(THREE, "C4")
    drawn = artists(figure.axes[0], "effect")
    assert len({line.get_color() for line in drawn}) == len({line.get_marker() for line in drawn}) == 3
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["supported", "undecided", "not supported"]


def test_intervals_without_end_do_not_hide_the_effects():
    wide = [*THREE, specification(0.1, "undecided", math.inf, retraining="output", radius="2 cm")]
    low, high = specification_curve(wide, "C4").axes[0].get_ylim()
    assert -60 < low < -30
    assert 40 < high < 70


def test_a_reading_without_an_effect_stands_last_as_a_dash(artists):
    none = Specification(Interval(math.nan, math.nan, math.nan, 0), "undecided", THREE[0].choices | {"radius": "2 cm"})
    figure = specification_curve([none, *THREE], "C4")
    assert len(places(figure, artists, "effect")) == 3
    (dash,) = [text for text in figure.axes[0].texts if text.get_text() == "–"]
    assert dash.get_position()[0] == 3


def test_one_reading_is_a_curve_too(assert_texts_are_apart):
    figure = specification_curve(THREE[:1], "C4")
    assert [label.get_text() for label in figure.axes[1].get_yticklabels()] == []
    assert_texts_are_apart(figure)


def test_forty_three_readings_fit(assert_texts_are_apart):
    verdicts = ("supported", "undecided", "not supported")
    many = [
        specification(
            i / 50 - 0.3,
            verdicts[i % 3],
            retraining=("output", "everything")[i % 2],
            **{"hemisphere alone": ("deep", "shallow")[i == 7], **{f"choice {j}": "ab"[i == j] for j in range(15)}},
        )
        for i in range(43)
    ]
    assert assert_texts_are_apart(specification_curve(many, "C4: the hemispheres specialize")) > 34


def test_no_reading_is_an_error():
    with pytest.raises(ValueError, match="needs a specification"):
        specification_curve([], "C4")
