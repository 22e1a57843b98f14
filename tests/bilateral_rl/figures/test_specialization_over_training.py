import numpy as np
import pandas as pd
import pytest

from bilateral_rl.figures.specialization_over_training import specialization_over_training
from bilateral_rl.policies.lesions import LESIONS

STEPS = [0, 500_000, 1_000_000]


def probes(dominant, non_dominant, model="cc_s", measure="goal_completion_percent", control=-1000.0):
    """Rows of seeds, a list of values at each step: what each side does alone; every other state gives 77."""
    alone = {"deep_non_dominant": dominant, "deep_dominant": non_dominant}
    rows = [
        (model, seed, "trained", step, state, alone[state][seed][i] if state in alone else 77.0)
        for seed in range(len(dominant))
        for i, step in enumerate(STEPS)
        for state in ("intact", *LESIONS)
    ]
    rows += [(model, seed, "fresh", 0, state, control) for seed in range(len(dominant)) for state in alone]
    return pd.DataFrame(rows, columns=["model", "seed", "network", "timesteps", "lesion", measure])


def lines(figure, artists):
    above, below = figure.axes
    names = ("intact", "dominant alone", "non-dominant alone")
    return {name: artists(above, name)[0] for name in names} | {"index": artists(below, "index")[0]}


def test_each_hemisphere_alone_the_intact_network_and_the_index_over_the_steps(artists):
    table = probes([[10, 30, 90]], [[10, 10, 30]])
    figure = specialization_over_training(table, "random_reach")
    shown = lines(figure, artists)
    for name, values in {
        "intact": [77, 77, 77],
        "dominant alone": [10, 30, 90],
        "non-dominant alone": [10, 10, 30],
        "index": [0, 0.5, 0.5],
    }.items():
        np.testing.assert_array_equal(shown[name].get_xdata(), STEPS)
        np.testing.assert_allclose(shown[name].get_ydata(), values)


def test_the_index_is_the_mean_of_the_seeds_indices_and_the_band_its_interval(artists):
    figure = specialization_over_training(
        probes([[30, 10, 10], [10, 10, 10], [10, 10, 10]], [[10, 10, 10], [10, 10, 10], [30, 10, 10]]), "random_reach"
    )
    index = lines(figure, artists)["index"]
    np.testing.assert_allclose(index.get_ydata(), [0, 0, 0], atol=1e-12)
    band = figure.axes[1].collections[0].get_paths()[0].vertices
    half = 4.302652729696142 * 0.5 / np.sqrt(3)
    np.testing.assert_allclose(band[band[:, 0] == 0][:, 1].max(), half)
    np.testing.assert_allclose(band[band[:, 0] == 0][:, 1].min(), -half)
    assert "mean of 3 seeds" in figure.get_supxlabel()


def test_where_neither_hemisphere_does_anything_there_is_no_index(artists):
    figure = specialization_over_training(probes([[0, 0, 20]], [[0, 0, 0]]), "random_reach")
    np.testing.assert_array_equal(lines(figure, artists)["index"].get_ydata(), [np.nan, np.nan, 1])


def test_a_seed_that_stopped_keeps_its_last_values(artists):
    table = probes([[10, 20, 30], [10, 20, 30]], [[10, 10, 10], [10, 10, 10]])
    table = table[(table["seed"] == 0) | (table["timesteps"] < 1_000_000)]
    shown = lines(specialization_over_training(table, "random_reach"), artists)
    assert shown["dominant alone"].get_ydata()[-1] == 25
    np.testing.assert_allclose(shown["index"].get_ydata()[-1], (0.5 + 1 / 3) / 2)


@pytest.mark.parametrize(
    ("task", "measure", "label"),
    [
        ("random_reach", "goal_completion_percent", "Goal completion (%)"),
        ("hold_position", "time_in_goal_steps", "Time in goal (steps)"),
    ],
)
def test_a_task_is_shown_by_what_it_is_judged_by(task, measure, label):
    figure = specialization_over_training(probes([[1, 2, 3]], [[1, 2, 3]], measure=measure), task)
    above, below = figure.axes
    assert above.get_ylabel() == label
    assert below.get_xlabel() == "Environment steps"
    assert below.xaxis.get_major_formatter()(500_000) == "500 k"
    assert figure.legends[0].get_title().get_text().startswith(task.replace("_", " ").capitalize())


def test_four_models_stand_side_by_side(assert_texts_are_apart):
    rng = np.random.default_rng(0)
    models = ["cc_s", "bi_ns", "bi_s", "cc_ns"]
    table = pd.concat([probes(*(100 * rng.random((2, 3, 3))), model=model) for model in models])
    figure = specialization_over_training(table, "random_reach")
    assert [axes.get_title() for axes in figure.axes[:4]] == ["Bi-NS", "Bi-S", "CC-NS", "CC-S"]
    assert assert_texts_are_apart(figure) > 15


def test_the_lines_differ_without_color(artists):
    shown = lines(specialization_over_training(probes([[1, 2, 3]], [[3, 2, 1]]), "random_reach"), artists)
    states = [shown[name] for name in ("intact", "dominant alone", "non-dominant alone")]
    assert len({line.get_marker() for line in states}) == 3
    assert len({str(line.get_linestyle()) + str(line._unscaled_dash_pattern) for line in states}) == 3


def test_where_neither_hemisphere_does_better_than_a_fresh_network_there_is_no_index(artists, assert_texts_are_apart):
    table = probes([[10, 12, 90], [11, 9, 80]], [[10, 11, 10], [9, 12, 10]], control=10.0)
    figure = specialization_over_training(table, "random_reach")
    index = lines(figure, artists)["index"].get_ydata()
    assert np.isnan(index).tolist() == [True, True, False]
    spans = artists(figure.axes[1], "floor")
    assert [(span.get_x(), span.get_width()) for span in spans] == [(0, 750_000)]
    assert [line.get_ydata()[0] for line in artists(figure.axes[0], "control")] == [10, 10]
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words == ["intact", "dominant alone", "non-dominant alone", "fresh side alone", "at the floor"]
    assert assert_texts_are_apart(figure) > 10


def test_without_a_control_nobody_knows_the_floor(artists):
    table = probes([[10, 12, 90], [11, 9, 80]], [[10, 11, 10], [9, 12, 10]], control=10.0)
    figure = specialization_over_training(table[table["network"] == "trained"], "random_reach")  # as of version 0.1.0
    assert np.isfinite(lines(figure, artists)["index"].get_ydata()).all()
    assert len(figure.legends[0].get_texts()) == 3


def test_each_time_at_the_floor_is_shaded(artists):
    table = probes([[10, 90, 10]], [[10, 10, 10]], control=10.0)
    spans = artists(specialization_over_training(table, "random_reach").axes[1], "floor")
    assert [(span.get_x(), span.get_width()) for span in spans] == [(0, 250_000), (750_000, 250_000)]
