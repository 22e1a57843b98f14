"""What each seed trains on: the tasks' trials, and random streams that do not touch each other."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from bilateral_rl.bptt.trials import (
    epoch_order,
    initial_weights_seed,
    retraining_trials,
    training_trials,
    validation_trials,
)
from bilateral_rl.envs import TrialSettings
from bilateral_rl.envs.tasks import make_task

TASKS = ("random_reach", "hold_position")
UPPER = np.deg2rad([135.0, 155.0])
SETTINGS = TrialSettings()


def draw(task, seed=0, n=400, settings=SETTINGS, stream=training_trials):
    return [part.double().numpy() for part in stream(seed, n, make_task(task), settings)]


def hand_of(posture):
    upper, lower = SETTINGS.arm.link_length
    shoulder, both = posture[:, 0], posture.sum(1)
    return np.stack(
        [upper * np.cos(shoulder) + lower * np.cos(both), upper * np.sin(shoulder) + lower * np.sin(both)], axis=1
    )


def posture_of(hand):
    """Joint angles of a hand position: the law of cosines."""
    upper, lower = SETTINGS.arm.link_length
    cosine = ((hand**2).sum(1) - upper**2 - lower**2) / (2 * upper * lower)
    elbow = np.arccos(cosine.clip(-1, 1))
    inner = np.arctan2(lower * np.sin(elbow), upper + lower * np.cos(elbow))
    shoulder = (np.arctan2(hand[:, 1], hand[:, 0]) - inner + 1.0) % (2 * np.pi) - 1.0
    return np.stack([shoulder, elbow], axis=1)


def assert_uniform(values, low, high):
    """Within the range, and as often in each quarter of it."""
    assert (values >= low).all()
    assert (values <= high).all()
    scaled = (values - low) / (high - low)
    for column in scaled.T:
        quarters = np.histogram(column, bins=4, range=(0, 1))[0] / len(column)
        assert np.abs(quarters - 0.25).max() < 0.1


def test_starts_are_postures_spread_over_the_joints_range():
    for task in TASKS:
        for stream in (training_trials, validation_trials):
            start, *_ = draw(task, stream=stream)
            assert start.shape == (400, 2)
            assert_uniform(start, 0.0, UPPER * (1 + 1e-6))


def test_a_reach_ends_at_the_hand_of_another_posture_without_a_load():
    start, target, load = draw("random_reach")
    posture = posture_of(target)
    assert_uniform(posture, -2e-3, UPPER + 2e-3)  # float32 blurs the elbow where it is stretched
    assert np.linalg.norm(target, axis=1).max() <= sum(SETTINGS.arm.link_length)
    correlation = np.corrcoef(np.concatenate([start, posture], axis=1).T)
    assert np.abs(correlation - np.eye(4)).max() < 0.2
    assert not load.any()


def test_a_hold_ends_where_it_starts_under_a_load_within_its_bound():
    start, target, load = draw("hold_position", settings=TrialSettings(max_load=3.0))
    np.testing.assert_allclose(target, hand_of(start), atol=1e-6)
    assert_uniform(load, -3.0, 3.0)
    assert abs(np.corrcoef(load.T)[0, 1]) < 0.2


def test_a_hold_is_trained_on_under_the_load_that_is_asked_for():
    for stream in (training_trials, validation_trials, retraining_trials):
        by_axes = np.hypot(*draw("hold_position", stream=stream)[2].T)
        by_direction = np.hypot(*draw("hold_position", stream=stream, settings=TrialSettings(load="direction"))[2].T)
        assert by_axes.max() > 10
        assert_uniform(by_direction[:, None], 0, 10)


def test_no_trial_comes_twice_in_any_stream_of_any_seed():
    for task in TASKS:
        starts = [draw(task, seed, 50, stream=s)[0] for seed in range(6) for s in (training_trials, validation_trials)]
        assert len(np.unique(np.concatenate(starts), axis=0)) == 6 * 2 * 50


@pytest.mark.parametrize(("task", "stream"), [("random_reach", training_trials), ("hold_position", validation_trials)])
def test_a_seed_has_the_same_trials_whatever_else_is_drawn(task, stream):
    first = draw(task, seed=3, n=20, stream=stream)
    np.random.seed(1)  # noqa: NPY002 - what a caller may do
    torch.manual_seed(1)
    other = {training_trials: validation_trials, validation_trials: training_trials}[stream]
    draw(task, seed=3, n=7, stream=other)
    epoch_order(3, 0, 20)
    for a, b in zip(first, draw(task, seed=3, n=20, stream=stream), strict=True):
        np.testing.assert_array_equal(a, b)


@given(st.integers(0, 2**32 - 1), st.integers(0, 1000), st.integers(1, 200))
def test_an_order_has_every_trial_once_and_comes_again_when_asked_again(seed, epoch, n):
    order = epoch_order(seed, epoch, n)
    np.testing.assert_array_equal(np.sort(order), np.arange(n))
    epoch_order(seed, epoch + 1, n)
    np.testing.assert_array_equal(epoch_order(seed, epoch, n), order)


def test_orders_differ_between_seeds_and_between_epochs():
    orders = {tuple(epoch_order(seed, epoch, 20)) for seed in range(10) for epoch in range(10)}
    assert len(orders) == 100
    assert tuple(range(20)) not in orders


def test_an_order_is_as_likely_to_begin_with_any_trial():
    counts = np.bincount([epoch_order(seed, epoch, 5)[0] for seed in range(20) for epoch in range(50)], minlength=5)
    assert np.abs(counts - 200).max() < 75


def test_every_seed_begins_with_other_weights():
    seeds = [initial_weights_seed(seed) for seed in range(1000)]
    assert len(set(seeds)) == 1000
    assert all(0 <= seed < 2**63 for seed in seeds)
    assert seeds == [initial_weights_seed(seed) for seed in range(1000)]
