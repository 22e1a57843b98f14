import numpy as np
import pandas as pd
import pytest

from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.figures.models import model_comparison

T_975 = 4.302652729696142
"""Student's t with two degrees of freedom at 97.5 %, from a printed table: 4.303."""


@pytest.fixture
def values():
    return {(model, "intact", "none"): 90 + np.arange(3.0) + i for i, model in enumerate(MODELS)}


def test_seeds_means_and_intervals_are_those_of_the_table(make_results, completion, values, artists):
    figure = model_comparison(make_results(completion, values), "random_reach", [completion])
    (axes,) = figure.axes
    for i, (seeds, mean, bar) in enumerate(
        zip(artists(axes, "seeds"), artists(axes, "mean"), artists(axes, "interval"), strict=True)
    ):
        np.testing.assert_array_equal(seeds.get_ydata(), [90 + i, 91 + i, 92 + i])
        assert (mean.get_xdata()[0], mean.get_ydata()[0]) == (i, 91 + i)
        half = T_975 / np.sqrt(3)  # the standard deviation is 1
        np.testing.assert_allclose(bar.get_segments()[0], [[i, 91 + i - half], [i, 91 + i + half]])
    assert len(artists(axes, "seeds")) == len(MODELS)


def test_models_stand_in_the_catalogues_order_whatever_the_tables(make_results, completion, values):
    subset = {key: values[key] for key in reversed(values) if key[0] != "bi_ns"}
    figure = model_comparison(make_results(completion, subset), "random_reach", [completion])
    labels = [label.get_text() for label in figure.axes[0].get_xticklabels()]
    assert labels == ["Uni-B", "Uni-DL", "Uni-NDL", "Bi-S", "CC-NS", "CC-S"]


def test_a_panel_a_metric_with_its_unit(make_results, completion, deviation, values, assert_texts_are_apart):
    results = make_results(completion, values)
    results = pd.concat([results, make_results(deviation, values)])
    figure = model_comparison(results, "random_reach", [completion, deviation])
    assert [axes.get_ylabel().split("(")[1] for axes in figure.axes] == ["%)", "cm)"]
    assert assert_texts_are_apart(figure) > 10


def test_lesioned_retrained_and_other_tasks_rows_are_not_drawn(make_results, completion, artists):
    results = make_results(
        completion,
        {("cc_s", "intact", "none"): [1.0], ("cc_s", "intact", "output"): [2.0], ("cc_s", "callosum", "none"): [3.0]},
    )
    other = make_results(completion, {("uni_b", "intact", "none"): [4.0]}, task="hold_position")
    figure = model_comparison(pd.concat([results, other]), "random_reach", [completion])
    (mean,) = artists(figure.axes[0], "mean")
    assert mean.get_ydata() == [1.0]


def test_seeds_that_are_no_numbers_are_left_out(make_results, completion, artists):
    values = {("uni_b", "intact", "none"): [1.0, np.nan, 3.0], ("uni_dl", "intact", "none"): [np.nan] * 3}
    figure = model_comparison(make_results(completion, values), "random_reach", [completion])
    (axes,) = figure.axes
    (mean,) = artists(axes, "mean")
    assert mean.get_ydata() == [2.0]
    dash = next(text for text in axes.texts if text.get_text() == "–")
    assert dash.get_position()[0] == 1
    assert "mean of 2 seeds" in figure.get_supxlabel()


def test_one_seed_has_no_interval(make_results, completion, artists):
    results = make_results(completion, {("uni_b", "intact", "none"): [5.0]})
    figure = model_comparison(results, "random_reach", [completion])
    assert not artists(figure.axes[0], "interval")
    assert artists(figure.axes[0], "mean")[0].get_ydata() == [5.0]
    assert figure.get_supxlabel() == "Markers: 1 seed."


def test_each_seed_has_its_own_place_in_every_column(make_results, completion, values, artists):
    figure = model_comparison(make_results(completion, values), "random_reach", [completion])
    places = [seeds.get_xdata() - i for i, seeds in enumerate(artists(figure.axes[0], "seeds"))]
    assert len(set(places[0])) == 3
    assert min(abs(places[0])) > 0.05  # else the mean's marker would hide it
    np.testing.assert_allclose(places, np.broadcast_to(places[0], (len(MODELS), 3)), atol=1e-12)
