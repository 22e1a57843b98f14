"""What the trials of an experiment of two arms are drawn from, in the frame of the body."""

import numpy as np
import pytest

from bilateral_rl.envs import ArmParameters, ArmVecEnv, Experiment, ExperimentTask, TrialSettings, hand_position
from bilateral_rl.envs.body_frame import in_body_frame
from bilateral_rl.envs.experiments.standing import standing_arms
from bilateral_rl.envs.task import NEVER
from bilateral_rl.envs.trial_checks import checked_trials

MANY = 20_000
RIGHT = {"start": {"hand": [0.1, 0.4]}, "target": {"center_out": {"number": 4, "radius": 0.1}}}
LEFT = {"start": {"hand": [[-0.1, 0.4], [-0.15, 0.3]]}, "target": "start"}


def experiment(right=RIGHT, left=LEFT, **values):
    return Experiment(name="mine", arms={"dominant": right, "non_dominant": left}, **values)


def draw(of, n=MANY, **settings):
    task, settings = ExperimentTask(of), TrialSettings(**settings)
    uniform = np.random.default_rng(0).random((n, task.n_uniform))
    return task.trials(uniform, settings), task.target_indices(uniform, settings)


def in_body(postures, distance=0.36):
    return in_body_frame(hand_position(postures, ArmParameters()), distance)


def rows(of):
    return {tuple(row) for row in np.round(of.reshape(-1, of.shape[-1]), 4).tolist()}


def leaves(of):
    """The arrays of trials, in their order."""
    return [of] if isinstance(of, np.ndarray) else [array for part in of or () for array in leaves(part)]


def mirrored(vectors):
    return vectors * [-1, 1]


def test_an_arm_stands_where_the_frame_of_the_body_has_it():
    postures = np.random.default_rng(0).uniform([0, 0.2], [1.5, 2.0], (5, 2, 2))
    right, left = standing_arms(2, TrialSettings(two_arms={"shoulder_distance": 0.4}))
    hands = np.stack([right.hand_position(postures[:, 0]), left.hand_position(postures[:, 1])], axis=1)
    np.testing.assert_allclose(hands, in_body(postures, 0.4), atol=1e-15)
    np.testing.assert_allclose(left.postures(hands[:, 1], "positive"), postures[:, 1], atol=1e-12)


def test_places_and_forces_of_each_arm_are_as_the_file_has_them_in_the_frame_of_the_body():
    pull = {"load": [-1, 2], "curl": 10, "elastic_field": {"stiffness": 20, "center": "start"}}
    of = experiment(left=LEFT | {"forces": pull}, trial={"two_arms": {"spring": {"stiffness": 50, "damping": 2}}})
    trials, index = draw(of, 200, **of.trial)
    task = ExperimentTask(of)
    assert (task.n_arms, task.has_timeline, task.has_forces, task.has_load) == (2, False, True, False)
    assert trials.timeline is None
    start, goal = in_body(trials.start), in_body(trials.goal)
    assert rows(start[:, 0]) == {(0.1, 0.4)}
    assert rows(start[:, 1]) == {(-0.1, 0.4), (-0.15, 0.3)}
    assert rows(goal[:, 0]) == {(0.2, 0.4), (0.1, 0.5), (0.0, 0.4), (0.1, 0.3)}
    np.testing.assert_array_equal(goal[:, 1], start[:, 1])
    np.testing.assert_allclose(
        goal[:, 0] - start[:, 0], 0.1 * np.stack([np.cos(np.pi / 2 * index[:, 0]), np.sin(np.pi / 2 * index[:, 0])], 1),
        atol=1e-6,
    )  # fmt: skip
    assert (index[:, 1] == -1).all()
    assert (trials.load == [[0, 0], [-1, 2]]).all()
    assert (trials.forces.velocity_gain == [np.zeros((2, 2)), [[0, 10], [-10, 0]]]).all()
    np.testing.assert_allclose(trials.forces.center[:, 1], start[:, 1], atol=1e-6)
    assert (trials.spring.stiffness == 50).all()
    assert (trials.spring.damping == 2).all()


def test_arms_that_exchange_what_they_do_do_it_mirrored():
    pull = {"load": [-1, 2], "curl": 10, "pulse": {"force": [3, 1], "at": 5, "steps": 5}}
    elastic = {"elastic_field": {"stiffness": [[20, 5], [0, 10]], "center": [-0.1, 0.35]}}
    parts = {"right": RIGHT | {"forces": pull}, "left": LEFT | {"forces": elastic}}
    kept, index = draw(experiment(**parts), 400)
    swapped, swapped_index = draw(experiment(**parts, exchange=1.0), 400)
    for name in ("start", "goal"):
        np.testing.assert_array_equal(getattr(swapped, name), getattr(kept, name)[:, ::-1])
        there, here = (in_body(getattr(trials, name)) for trials in (swapped, kept))
        np.testing.assert_allclose(there, mirrored(here)[:, ::-1], atol=1e-12)
    np.testing.assert_array_equal(swapped_index, index[:, ::-1])
    np.testing.assert_array_equal(swapped.load, mirrored(kept.load)[:, ::-1])
    for name in ("center", "pulse"):
        np.testing.assert_array_equal(getattr(swapped.forces, name), mirrored(getattr(kept.forces, name))[:, ::-1])
    # A curl field turns the other way: the force on the mirrored velocity is the mirrored force.
    velocity = np.array([0.3, -0.2])
    for name in ("velocity_gain", "position_gain"):
        there, here = (getattr(trials.forces, name)[0].astype(float) for trials in (swapped, kept))
        np.testing.assert_allclose(there @ mirrored(velocity), mirrored(here @ velocity)[::-1], atol=1e-6)
    # In the arms' own frames, the rows of both arms have changed places.
    rows_kept, rows_swapped = (
        checked_trials(trials, 400, ExperimentTask(experiment(**parts)), TrialSettings()) for trials in (kept, swapped)
    )
    for mine, others in zip(*(leaves(rows._replace(spring=None)) for rows in (rows_kept, rows_swapped)), strict=True):
        np.testing.assert_allclose(others.reshape(400, 2, -1)[:, ::-1], mine.reshape(400, 2, -1), atol=1e-7)
    some, _ = draw(experiment(**parts, exchange=0.25))
    assert (some.load[:, 1].any(axis=1)).mean() == pytest.approx(0.25, abs=0.02)


def test_each_arm_draws_its_own_places_unless_they_are_paired_and_cues_are_common():
    right = {"start": {"hand": [0.1, 0.4]}, "target": {"center_out": {}}}
    left = {"start": {"hand": [-0.1, 0.4]}, "target": {"center_out": {}}}
    cue = {"timeline": {"go": [3, 9], "no_go_share": 0.2}}
    field = {"forces": {"curl": 10, "field_off_share": 0.3}}
    apart, index = draw(experiment(right | cue | field, left | cue | field))
    assert (index[:, 0] + 8 == index[:, 1]).mean() == pytest.approx(1 / 8, abs=0.02)
    assert (apart.timeline.go[:, 0] == apart.timeline.go[:, 1]).all()
    field_on = apart.forces.velocity_gain.any(axis=(2, 3))
    assert (field_on[:, 0] == field_on[:, 1]).all()
    assert field_on.mean() == pytest.approx(0.7, abs=0.02)
    paired, index = draw(experiment(right, left, paired=True), 200)
    assert (index[:, 0] + 8 == index[:, 1]).all(), "lists are numbered through"
    way = in_body(paired.goal) - in_body(paired.start)
    np.testing.assert_allclose(way[:, 0], way[:, 1], atol=1e-6)  # parallel
    one_cue, _ = draw(experiment(right | cue, left), 200)
    assert (one_cue.timeline.go[:, 1] == 0).all()
    assert set(one_cue.timeline.go[:, 0].tolist()) == {*range(3, 10), NEVER}
    np.testing.assert_array_equal(one_cue.start, draw(experiment(right, left), 200)[0].start)


def test_a_condition_holds_for_each_hand_that_goes_somewhere():
    forces = {"forces": {"curl": 10, "field_off_share": 0.3}}
    of = experiment(RIGHT | forces, LEFT | forces)
    for condition, (field, walls) in {
        "field": ([True, True], [False, False]),
        "null": ([False, False], [False, False]),
        "channel": ([False, False], [True, False]),  # the hand that stays has no way along which walls could lead
    }.items():
        trials, _ = draw(of.with_condition(condition), 20)
        assert (trials.forces.velocity_gain.any(axis=(2, 3)) == field).all()
        assert (trials.forces.walls.any(axis=2) == walls).all()
    assert ExperimentTask(of).mixes == ("field", "null")
    assert ExperimentTask(of).features == {"field"}
    stay = LEFT | {"start": {"hand": [0.1, 0.4]}}
    with pytest.raises(ValueError, match="channel needs a target"):
        experiment(stay, LEFT).with_condition("channel")
    assert experiment(stay, LEFT).measure == "time_in_goal"


def test_arms_that_exchange_what_they_do_move_as_the_other_would():
    pull = {"load": [-1, 2], "curl": 10, "elastic_field": {"stiffness": 30, "center": [0.2, 0.35]}}
    of = {"right": RIGHT | {"forces": pull}, "left": LEFT}
    spring = {"spring": {"stiffness": 50, "damping": 2}}
    kept, swapped = (ArmVecEnv(4, experiment(**of, exchange=share), seed=0, two_arms=spring) for share in (0.0, 1.0))
    commands = np.random.default_rng(0).uniform(-1, 1, (12, 4, 2, 6)).astype(np.float32)
    for env, order in ((kept, slice(None)), (swapped, slice(None, None, -1))):
        env.reset()
        for command in commands[:, :, order]:
            env.step(command.reshape(4, 12))
    there, here = (env.batch.hand.reshape(4, 2, 2) for env in (swapped, kept))
    np.testing.assert_allclose(there, here[:, ::-1], atol=1e-6)
    assert np.linalg.norm(kept.batch.force, axis=-1).min() > 0.5
