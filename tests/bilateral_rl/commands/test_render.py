"""`bilateral-rl render` on small runs."""

import numpy as np
import pytest

from bilateral_rl.analysis.conditions import conditions
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.io.errors import UserError
from bilateral_rl.training.run import train
from bilateral_rl.video.cast import Actor, labels
from bilateral_rl.video.film import Film

SIZE = 320
CAPTION = SIZE // 8
"""Rows of a picture that hold its caption."""
TWO_TASKS = ("random_reach", "hold_position")
MANY = ("max_isometric_force", "tendon_length")
STEPS, PAUSE = 20, 15
"""Of the small supervised runs; and the pictures of a pause of 0.6 s at 25 a second."""


def test_an_mp4_plays_anywhere_and_shows_what_was_drawn(show, bptt_run, apart):
    """Of the trials that ``evaluate --seed 7`` tests."""
    video = show(f"{bptt_run.path}:1", trials=2)
    assert video.meta["codec"] == "h264"
    assert video.meta["pix_fmt"].startswith("yuv420p(tv, bt709")
    assert video.meta["fps"] == 25
    assert video.pictures.shape == (2 * (STEPS + 1 + PAUSE), SIZE, SIZE, 3)
    actor = Actor.load(f"{bptt_run.path}:1", "final")
    evaluator = Evaluator("random_reach", actor.config.trial, 2, seed=7)
    film = Film(
        [actor.perform(evaluator, "intact", 0.05, *labels([actor], "intact", conditions(actor.config)))], 4, SIZE, 2
    )
    for shown, drawn in zip(video.pictures, film, strict=True):
        assert apart(shown, drawn) < 0.001
        assert np.abs(shown.astype(int) - drawn).mean() < 1.5


@pytest.mark.parametrize(("slow_down", "fps"), [(2, 50), (20, 5)])
def test_slowing_down_lengthens_every_step(show, unilateral, slow_down, fps):
    video = show(unilateral, slow_down=slow_down)
    assert video.meta["fps"] == pytest.approx(fps)
    assert len(video.pictures) == STEPS + 1 + round(0.6 * fps)


def test_side_by_side_they_do_the_same_trial(show, bptt_run, unilateral, tmp_path, apart):
    runs = [f"{bptt_run.path}:2", unilateral]
    both = show(*runs)
    halves = both.pictures[:, :, :SIZE], both.pictures[:, :, SIZE:]
    for i, (run, half) in enumerate(zip(runs, halves, strict=True)):
        alone = show(run, out=tmp_path / f"{i}.mp4").pictures
        assert len(half) == len(alone)
        assert max(apart(a, b) for a, b in zip(half, alone, strict=True)) < 0.002
    first, second = (half[:, CAPTION:] for half in halves)
    assert apart(first[0], second[0]) < 0.001  # the same posture and target, muscles at rest
    assert apart(first[STEPS], second[STEPS]) > 0.002


def test_a_lesion_changes_what_the_arm_does_and_the_caption(show, bptt_run, tmp_path, apart):
    run = f"{bptt_run.path}:0"
    intact, lesioned = show(run), show(run, lesion="deep_dominant", out=tmp_path / "lesion.mp4")
    assert apart(intact.pictures[0, CAPTION:], lesioned.pictures[0, CAPTION:]) < 0.001
    assert apart(intact.pictures[0, :CAPTION], lesioned.pictures[0, :CAPTION]) > 0.005
    assert apart(intact.pictures[STEPS, CAPTION:], lesioned.pictures[STEPS, CAPTION:]) > 0.002


def test_the_default_name_is_beside_the_folder_which_stays_as_it_is(show, bptt_run, tree):
    before = tree(bptt_run.path)
    parent = bptt_run.path.parent
    assert show(bptt_run.path, out=None).path == parent / "cc_s-bptt-1.mp4"
    assert tree(bptt_run.path) == before
    assert [path.name for path in tree(parent) if path.parent == parent] == ["cc_s-bptt-1.mp4"]


def test_the_default_name_says_what_is_unusual(show, filmed, bptt_run, run):
    unusual = show(f"{bptt_run.path}:2", out=None, lesion="callosum", weights="best").path
    assert unusual == bptt_run.path.parent / "cc_s-bptt-1-seed-2-best-callosum.mp4"
    assert show(bptt_run.path, run.path, out=None).path == bptt_run.path.parent / "cc_s-bptt-1+cc_s-ppo-1.mp4"


def test_a_run_named_by_a_dot_has_its_folders_name(show, filmed, bptt_run, monkeypatch):
    monkeypatch.chdir(bptt_run.path)
    assert show(".", out=None).path == bptt_run.path.parent / "cc_s-bptt-1.mp4"


def test_several_seeds_and_none_named_is_said(show, filmed, bptt_run):
    said = show(bptt_run.path).said
    assert f"this shows the first: {bptt_run.path}:0." in said
    assert "video.mp4" in said
    assert "Note" not in show(f"{bptt_run.path}:1").said


def test_other_settings_are_said_and_the_first_runs_count(show, filmed, bptt_run, run):
    said = show(bptt_run.path, run.path).said
    assert f"{run.path} learned with another trial_length; all do the first run's trials." in said
    assert [take.record.distance.shape for take in filmed[0].performances] == [(1, STEPS)] * 2


def test_films_the_trials_that_evaluate_tests_with_another_task_or_other_settings(show, filmed, bptt_run):
    """And says so in the file's name."""
    films = [
        show(bptt_run.path, out=None, overrides=["trial.sensory_noise=0.1"]),
        show(bptt_run.path, out=None, task="curl_field"),
    ]
    assert [film.path.name for film in films] == [
        "cc_s-bptt-1-sensory_noise=0.1.mp4",
        "cc_s-bptt-1-curl_field-trial_length=20.mp4",
    ]
    actor = Actor.load(str(bptt_run.path), "final")
    noisy = conditions(actor.config, None, {"trial": {"sensory_noise": 0.1}})
    for film, under in zip(filmed, (noisy, conditions(actor.config, "curl_field")), strict=True):
        expected = Evaluator(under.config.make_task(), under.settings, 1, seed=7).run(actor.policy)
        np.testing.assert_array_equal(film.performances[0].record.hand, expected.hand)
        np.testing.assert_array_equal(film.performances[0].record.observation, expected.observation)


def test_different_films_have_different_names(show, filmed, small_bptt, tmp_path):
    runs = [train(small_bptt(task=task, seeds=1, epochs=1), tmp_path).folder.path for task in TWO_TASKS]
    reach, hold = TWO_TASKS
    assert show(*runs, task=reach, out=None).path.name == f"{reach}-cc_s-bptt-1+{hold}-cc_s-bptt-1-{reach}.mp4"
    assert (
        show(*runs, task=hold, out=None).path.name
        == f"{reach}-cc_s-bptt-1+{hold}-cc_s-bptt-1-{hold}-trial_length=20.mp4"
    )
    labels_of_both = [take.label for take in filmed[0].performances]
    assert labels_of_both == [f"cc_s · bptt · seed 0 ({task}/cc_s-bptt-1)\n{reach}" for task in TWO_TASKS]
    long = [[f"trial.arm.{name}=[{value}, 300, 800, 1000, 800, 800]" for name in MANY] for value in (700, 701)]
    names = {show(runs[0], overrides=overrides, out=None).path.name for overrides in long}
    assert len(names) == 2
    assert max(map(len, names)) < 120


def test_a_films_comment_is_the_command(show, bptt_run):
    options = {"task": "curl_field", "overrides": ["experiment.forces.curl=9"], "lesion": "callosum"}
    comment = show(f"{bptt_run.path}:1", **options).path.read_bytes()
    words = f"render {bptt_run.path}:1 --trials 1 --seed 7 --lesion callosum --weights final --slow-down 4 --size 320"
    assert f"{words} --task curl_field --set experiment.forces.curl=9".encode() in comment


def test_runs_of_different_tasks_do_a_third_one_side_by_side(show, filmed, bptt_run, small_bptt, tmp_path):
    hold = train(small_bptt(task="hold_position", seeds=1, epochs=1), tmp_path).folder
    show(bptt_run.path, hold.path, task="center_out")
    first, second = (take.record.target for take in filmed[0].performances)
    np.testing.assert_array_equal(first, second)
    with pytest.raises(UserError, match=r"choose runs of one task, or give --task\."):
        show(bptt_run.path, hold.path)


def test_refuses_options_that_mean_nothing(show, bptt_run, tmp_path, tree):
    before = tree(tmp_path)
    for options, message in (
        ({"lesion": "left"}, "Unknown lesion 'left'; choose from intact, shallow_dominant"),
        ({"trials": 0}, "--trials must be at least 1"),
        ({"seed": -1}, "--seed must be at least 0"),
        ({"size": 401}, "even number of at least 320 pixels, got 401"),
        ({"size": 100}, "even number of at least 320 pixels, got 100"),
        ({"slow_down": 1}, "from 2 to 20, .* got 1"),
        ({"slow_down": 21}, "from 2 to 20, .* got 21"),
        ({"weights": "step_1"}, "does not exist"),
        ({"overrides": ["ppo.gamma=0.9"]}, "ppo.gamma changes nothing in a test"),
        ({"overrides": ["trial.losses.dominant.effort=1"]}, "changes nothing in a film, which shows no rewards"),
        ({"task": "two_reaches"}, "learned to move one arm, and two_reaches is a task of two arms"),
    ):
        with pytest.raises(UserError, match=message):
            show(bptt_run.path, **options)
        assert tree(tmp_path) == before
    with pytest.raises(UserError, match="at least one run"):
        show()


def test_refuses_what_cannot_be_written(show, bptt_run, tmp_path, tree):
    (tmp_path / "file").write_text("a file")
    (tmp_path / "folder.mp4").mkdir()
    before = tree(tmp_path)
    for name in ("video.avi", "video", "no/such/folder/video.mp4", "file/video.gif", "folder.mp4"):
        with pytest.raises(UserError, match=r"choose another --out"):
            show(bptt_run.path, out=tmp_path / name)
        assert tree(tmp_path) == before


def test_refuses_a_lesion_that_one_of_the_networks_cannot_have(show, bptt_run, unilateral, tmp_path):
    with pytest.raises(
        UserError, match="uni_b-bptt-1 is unilateral and cannot have the lesion callosum; choose from intact"
    ):
        show(bptt_run.path, unilateral, lesion="callosum")
    assert not list(tmp_path.glob("*.mp4"))
