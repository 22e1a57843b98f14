import numpy as np
import pytest

from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.envs.arm.parameters import MUSCLE_NAMES
from bilateral_rl.figures import as_array, hand_paths
from bilateral_rl.figures.trials import muscle_activity, speed_profiles


def line_of(axes, label):
    return next(line for line in axes.lines if line.get_label() == label)


def band_of(axes, time):
    """Lower and upper edge of the only band, at ``time``."""
    (band,) = axes.collections
    vertices = band.get_paths()[0].vertices
    heights = vertices[np.isclose(vertices[:, 0], time), 1]
    return heights.min(), heights.max()


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def test_hand_paths_are_in_centimeters(make_record, rng):
    record = make_record(hand=rng.random((4, 11, 2)), target=np.full((4, 2), 0.25))
    (axes,) = hand_paths(record, 0.05, 0.642, n_trials=2).axes
    paths = [line.get_xydata() for line in axes.lines if len(line.get_xdata()) == 11]
    np.testing.assert_allclose(paths, 100 * record.hand[:2])
    goals = [patch for patch in axes.patches if patch.get_radius() == pytest.approx(5)]
    assert [goal.center for goal in goals] == [(25, 25)] * 2
    assert "(cm)" in axes.get_xlabel()
    assert axes.get_title() == "Hand paths of 2 trials"


def test_a_path_that_goes_below_the_shoulder_is_not_cut_off(make_record, rng):
    record = make_record(hand=rng.random((4, 11, 2)) - (0, 0.6), target=np.full((4, 2), -0.62))
    (axes,) = hand_paths(record, 0.05, 0.642).axes
    assert axes.get_ylim()[0] < -67
    (usual,) = hand_paths(make_record(), 0.05, 0.642).axes
    assert usual.get_ylim()[0] == pytest.approx(-0.35 * 1.05 * 64.2)


def test_a_picture_is_rgb(make_record):
    picture = as_array(hand_paths(make_record(), 0.05, 0.642))
    assert picture.shape == (420, 500, 3)
    assert picture.dtype == np.uint8
    assert picture.min() < 100 < 255 == picture.max()


def test_speed_is_in_centimeters_per_second_over_the_middles_of_steps(make_record):
    # Trial i moves 1, 2, 3, 4 mm a step of 20 ms: 5, 10, 15, 20 cm/s.
    hand = np.zeros((4, 11, 2))
    hand[..., 0] = 0.001 * np.arange(1, 5)[:, None] * np.arange(11)
    record = make_record(hand=hand)
    (axes,) = speed_profiles({"cc_s": [record]}, "speed").axes
    line = line_of(axes, "CC-S")
    np.testing.assert_allclose(line.get_xdata(), 10 + 20 * np.arange(10))
    np.testing.assert_allclose(line.get_ydata(), 12.5)
    np.testing.assert_allclose(band_of(axes, 50), (8.75, 16.25))
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("Time (ms)", "Hand speed (cm/s)")


def test_the_trials_of_all_seeds_count(make_record):
    still, moving = make_record(n=1), make_record(n=3, hand=np.cumsum(np.full((3, 11, 2), 0.003), axis=1) * [1, 0])
    (axes,) = speed_profiles({"uni_b": [still, moving]}, "speed").axes
    np.testing.assert_allclose(line_of(axes, "Uni-B").get_ydata(), 15 * 3 / 4)


def test_speeds_have_a_panel_an_architecture(make_record, assert_texts_are_apart):
    figure = speed_profiles({model: [make_record()] for model in reversed(MODELS)}, "Random reach: speed of the hand")
    names = [[line.get_label() for line in axes.lines] for axes in figure.axes]
    assert names == [["Uni-B", "Uni-DL", "Uni-NDL"], ["Bi-NS", "Bi-S"], ["CC-NS", "CC-S"]]
    assert assert_texts_are_apart(figure) > 10


def test_each_muscle_has_its_panel(make_record, rng, assert_texts_are_apart):
    records = [make_record(activation=rng.random((4, 10, 6))) for _ in range(2)]
    figure = muscle_activity({"uni_dl": records, "uni_ndl": [make_record()]}, "Random reach: muscles")
    assert [axes.get_title() for axes in figure.axes] == list(MUSCLE_NAMES)
    activation = np.concatenate([record.activation for record in records])
    for muscle, axes in enumerate(figure.axes):
        line = line_of(axes, "Uni-DL")
        np.testing.assert_allclose(line.get_xdata(), 20 * np.arange(1, 11))
        np.testing.assert_allclose(line.get_ydata(), activation[:, :, muscle].mean(axis=0))
        np.testing.assert_array_equal(line_of(axes, "Uni-NDL").get_ydata(), 0)
    assert figure.axes[0].get_ylabel() == "Activation (0 to 1)"
    assert figure.axes[3].get_xlabel() == "Time (ms)"
    assert assert_texts_are_apart(figure) > 15


def test_markers_of_models_stand_apart(make_record):
    figure = muscle_activity({model: [make_record(steps=50)] for model in ("uni_b", "uni_dl", "uni_ndl")}, "muscles")
    places = [set(range(line.get_markevery()[0], 50, line.get_markevery()[1])) for line in figure.axes[0].lines]
    assert [len(own) for own in places] == [5, 5, 5]
    assert len(set.union(*places)) == 15
