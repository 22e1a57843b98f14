"""Adaptation by block, and forces on a channel."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bilateral_rl.figures.adaptation import adaptation, draw_channel_force


@pytest.fixture
def make_blocks():
    """Builder of four blocks of seeds: field 3, null -2, and the seed's number on top; compensation 0.5 a block."""

    def make(n_seeds):
        rows = [
            (seed, block, condition, value + seed, 1.0, 0.5 * block if condition == "channel" else np.nan)
            for seed in range(n_seeds)
            for block in range(4)
            for condition, value in (("field", 3.0), ("null", -2.0), ("channel", 0.0))
        ]
        names = ["seed", "block", "condition", "deviation_at_peak_speed", "final_error", "channel_compensation"]
        return pd.DataFrame(rows, columns=names)

    return make


@pytest.mark.parametrize("n_seeds", [1, 3])
def test_an_adaptation_shows_error_after_effect_and_compensation(make_blocks, artists, assert_texts_are_apart, n_seeds):
    figure = adaptation(make_blocks(n_seeds), "Curl field: CC-S")
    deviation, error, compensation = figure.axes
    for condition, value in (("field", 3.0), ("null", -2.0)):
        (line,) = artists(deviation, condition)
        np.testing.assert_allclose(line.get_xydata(), [(block, value + (n_seeds - 1) / 2) for block in range(4)])
    assert [len(artists(axes, "channel")) for axes in figure.axes] == [0, 0, 1]
    np.testing.assert_allclose(artists(compensation, "channel")[0].get_ydata(), [0, 0.5, 1, 1.5])
    assert "cm" in error.get_ylabel()
    assert assert_texts_are_apart(figure) > 10


def test_what_a_hold_has_no_numbers_of_is_not_drawn(make_blocks):
    blocks = make_blocks(1)
    figure = adaptation(blocks[blocks["condition"] != "channel"], "An elastic field")
    assert len(figure.axes) == 2


def test_force_on_the_channel_stands_beside_the_one_that_would_cancel_the_field():
    figure = Figure()
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    force, ideal = np.tile([0.0, 1.0, 2.0], (4, 1)), np.tile([0.0, 2.0, 4.0], (4, 1))
    draw_channel_force(axes, force, ideal, 0.02, np.zeros(4, dtype=int))
    by_words = {line.get_label(): line.get_xydata() for line in axes.lines}
    np.testing.assert_allclose(by_words["on the wall"], [(0, 0), (20, 1), (40, 2)])
    np.testing.assert_allclose(by_words["would cancel the field"], [(0, 0), (20, 2), (40, 4)])
