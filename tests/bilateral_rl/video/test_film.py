"""What a film shows."""

import dataclasses

import numpy as np
import pytest
from plain_trials import two_hands
from rich_tasks import no_forces

from bilateral_rl.envs.arm import ArmParameters
from bilateral_rl.envs.tasks import NEVER
from bilateral_rl.video.film import Performance

SIZE = 320
CURL = np.array([[0.0, 15.0], [-15.0, 0.0]])
CAPTION = SIZE // 8
"""Rows of a picture that hold its caption."""
PAUSE = 15
"""Pictures of 0.6 s at 25 a second."""


def test_a_scene_shows_the_arm_after_so_many_steps(make_record):
    rng = np.random.default_rng(0)
    activation = rng.random((2, 8, 6), dtype=np.float32)
    hand = np.float32([0.1, 0.3]) + 0.1 * rng.random((2, 9, 2), dtype=np.float32)
    joint = rng.random((2, 9, 2), dtype=np.float32)
    load = np.float32([[1, 2], [3, -4]])
    take = Performance("cc_s", make_record(2, activation=activation, joint=joint, hand=hand, load=load), 0.03)
    (start,), (later,) = (take.scene(1, step, "t").arms for step in (0, 5))
    assert take.scene(1, 5, "t").threshold == 0.03
    np.testing.assert_array_equal(start.activation, np.full(6, ArmParameters().min_activation))
    np.testing.assert_array_equal(start.path, hand[1, :1])
    np.testing.assert_array_equal(later.activation, activation[1, 4])
    np.testing.assert_array_equal(later.path, hand[1, :6])
    np.testing.assert_array_equal(later.angles, joint[1, 5])
    np.testing.assert_array_equal(later.load, [3, -4])
    assert take.scene(1, 5, "t").caption.splitlines() == ["cc_s", "t", take.goal(1, 5)]


def test_a_reach_is_reached_after_three_steps_in_the_goal_and_stays_so(make_record):
    distance = np.float32([[0.2, 0.04, 0.04, 0.06, 0.03, 0.02, 0.01, 0.3]])
    take = Performance("", make_record(distance=distance), 0.05)
    assert [take.goal(0, step) for step in range(9)] == ["goal not reached yet"] * 7 + ["goal reached"] * 2


def test_a_reach_that_ends_elsewhere_is_not_reached(make_record):
    take = Performance("", make_record(), 0.05)
    assert [take.goal(0, step) for step in (0, 7, 8)] == ["goal not reached yet"] * 2 + ["goal not reached"]


def test_a_hold_counts_its_steps_in_the_goal(make_record):
    distance = np.float32([[0.01, 0.02, 0.06, 0.04, 0.2, 0.2, 0.2, 0.04]])
    take = Performance("", make_record(distance=distance, start_distance=np.zeros(1, np.float32)), 0.05)
    inside = [0, 1, 2, 2, 3, 3, 3, 3, 4]
    assert [take.goal(0, k) for k in range(9)] == [f"in the goal {n} of {k} steps" for k, n in enumerate(inside)]


@pytest.fixture
def make_cued(make_record):
    """Builder of two trials of eight steps: a cue at the third step and a jump at the sixth, and none at all."""

    def make(**arrays):
        record = make_record(2, **arrays)
        start, goal, jumped = np.float32([0.2, 0.4]), np.float32([-0.1, 0.4]), np.float32([0.2, 0.1])
        seen = np.tile(start, (2, 8, 1))
        seen[0, 3:6], seen[0, 6:] = goal, jumped
        distance = np.linalg.norm(record.hand[:, 1:] - seen, axis=2)
        plan = dataclasses.replace(
            record.plan,
            goal=np.tile(goal, (2, 1)),
            go=np.int32([3, NEVER]),
            jump=np.int32([6, NEVER]),
            condition=np.array(["field+jump", "no_go"]),
            forces=no_forces(
                **{name: np.zeros((2, *shape)) for name, shape in (("pulse", (2,)), ("walls", (2,)), ("center", (2,)))},
                velocity_gain=np.tile(CURL, (2, 1, 1)),
                position_gain=np.zeros((2, 2, 2)),
            ),
        )
        return dataclasses.replace(record, seen_target=seen, distance=distance, plan=plan, **arrays)

    return make


def test_a_scene_follows_cue_jump_and_forces(make_cued):
    force = np.arange(32, dtype=np.float32).reshape(2, 8, 2)
    take = Performance("cc_s", make_cued(force=force, load=np.float32([[1, 2], [0, 0]])), 0.05)
    scenes = [take.scene(0, step, "t").arms[0] for step in range(9)]
    assert [scene.cue.phase for scene in scenes] == ["wait"] * 3 + ["go"] * 3 + ["jump"] * 3
    np.testing.assert_array_equal([scene.target for scene in scenes[:8]], take.record.seen_target[0])
    np.testing.assert_array_equal(scenes[8].target, take.record.seen_target[0, -1])
    np.testing.assert_array_equal(scenes[0].forces.force, 0)
    np.testing.assert_array_equal(scenes[4].forces.force, force[0, 3] - (1, 2))
    np.testing.assert_array_equal(scenes[4].forces.velocity_gain, CURL)
    assert take.scene(0, 4, "t").caption.splitlines()[1] == "t, field + jump"
    assert take.scene(1, 4, "t").caption.splitlines()[1] == "t, no cue"


@pytest.mark.parametrize(
    ("other", "words"), [("field", ", no field"), ("jump", ", no jump"), ("field+pulse", ", no field or pulse"),
                         ("channel", ""), ("null", "")],
)  # fmt: skip
def test_a_trial_without_what_others_have_says_so(make_record, other, words):
    record = make_record(2)
    plan = dataclasses.replace(record.plan, condition=np.array(["null", other]))
    take = Performance("cc_s", dataclasses.replace(record, plan=plan), 0.05)
    assert take.scene(0, 3, "t").caption.splitlines()[1] == f"t{words}"


def test_the_goal_is_judged_from_the_cue_and_from_the_jump_on(make_cued):
    take = Performance("", make_cued(), 0.05)
    hold = [f"in the goal {k} of {k} steps" for k in range(3)]
    assert [take.goal(0, k) for k in range(9)] == hold + ["goal not reached yet"] * 5 + ["goal not reached"]
    assert take.goal(1, 8) == "in the goal 8 of 8 steps"
    hand = np.tile(np.float32([0.2, 0.4]), (2, 9, 1))
    hand[0, 4:] = (-0.1, 0.4)
    reached = Performance("", make_cued(hand=hand), 0.05)
    assert [reached.goal(0, k) for k in (5, 6)] == ["goal not reached yet"] * 2  # two steps, and then another target


def test_plain_trials_have_neither_forces_nor_cues(make_record):
    take = Performance("cc_s", make_record(), 0.05)
    scene = take.scene(0, 3, "t")
    (one,) = scene.arms
    assert (one.forces, one.cue, take.has_extras) == (None, None, False)
    assert scene.caption.splitlines()[1] == "t"


def test_a_picture_with_all_colors_shows_what_is_gone_at_the_end(make_cued, make_record, make_film):
    plain, cued = make_film(make_record()), make_film(make_cued())
    np.testing.assert_array_equal(plain.colorful(), plain.picture(0, plain.steps))
    assert cued.colorful().shape[1] > cued.shape[1]


def test_a_film_shows_every_step_of_every_trial_and_pauses_after_each(make_record, make_film):
    rng = np.random.default_rng(0)
    film = make_film(make_record(2, activation=rng.random((2, 8, 6), dtype=np.float32)))
    pictures = list(film)
    assert film.fps == pytest.approx(25)  # a step of 10 ms lasts 40
    assert len(pictures) == len(film) == 2 * (9 + PAUSE)
    for i in range(2):
        trial = pictures[i * 24 : (i + 1) * 24]
        for step in range(9):
            np.testing.assert_array_equal(trial[step], film.picture(i, step))
            assert (trial[step] != trial[step - 1]).any()
        for still in trial[9:]:
            np.testing.assert_array_equal(still, trial[8])


def test_controllers_stand_side_by_side(make_record, make_film):
    for n, rows, columns in ((1, 1, 1), (2, 1, 2), (3, 1, 3), (4, 2, 2), (5, 2, 3), (7, 2, 4)):
        film = make_film(*[make_record()] * n)
        picture = film.picture(0, 3)
        assert film.shape == picture.shape[:2] == (rows * SIZE, columns * SIZE)
        last = picture[(rows - 1) * SIZE :, (n - 1) % columns * SIZE :][:SIZE, :SIZE]
        assert (last[CAPTION:] == picture[CAPTION:SIZE, :SIZE]).all()
        assert (last[:CAPTION] != picture[:CAPTION, :SIZE]).any() == (n > 1)  # another name


@pytest.fixture(scope="module")
def of_two():
    """Two trials of two hands in the dominant one's first of which a spring pulls."""
    record = two_hands()
    force = np.zeros((4, 11, 2), np.float32)
    force[0, :, 0], force[1, :, 0] = -np.arange(11), -np.arange(11)  # toward the midline, in either arm's own frame
    return dataclasses.replace(record, spring_force=force)


def test_a_scene_of_two_arms_shows_both_what_they_do_and_the_spring(of_two):
    take = Performance("cc_s", of_two, 0.05)
    scene = take.scene(0, 4, "t")
    assert [one.role for one in scene.arms] == ["reach", "hold"]
    assert [one.words for one in scene.arms] == ["goal not reached yet", "in the goal 4 of 4 steps"]
    assert scene.caption.splitlines() == ["cc_s", "t"]
    for row, one in enumerate(scene.arms):
        np.testing.assert_array_equal(one.path, of_two.hand[row, :5])
        np.testing.assert_array_equal(one.target, of_two.target[row])
    assert scene.shoulder_distance == 0.36
    np.testing.assert_array_equal(scene.spring.force, (-4, 0))
    assert scene.spring.start_length == pytest.approx(0.36)
    assert [one.role for one in take.scene(1, 0, "t").arms] == ["hold", "reach"]
    assert take.scene(1, 0, "t").spring is None


def test_a_film_of_two_arms_is_as_broad_as_its_pictures(of_two, make_film):
    film = make_film(of_two, of_two)
    assert (film.trials, film.steps) == (2, 10)
    assert film.picture(1, 10).shape == (*film.shape, 3)
    assert film.shape[1] > 2 * SIZE
