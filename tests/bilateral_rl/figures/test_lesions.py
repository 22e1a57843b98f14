import numpy as np
import pandas as pd
import pytest

from bilateral_rl.figures.lesions import lesion_effects
from bilateral_rl.figures.specialization import specialization
from bilateral_rl.policies.lesions import LESIONS

STATES = ("intact", *LESIONS)
BILATERAL = ("bi_ns", "bi_s", "cc_ns", "cc_s")


@pytest.fixture
def values():
    """Two seeds of each state that the model can have; the number of the state, 0.5 more when retrained."""
    return {
        (model, state, protocol): [i + shift, i + shift + 2]
        for model in BILATERAL
        for i, state in enumerate(STATES)
        if model.startswith("cc") or "callosum" not in state
        for protocol, shift in (("none", 0.0), ("output", 0.5))
    }


def test_each_state_shows_its_values_without_and_with_retraining(make_results, completion, values, artists):
    figure = lesion_effects(make_results(completion, values), "random_reach", completion, BILATERAL)
    axes = figure.axes[BILATERAL.index("cc_s")]
    means = artists(axes, "mean")
    assert [mean.get_ydata()[0] for mean in means] == [i + 1 + shift for i in range(8) for shift in (0, 0.5)]
    assert [round(mean.get_xdata()[0]) for mean in means] == [i for i in range(8) for _ in range(2)]
    assert len({mean.get_marker() for mean in means[::2]}) == len({mean.get_marker() for mean in means}) / 2 == 1
    assert len({mean.get_color() for mean in means}) == 2
    for mean, seeds in zip(means, artists(axes, "seeds"), strict=True):
        np.testing.assert_array_equal(seeds.get_ydata(), mean.get_ydata()[0] + np.array([-1, 1]))
        assert seeds.get_xdata().mean() == pytest.approx(mean.get_xdata()[0])


def test_a_panel_a_model_and_the_states_in_words(make_results, completion, values, assert_texts_are_apart):
    figure = lesion_effects(make_results(completion, values), "random_reach", completion, BILATERAL)
    assert [axes.get_title() for axes in figure.axes] == ["Bi-NS", "Bi-S", "CC-NS", "CC-S"]
    assert all(axes.get_ylabel().endswith("(%)") for axes in figure.axes)
    words = [label.get_text().replace("\n", " ") for label in figure.axes[-1].get_xticklabels()]
    assert words[:2] == ["intact", "shallow dominant"]
    assert words[-1] == "callosum, deep non- dominant"
    assert assert_texts_are_apart(figure) > 30


def test_a_lesion_that_a_model_cannot_have_shows_dashes(make_results, completion, values, artists):
    figure = lesion_effects(make_results(completion, values), "random_reach", completion, ["bi_s", "cc_s"])
    without, with_callosum = figure.axes
    dashes = [text for text in without.texts if text.get_text() == "–"]
    assert [dash.get_position()[0] for dash in dashes] == [5, 6, 7]
    assert len(artists(without, "mean")) == 10
    assert not with_callosum.texts
    assert "–: no value" in figure.get_supxlabel()


def test_a_line_across_each_column_is_the_mean_of_fresh_networks(make_results, completion, values, artists):
    fresh = {key: [10 * values[0], 10 * values[0] + 4] for key, values in values.items()}
    both = [make_results(completion, values), make_results(completion, fresh, network="fresh")]
    figure = lesion_effects(pd.concat(both), "random_reach", completion, ["cc_s"])
    means, controls = (artists(figure.axes[0], gid) for gid in ("mean", "control"))
    for mean, control in zip(means, controls, strict=True):
        (((left, y), (right, _)),) = control.get_segments()
        assert y == 10 * (mean.get_ydata()[0] - 1) + 2
        assert (left + right) / 2 == pytest.approx(mean.get_xdata()[0])
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()][-1] == "fresh networks, treated alike"


def test_many_protocols_go_on_in_a_further_panel(make_results, completion, artists, assert_texts_are_apart):
    names = ["everything-3-epochs", "everything", "output-lr-0.01", "none", "output", "combination-continued"]
    table = make_results(
        completion, {("cc_s", state, name): [i, i + 1] for i, name in enumerate(names) for state in STATES}
    )
    figure = lesion_effects(table, "random_reach", completion, ["cc_s"])
    shown = [artists(axes, "mean")[:3] for axes in figure.axes]
    assert [mean.get_ydata()[0] - 0.5 for part in shown for mean in part] == [3, 4, 1, 0, 2, 5]
    assert len({(mean.get_marker(), mean.get_color()) for part in shown for mean in part}) == 6
    assert [axes.get_title() for axes in figure.axes] == ["CC-S", ""]
    assert assert_texts_are_apart(figure) > 20
    chosen = lesion_effects(table, "random_reach", completion, ["cc_s"], ["output", "none"])
    assert [mean.get_ydata()[0] - 0.5 for mean in artists(chosen.axes[0], "mean")[:2]] == [4, 3]


def test_a_network_without_hemispheres_stands_in_the_middle(make_results, completion, artists, assert_texts_are_apart):
    protocols = ("none", "output", "everything")
    table = make_results(completion, {("uni_b", "intact", name): [80.0, 90.0] for name in protocols})
    figure = lesion_effects(table, "random_reach", completion, ["uni_b"])
    (axes,) = figure.axes
    places = [mean.get_xdata()[0] for mean in artists(axes, "mean")]
    assert sum(axes.get_xlim()) == pytest.approx(0)
    assert max(places) - min(places) < 0.2 * (axes.get_xlim()[1] - axes.get_xlim()[0])
    assert assert_texts_are_apart(figure) > 5


def test_the_note_says_what_a_value_of_two_hands_is(make_results, completion, values, assert_texts_are_apart):
    hands = "Values are means of both hands, where they reach. A spring of 50 N/m ties the hands."
    figure = lesion_effects(make_results(completion, values), "random_reach", completion, ["cc_s"], hands=hands)
    assert figure.get_supxlabel().endswith(hands)
    assert_texts_are_apart(figure)


def test_a_line_goes_through_the_intact_mean(make_results, completion, values, artists):
    figure = lesion_effects(make_results(completion, values), "random_reach", completion, ["cc_s"])
    (line,) = artists(figure.axes[0], "intact")
    assert line.get_ydata() == [1, 1]


def test_without_any_retraining_there_is_one_column_in_the_middle(make_results, completion, values, artists):
    plain = {key: value for key, value in values.items() if key[2] == "none"}
    figure = lesion_effects(make_results(completion, plain), "random_reach", completion, ["cc_s"])
    assert [mean.get_xdata()[0] for mean in artists(figure.axes[0], "mean")] == list(range(8))
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["without retraining"]


def deep_lesions(dominant_alone, non_dominant_alone, protocol="none"):
    return {
        ("bi_s", "deep_non_dominant", protocol): dominant_alone,
        ("bi_s", "deep_dominant", protocol): non_dominant_alone,
    }


def test_the_index_is_positive_where_the_dominant_hemisphere_does_better_alone(make_results, completion, artists):
    reach = make_results(completion, deep_lesions([90, 60, 0], [30, 60, 0]))
    hold = make_results(completion, deep_lesions([10, 10, 10], [30, 10, 90]), task="hold_position")
    metrics = {"random_reach": completion, "hold_position": completion}
    figure = specialization(pd.concat([reach, hold]), metrics, ["bi_s"])
    first, second = artists(figure.axes[0], "seeds")
    np.testing.assert_allclose(first.get_ydata(), [0.5, 0, np.nan])
    np.testing.assert_allclose(second.get_ydata(), [-0.5, 0, -0.8])
    means = [mean.get_ydata()[0] for mean in artists(figure.axes[0], "mean")]
    np.testing.assert_allclose(means, [0.25, -1.3 / 3])
    assert first.get_xdata().mean() < second.get_xdata().mean()


def test_the_index_pairs_values_by_seed_and_leaves_out_seeds_without_both(make_results, completion, artists):
    results = make_results(completion, deep_lesions([10, 30, 50], [10, 10, 10]))
    results = results[~((results["seed"] == 0) & (results["lesion"] == "deep_dominant"))].iloc[::-1]
    figure = specialization(results, {"random_reach": completion}, ["bi_s"])
    np.testing.assert_allclose(artists(figure.axes[0], "seeds")[0].get_ydata(), [20 / 40, 40 / 60])


def test_the_index_after_retraining_is_of_the_retrained_values(make_results, completion, artists):
    values = deep_lesions([10], [10]) | deep_lesions([30], [10], protocol="output")
    figure = specialization(make_results(completion, values), {"random_reach": completion}, ["bi_s"], protocol="output")
    assert artists(figure.axes[0], "mean")[0].get_ydata() == [0.5]
    assert figure.legends[0].get_title().get_text().endswith("output layer retrained")


def test_hemispheres_at_the_floor_have_no_index(make_results, completion, artists, assert_texts_are_apart):
    lesions = deep_lesions([30, 31, 33], [20, 22, 21]) | deep_lesions([7, 5, 6], [4, 8, 5], protocol="output")
    fresh = {key: [5, 7, 6] for key in lesions}
    both = pd.concat([make_results(completion, lesions), make_results(completion, fresh, network="fresh")])
    kept, relearned = (
        specialization(both, {"random_reach": completion}, ["bi_s"], name) for name in ("none", "output")
    )
    assert not artists(kept.axes[0], "floor")
    assert artists(kept.axes[0], "mean")
    (words,) = artists(relearned.axes[0], "floor")
    assert words.get_text() == "at the floor"
    assert not artists(relearned.axes[0], "mean")
    assert "no better than" in relearned.get_supxlabel()
    assert assert_texts_are_apart(relearned) > 8


def test_models_without_hemispheres_show_dashes_in_the_specialization(make_results, completion, assert_texts_are_apart):
    results = make_results(completion, deep_lesions([90, 60], [30, 60]))
    metrics = {"random_reach": completion, "hold_position": completion}
    figure = specialization(results, metrics, ["uni_b", "bi_s"])
    assert sum(text.get_text() == "–" for text in figure.axes[0].texts) == 3  # hold_position has no values at all
    assert assert_texts_are_apart(figure) > 8
