import numpy as np
import pandas as pd

from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.figures.curves import COMPLETION, FINAL_ERROR, HistoryColumn, learning_curves

LOSS = HistoryColumn("loss", "Loss")


def history(curves, model="cc_s", progress="epoch", name="loss"):
    """Rows of seeds that were trained as long as their curves are."""
    rows = [(model, seed, i + 1, value) for seed, curve in enumerate(curves) for i, value in enumerate(curve)]
    return pd.DataFrame(rows, columns=["model", "seed", progress, name])


def test_a_stopped_seed_keeps_its_last_value_in_the_mean(artists):
    figure = learning_curves(history([[4, 2], [4, 3, 2, 1], [4, 4, 4, 4]]), [LOSS], "learning")
    (line,), (tail,) = artists(figure.axes[0], "cc_s"), artists(figure.axes[0], "cc_s tail")
    np.testing.assert_array_equal(line.get_xdata(), [1, 2, 3, 4])
    np.testing.assert_allclose(line.get_ydata(), [4, 3, 8 / 3, 7 / 3])
    assert len(tail.get_xdata()) == 1


def test_the_curve_is_thick_while_half_of_the_seeds_train(artists):
    for lengths, marker in (((2, 3, 6), 3), ((2, 3, 5, 6), 5), ((6, 6, 6), 6), ((2, 2, 2, 6), 2), ((4,), 4)):
        figure = learning_curves(history([[1.0] * n for n in lengths]), [LOSS], "learning")
        (line,), (tail,) = artists(figure.axes[0], "cc_s"), artists(figure.axes[0], "cc_s tail")
        assert line.get_xdata()[-1] == marker
        assert line.get_xdata()[line.get_markevery()] == [marker]
        assert (tail.get_xdata()[0], tail.get_xdata()[-1]) == (marker, max(lengths))
        assert line.get_linewidth() > 2 * tail.get_linewidth()


def test_the_band_is_the_interval_of_the_mean():
    figure = learning_curves(history([[1, 5], [2, 5], [3, 5]]), [LOSS], "learning")
    (band,) = figure.axes[0].collections
    (path,) = band.get_paths()
    half = 4.302652729696142 / np.sqrt(3)
    np.testing.assert_allclose(path.vertices[path.vertices[:, 0] == 1][:, 1].min(), 2 - half)
    np.testing.assert_allclose(path.vertices[path.vertices[:, 0] == 1][:, 1].max(), 2 + half)
    np.testing.assert_allclose(path.vertices[path.vertices[:, 0] == 2][:, 1], 5)


def test_values_that_are_no_numbers_are_left_out(artists):
    figure = learning_curves(history([[1, 1], [3, np.nan], [np.nan, np.inf]]), [LOSS], "learning")
    np.testing.assert_array_equal(artists(figure.axes[0], "cc_s")[0].get_ydata(), [2, 2])


def test_what_a_resumed_training_repeats_counts_once(artists):
    rows = history([[1, 2, 3]])
    again = rows.iloc[[1]].assign(loss=7.0)
    figure = learning_curves(pd.concat([rows.iloc[:2], again, rows.iloc[2:]]), [LOSS], "learning")
    np.testing.assert_array_equal(artists(figure.axes[0], "cc_s")[0].get_ydata(), [1, 7, 3])


def test_a_column_an_architecture_and_a_row_a_measure(assert_texts_are_apart):
    rng = np.random.default_rng(0)
    rows = [history(100 * rng.random((3, 8)), model, name=COMPLETION.name) for model in MODELS]
    epochs = pd.concat(rows).assign(final_error_cm=lambda rows: rows[COMPLETION.name] / 10)
    figure = learning_curves(epochs, [COMPLETION, FINAL_ERROR], "Random reach: learning")
    grid = np.array(figure.axes).reshape(2, 3)
    assert [axes.get_ylabel() for axes in grid[:, 0]] == ["Goal completion (%)", "Final error (cm)"]
    assert [axes.get_xlabel() for axes in grid[1]] == ["Epoch"] * 3
    names = [[text.get_text() for text in axes.get_legend().get_texts()] for axes in grid[0]]
    assert names == [["Uni-B", "Uni-DL", "Uni-NDL"], ["Bi-NS", "Bi-S"], ["CC-NS", "CC-S"]]
    assert [axes.get_yscale() for axes in grid[:, 0]] == ["linear", "log"]
    assert assert_texts_are_apart(figure) > 20


def test_curves_of_reinforcement_learning_are_over_environment_steps(artists):
    rows = history([[1, 2, 3]], progress="timesteps").assign(timesteps=[0, 4_000_000, 8_000_000])
    figure = learning_curves(rows, [LOSS], "learning", progress="timesteps")
    (axes,) = figure.axes
    assert axes.get_xlabel() == "Environment steps"
    assert axes.xaxis.get_major_formatter()(4_000_000) == "4 M"
    assert artists(axes, "cc_s")[0].get_xdata()[-1] == 8_000_000


def test_wide_intervals_of_few_seeds_do_not_squeeze_the_curves():
    figure = learning_curves(history([[10, 90], [20, 90]]), [LOSS], "learning")
    np.testing.assert_allclose(figure.axes[0].get_ylim(), (6, 94))


def test_one_seed_has_a_curve(artists):
    figure = learning_curves(history([[3, 2, 1]]), [LOSS], "learning")
    np.testing.assert_array_equal(artists(figure.axes[0], "cc_s")[0].get_ydata(), [3, 2, 1])
