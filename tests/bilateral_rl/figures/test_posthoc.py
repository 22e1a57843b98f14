import math

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex
from matplotlib.patches import Rectangle

from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.figures.posthoc import posthoc_matrix, stars_of

COLUMNS = ["first", "second", "difference", "p"]


def cells(figure):
    """Text of each cell by (row's model, column's model)."""
    (axes,) = figure.axes
    rows = [label.get_text() for label in axes.get_yticklabels()]
    columns = [label.get_text() for label in axes.get_xticklabels()]
    places = {(math.floor(x), math.floor(y)): text.get_text() for text in axes.texts for x, y in [text.get_position()]}
    return {(rows[y], columns[x]): text for (x, y), text in places.items()}


def test_a_cell_is_the_row_minus_the_column_in_either_direction_of_the_pair(completion):
    pairs = [("uni_b", "bi_s", -12.5, 0.0002), ("cc_s", "uni_b", 3.25, 0.02), ("bi_s", "cc_s", 1.5, 0.4)]
    figure = posthoc_matrix(pd.DataFrame(pairs, columns=COLUMNS), "p", completion, "a test")
    assert cells(figure) == {
        ("Bi-S", "Uni-B"): "+12.5 ***\np < 0.001",
        ("CC-S", "Uni-B"): "+3.2 *\np = 0.020",
        ("CC-S", "Bi-S"): "−1.5\np = 0.400",
    }
    assert figure.get_suptitle() == "a test"
    assert "Goal completion within 5 cm (%)" in figure.get_supxlabel()


def test_pairs_that_are_missing_or_have_no_p_show_a_dash(completion):
    pairs = [("uni_b", "bi_s", 1.0, math.nan), ("uni_b", "cc_s", 1.0, 0.5)]
    figure = posthoc_matrix(pd.DataFrame(pairs, columns=COLUMNS), "p", completion, "a test")
    found = cells(figure)
    assert found["Bi-S", "Uni-B"] == "–"
    assert found["CC-S", "Bi-S"] == "–"


def test_significance_is_lightness_and_only_a_significantly_lower_row_is_hatched(completion):
    pairs = [("uni_b", "bi_s", 1.0, 0.0001), ("uni_b", "cc_s", -1.0, 0.0001), ("bi_s", "cc_s", 1.0, 0.5)]
    figure = posthoc_matrix(pd.DataFrame(pairs, columns=COLUMNS), "p", completion, "a test")
    (axes,) = figure.axes
    (mesh,) = axes.collections
    lower, higher, neither = (to_hex(mesh.cmap(mesh.norm(level))) for level in (-3, 3, 0))
    figure.draw_without_rendering()
    drawn = [to_hex(color) for color in mesh.get_facecolors()]
    assert [drawn[0], drawn[2], drawn[3]] == [lower, higher, neither]
    assert len({lower, higher, neither}) == 3
    hatched = [patch.get_xy() for patch in axes.patches if isinstance(patch, Rectangle) and patch.get_hatch()]
    assert hatched == [(0, 0)]


def test_stars():
    for p, stars in ((0.0009, "***"), (0.001, "**"), (0.01, "*"), (0.0499, "*"), (0.05, ""), (math.nan, "")):
        assert stars_of(p) == stars


def test_seven_models_fit(completion, assert_texts_are_apart):
    rng = np.random.default_rng(0)
    names = list(MODELS)
    pairs = [(a, b, 1000 * rng.normal(), rng.uniform()) for i, a in enumerate(names) for b in names[i + 1 :]]
    figure = posthoc_matrix(pd.DataFrame(pairs, columns=COLUMNS), "p", completion, "Tukey’s HSD")
    assert len(cells(figure)) == 21
    assert assert_texts_are_apart(figure) == 21 + 12 + 2


def test_no_pair_is_an_error(completion):
    with pytest.raises(ValueError, match="a pair of models"):
        posthoc_matrix(pd.DataFrame([], columns=COLUMNS), "p", completion, "a test")
