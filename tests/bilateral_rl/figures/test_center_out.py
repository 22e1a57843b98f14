"""Reaches around the start: which trials belong together, and what is drawn of them."""

import dataclasses
import time

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bilateral_rl.figures import hand_paths
from bilateral_rl.figures.center_out import (
    MOST_TARGETS,
    Reaches,
    center_out,
    draw_center_out,
    has_few_targets,
    reaches_by_force,
)


@pytest.fixture
def make_reaches():
    """Builder of straight reaches of 10 cm in 20 steps to ``n_targets`` around starts that differ, in turn."""

    def make(n=16, n_targets=8, distance=0.1):
        angle = 2 * np.pi * (np.arange(n) % n_targets) / n_targets
        start = np.array([0.0, 0.4]) + 0.01 * np.arange(n)[:, None]
        offset = distance * np.stack((np.cos(angle), np.sin(angle)), axis=1)
        progress = np.linspace(0, 1, 21)[:, None]
        return Reaches(start[:, None] + progress * offset[:, None], start + offset)

    return make


@pytest.fixture
def ax():
    figure = Figure()
    FigureCanvasAgg(figure)
    return figure.subplots()


def test_trials_belong_to_their_target_wherever_they_start(make_reaches):
    numbers = make_reaches().target_numbers()
    np.testing.assert_array_equal(numbers, np.arange(16) % 8)  # by direction, from the right on
    jitter = 1e-5 * np.random.default_rng(0).standard_normal((16, 2))
    reaches = make_reaches()
    np.testing.assert_array_equal(Reaches(reaches.hand, reaches.target + jitter).target_numbers(), numbers)


def test_targets_of_one_direction_are_told_apart_by_their_distance(make_reaches):
    near, far = make_reaches(n=4, n_targets=2, distance=0.05), make_reaches(n=4, n_targets=2)
    both = Reaches(np.concatenate([near.hand, far.hand]), np.concatenate([near.target, far.target]))
    np.testing.assert_array_equal(both.target_numbers(), [0, 2, 0, 2, 1, 3, 1, 3])


def test_few_targets_are_several_that_trials_repeat(make_reaches):
    assert has_few_targets(make_reaches(n=16, n_targets=8))
    assert not has_few_targets(make_reaches(n=8, n_targets=8))  # each once
    assert not has_few_targets(make_reaches(n=8, n_targets=1))
    assert not has_few_targets(make_reaches(n=8, distance=0.0))  # a hold
    assert not has_few_targets(make_reaches(n=2 * MOST_TARGETS + 2, n_targets=MOST_TARGETS + 1))
    assert not has_few_targets(make_reaches(n=0))


def test_a_multitude_of_targets_is_not_told_apart_one_by_one(make_reaches):
    reaches = make_reaches(n=3000, n_targets=3000)
    began = time.process_time()
    assert reaches.target_numbers().max() == MOST_TARGETS
    assert time.process_time() - began < 0.5


def test_each_trial_and_the_mean_over_those_to_a_target_are_drawn_from_the_start_in_centimeters(
    make_reaches, ax, artists
):
    reaches = make_reaches()
    bent = reaches.hand.copy()
    bent[8:, 10] += (0.02, 0.0)  # the second trial to each target
    draw_center_out(ax, Reaches(bent, reaches.target), 0.01)
    trials, means = (np.array([line.get_xydata() for line in artists(ax, gid)]) for gid in ("trial", "mean"))
    relative = 100 * (bent - bent[:, :1])
    np.testing.assert_allclose(trials[::2], relative[:8], atol=1e-9)
    np.testing.assert_allclose(means, (relative[:8] + relative[8:]) / 2, atol=1e-9)
    assert len({line.get_color() for line in artists(ax, "mean")}) == 8
    assert {line.get_color() for line in artists(ax, "trial")} == {line.get_color() for line in artists(ax, "mean")}
    np.testing.assert_allclose([disc.center for disc in ax.patches], relative[:8, -1], atol=1e-9)
    assert {disc.radius for disc in ax.patches} == {1.0}
    assert ax.get_aspect() == 1.0


def test_what_goes_far_astray_does_not_hide_the_rest(make_reaches, ax):
    reaches = make_reaches()
    astray = reaches.hand.copy()
    astray[3, 5] += 50
    draw_center_out(ax, Reaches(astray, reaches.target), 0.01)
    assert 20 < ax.get_xlim()[1] < 30


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
def test_conditions_stand_side_by_side_in_the_same_measure(make_reaches, assert_texts_are_apart, n):
    names = ["null", "field", "after-effect", "channel", "field, late"][:n]
    near, far = make_reaches(distance=0.05), make_reaches(distance=0.12)
    figure = center_out({name: far if i == 1 else near for i, name in enumerate(names)}, 0.01, "Center-out: CC-S")
    panels = [axes for axes in figure.axes if axes.get_visible()]
    assert [axes.get_title() for axes in panels] == names
    limit = 105 * (0.12 if n > 1 else 0.05) + 105 * 0.01
    for axes in panels:
        assert axes.get_xlim() == axes.get_ylim() == pytest.approx((-limit, limit))
    assert assert_texts_are_apart(figure) > 5


def test_a_target_has_one_hue_in_all_panels(make_reaches, artists):
    four, two = make_reaches(n=8, n_targets=4), make_reaches(n=4, n_targets=2)
    first, second = center_out({"null": four, "field": two}, 0.01, "Center-out").axes
    hues = [line.get_color() for line in artists(first, "mean")]
    assert len(set(hues)) == 4
    assert [line.get_color() for line in artists(second, "mean")] == [hues[0], hues[2]]


def test_reaches_are_told_apart_by_the_force_and_those_without_a_cue_are_none(make_record):
    hand = np.cumsum(np.full((6, 11, 2), 0.01), axis=1)
    record = make_record(6, hand=hand, target=np.tile(hand[0, 10], (6, 1)))
    conditions = np.array(["field", "field+jump", "channel", "null", "no_go", "jump"])
    plan = dataclasses.replace(record.plan, condition=conditions)
    by_force = reaches_by_force(dataclasses.replace(record, plan=plan))
    assert {name: len(reaches.hand) for name, reaches in by_force.items()} == {"field": 2, "channel": 1, "null": 2}


def test_a_target_that_was_jumped_to_is_another_one(make_reaches):
    there = make_reaches(n=4, n_targets=2)
    jumped = Reaches(
        there.hand, there.target, there.target[[1, 1, 3, 3]] - there.hand[[1, 1, 3, 3], 0] + there.hand[:, 0]
    )
    np.testing.assert_array_equal(there.target_numbers(), [0, 1, 0, 1])
    both = Reaches(
        np.concatenate([there.hand, jumped.hand]),
        np.concatenate([there.target, jumped.target]),
        np.concatenate([there.target, jumped.first_target]),
    )
    np.testing.assert_array_equal(both.target_numbers(), [0, 2, 0, 2, 1, 2, 1, 2])


def test_hand_paths_of_an_experiment_are_drawn_around_the_start_and_others_as_ever(make_reaches, make_record):
    reaches = make_reaches()
    record = make_record(16, steps=20, hand=reaches.hand, target=reaches.target)
    names = np.array(["field", "null"]).repeat(8)
    plan = dataclasses.replace(record.plan, condition=names, goal=reaches.target)
    few = dataclasses.replace(record, plan=dataclasses.replace(plan, condition=np.full(16, "null")))
    assert [axes.get_title() for axes in hand_paths(few, 0.05, 0.642).axes] == [""]
    by_force = hand_paths(dataclasses.replace(record, plan=plan), 0.05, 0.642)
    assert [axes.get_title() for axes in by_force.axes] == ["field", "null"]
    once_each = make_reaches(n=8)
    plain = hand_paths(make_record(8, steps=20, hand=once_each.hand, target=once_each.target), 0.05, 0.642)
    assert [axes.get_title() for axes in plain.axes] == ["Hand paths of 8 trials"]
