import itertools

import numpy as np
import pandas as pd
import pytest

from bilateral_rl.analysis.hands import contralesional_hand
from bilateral_rl.analysis.metrics import find_metric
from bilateral_rl.figures.lesioned_hands import lesioned_hands
from bilateral_rl.policies.lesions import LESIONS
from bilateral_rl.vocabulary import SIDES

TASK, ERROR = "reach_and_hold", find_metric("final_error")
STATES = ("intact", "callosum", "deep_dominant", "deep_non_dominant")
HANDS = [*itertools.product(SIDES, ("reach", "hold"))]


@pytest.fixture
def results(make_results):
    """Builder of a table of two seeds, 10 times the lesion's number, and 1 more for each hand and role."""

    def make(hands=HANDS, states=STATES, protocols=("none", "output"), network="trained", more=0):
        return pd.concat(
            make_results(
                ERROR.of(*hand),
                {("cc_s", state, protocol): [10 * i + j + more, 10 * i + j + more + 2] for i, state in enumerate(states)
                 for protocol in protocols},
                TASK, network,
            )
            for j, hand in enumerate(hands)
        )  # fmt: skip

    return make


def test_each_hand_in_each_role_has_a_column_of_its_own_look(results, artists, assert_texts_are_apart):
    table = pd.concat([results(), results(network="fresh", more=50)])
    figure = lesioned_hands(table, TASK, ERROR, "cc_s", 50)
    assert [axes.get_title() for axes in figure.axes] == ["without retraining", "output layer retrained"]
    for axes in figure.axes:
        means = artists(axes, "mean")
        assert [mean.get_ydata()[0] for mean in means] == [10 * i + j + 1 for i in (0, 2, 3, 1) for j in range(4)]
        assert [round(mean.get_xdata()[0]) for mean in means] == [i for i in range(4) for _ in range(4)]
        assert len({mean.get_marker() for mean in means}) == len({mean.get_color() for mean in means}) == 4
        lines = [line.get_segments()[0][0, 1] for line in artists(axes, "control")]
        assert lines == [mean.get_ydata()[0] + 50 for mean in means]
        assert axes.get_ylim() == (0, pytest.approx(1.1 * 84))
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words == [
        "dominant hand, reach", "dominant hand, hold", "contralesional hand",
        "non-dominant hand, reach", "non-dominant hand, hold", "fresh networks, treated alike",
    ]  # fmt: skip
    assert "A spring of 50 N/m ties the hands." in figure.get_supxlabel()
    assert assert_texts_are_apart(figure) > 20


def test_the_contralesional_hand_is_shaded_where_a_hemisphere_has_a_deep_lesion(results, artists):
    figure = lesioned_hands(results(protocols=("none",)), TASK, ERROR, "cc_s", 0)
    (axes,) = figure.axes
    shaded = [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in artists(axes, "contralesional")]
    columns = [mean.get_xdata()[0] for mean in artists(axes, "mean")]
    within = [[low <= x <= high for x in columns] for low, high in shaded]
    assert [np.flatnonzero(of).tolist() for of in within] == [[4, 5], [10, 11]]
    assert "No spring ties the hands." in figure.get_supxlabel()


def test_without_a_deep_lesion_no_hand_is_contralesional(results, artists, assert_texts_are_apart):
    figure = lesioned_hands(results(states=("intact", "callosum")), TASK, ERROR, "cc_s", 0)
    assert not artists(figure.axes[0], "contralesional")
    assert "ontralesional" not in figure.get_supxlabel() + "".join(t.get_text() for t in figure.legends[0].get_texts())
    assert_texts_are_apart(figure)


def test_hands_that_do_the_same_have_a_column_each_and_one_arm_has_no_figure(results, make_results, artists):
    figure = lesioned_hands(results(hands=[(hand, None) for hand in SIDES]), TASK, ERROR, "cc_s", 0)
    assert len(artists(figure.axes[0], "mean")) == 2 * len(STATES)
    of_one = make_results(ERROR, {("cc_s", "intact", "none"): [1, 2]}, TASK)
    assert lesioned_hands(of_one, TASK, ERROR, "cc_s", 0) is None


def test_the_contralesional_hand_has_the_name_of_the_lesioned_hemisphere():
    assert {name: hand for name in ("intact", *LESIONS) if (hand := contralesional_hand(name))} == {
        "deep_dominant": "dominant", "deep_non_dominant": "non_dominant",
        "callosum_deep_dominant": "dominant", "callosum_deep_non_dominant": "non_dominant",
    }  # fmt: skip
