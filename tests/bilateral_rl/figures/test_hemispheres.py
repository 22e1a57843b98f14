import numpy as np

from bilateral_rl.analysis.modulation import Contributions
from bilateral_rl.figures.hemispheres import dominant_share, hemisphere_activity


def sides(dominant, non_dominant, n=2, steps=4, muscles=6):
    """A side's contribution to every muscle swings by the same from step to step, around a constant."""
    swing = np.where(np.arange(steps) % 2, -1.0, 1.0)[:, None] * np.array([1, -1] * (muscles // 2))  # (steps, muscles)
    return Contributions(*(np.broadcast_to(size * swing, (n, steps, muscles)) for size in (dominant, non_dominant)))


def test_the_share_is_that_of_what_varies():
    np.testing.assert_allclose(dominant_share(sides(0.6, 0.2)), np.full((2, 4), 75))
    np.testing.assert_array_equal(dominant_share(sides(0.0, 0.2)), np.zeros((2, 4)))
    assert np.isnan(dominant_share(sides(0.0, 0.0))).all()


def test_a_constant_is_no_share_of_the_control():
    still = sides(0.0, 0.2)
    braked = Contributions(still.dominant - 0.9, still.non_dominant)
    np.testing.assert_array_equal(dominant_share(braked), np.zeros((2, 4)))
    np.testing.assert_allclose(dominant_share(Contributions(sides(0.6, 0.2).dominant + 5, still.non_dominant)), 75)


def test_contributions_above_and_shares_below(assert_texts_are_apart):
    models = {"cc_s": sides(0.6, 0.2), "bi_ns": sides(0.3, 0.3), "bi_s": sides(0.1, 0.3), "cc_ns": sides(0.5, 0.5)}
    figure = hemisphere_activity(models, 0.01, "Random reach: hemispheres")
    above, below = np.array(figure.axes).reshape(2, 4)
    assert [axes.get_title() for axes in above] == ["Bi-NS", "Bi-S", "CC-NS", "CC-S"]
    dominant, non_dominant = above[3].lines
    assert (dominant.get_label(), non_dominant.get_label()) == ("dominant", "non-dominant")
    np.testing.assert_allclose(dominant.get_ydata(), 0.6)
    np.testing.assert_allclose(non_dominant.get_ydata(), 0.2)
    np.testing.assert_allclose(dominant.get_xdata(), [0, 10, 20, 30])
    np.testing.assert_allclose([axes.lines[0].get_ydata()[0] for axes in below], [50, 25, 50, 75])
    assert [axes.texts[0].get_text() for axes in below] == [f"in all {percent} %" for percent in (50, 25, 50, 75)]
    assert dominant.get_linestyle() != non_dominant.get_linestyle()
    assert dominant.get_marker() != non_dominant.get_marker()
    assert below[0].get_ylabel().endswith("(%)")
    assert below[0].get_xlabel() == "Time (ms)"
    assert assert_texts_are_apart(figure) > 20
