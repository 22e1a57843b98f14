"""What the trials of an experiment are drawn from, and that each part is drawn by itself."""

import dataclasses
import pickle

import gymnasium
import numpy as np
import pytest

from bilateral_rl.envs import (
    ArmEnv,
    ArmParameters,
    ArmVecEnv,
    Experiment,
    ExperimentTask,
    TrialSettings,
    experiment_from_file,
    experiment_named,
    hand_position,
)
from bilateral_rl.envs.tasks import NEVER

ARM = ArmParameters()
HOME = {"hand": [0.0, 0.4]}
AROUND = {"center_out": {"number": 4, "radius": 0.1, "first_angle": 45}}
MANY = 20_000


def experiment(start=None, target=None, **values):
    return Experiment(name="mine", start=start or HOME, target=target or AROUND, **values)


def draw(of, n=MANY, **settings):
    task = ExperimentTask(of)
    return task.trials(np.random.default_rng(0).random((n, task.n_uniform)), TrialSettings(**settings))


def share(of):
    return pytest.approx(float(np.mean(of)), abs=0.02)


@pytest.mark.parametrize(
    ("place", "low", "high"),
    [
        ({"joints": "uniform"}, ARM.joint_lower_limit, ARM.joint_upper_limit),
        ({"joints": {"low": [0.5, 1.0], "high": [1.0, 1.2]}}, [0.5, 1.0], [1.0, 1.2]),
    ],
)
def test_postures_are_uniform_in_a_box(place, low, high):
    start = draw(experiment(place, "start")).start
    np.testing.assert_allclose(start.min(axis=0), low, atol=0.01)
    np.testing.assert_allclose(start.max(axis=0), high, atol=0.01)
    np.testing.assert_allclose(start.mean(axis=0), np.mean([low, high], axis=0), atol=0.02)


def test_hands_are_uniform_in_a_box_and_over_a_disk():
    boxed = hand_position(draw(experiment(target={"hand": {"low": [-0.1, 0.3], "high": [0.1, 0.5]}})).goal, ARM)
    np.testing.assert_allclose([boxed.mean(axis=0), boxed.std(axis=0)], [[0, 0.4], [0.2 / 12**0.5] * 2], atol=0.002)
    disk = hand_position(draw(experiment(target={"hand": {"center": [0, 0.4], "radius": 0.1}})).goal, ARM)
    radius = np.linalg.norm(disk - [0, 0.4], axis=1)
    assert radius.max() <= 0.1 + 1e-6
    assert (radius < 0.05).mean() == pytest.approx(0.25, abs=0.02)  # a quarter of its area


@pytest.mark.parametrize(
    ("place", "positions"),
    [
        ({"hand": [0.1, 0.4]}, [[0.1, 0.4]]),
        ({"hand": [[0.1, 0.4], [-0.1, 0.3]]}, [[0.1, 0.4], [-0.1, 0.3]]),
        ({"hand": {"low": [0, 0.3], "high": [0.1, 0.4], "grid": [2, 1]}}, [[0, 0.35], [0.1, 0.35]]),
        ({"center_out": {"number": 2, "radius": 0.1}}, [[0.1, 0.4], [-0.1, 0.4]]),
        ({"center_out": {"number": 2, "radius": 0.1, "center": [0, 0.3], "first_angle": 90}}, [[0, 0.4], [0, 0.2]]),
        ({"joints": [[0.5, 1.0]]}, [hand_position([0.5, 1.0], ARM)]),
    ],
)
def test_each_of_the_listed_places_is_drawn_as_often(place, positions):
    of = experiment(target=place)
    uniform = np.random.default_rng(0).random((MANY, ExperimentTask(of).n_uniform))
    hands = hand_position(ExperimentTask(of).trials(uniform, TrialSettings()).goal, ARM)
    indices = ExperimentTask(of).target_indices(uniform, TrialSettings())
    for i, position in enumerate(positions):
        np.testing.assert_allclose(hands[indices == i], np.broadcast_to(position, (sum(indices == i), 2)), atol=1e-6)
        assert (indices == i).mean() == pytest.approx(1 / len(positions), abs=0.02)


def test_an_elbow_may_bend_the_other_way():
    arm = ArmParameters(joint_lower_limit=(-1.0, -2.5), joint_upper_limit=(3.0, 2.5))
    trials = draw(experiment({"hand": [0.0, 0.4], "elbow": "negative"}, "start"), 3, arm=arm)
    assert (trials.start[:, 1] < 0).all()
    np.testing.assert_allclose(hand_position(trials.start, arm), [[0.0, 0.4]] * 3, atol=1e-6)


def test_cues_come_at_uniform_steps_and_in_some_trials_never():
    timeline = draw(experiment(timeline={"go": [5, 8], "no_go_share": 0.25}), trial_length=20).timeline
    comes = timeline.go < NEVER
    assert comes.mean() == pytest.approx(0.75, abs=0.02)
    assert [share(timeline.go[comes] == step) for step in (5, 6, 7, 8)] == [0.25] * 4
    assert (timeline.jump == NEVER).all()


def test_targets_jump_by_an_offset_or_to_a_place_a_while_after_the_cue():
    cues = {"go": [5, 8], "no_go_share": 0.2, "jump": {"at": [2, 3], "offset": [[0.02, 0], [0, 0.03]], "share": 0.5}}
    trials = draw(experiment(timeline=cues))
    line, jumps = trials.timeline, trials.timeline.jump < NEVER
    assert jumps.mean() == pytest.approx(0.4, abs=0.02)  # half of those with a cue
    assert set((line.jump - line.go)[jumps].tolist()) == {2, 3}
    offset = hand_position(line.jump_goal, ARM) - hand_position(trials.goal, ARM)
    assert {tuple(row) for row in np.round(offset, 4).tolist()} == {(0.02, 0.0), (0.0, 0.03)}
    cues["jump"] = {"at": 2, "target": {"hand": [0.1, 0.3]}}
    place = draw(experiment(timeline=cues), 5).timeline.jump_goal
    np.testing.assert_allclose(hand_position(place, ARM), [[0.1, 0.3]] * 5, atol=1e-6)


def test_loads_are_listed_or_drawn_as_the_settings_say():
    listed = draw(experiment(forces={"load": [[1, 2], [-3, 0]]})).load
    assert {tuple(row) for row in listed.tolist()} == {(1, 2), (-3, 0)}
    drawn = draw(experiment(forces={"load": "drawn"}), max_load=4.0).load
    np.testing.assert_allclose(abs(drawn).max(axis=0), [4, 4], atol=0.01)
    assert (draw(experiment(), 3).load == 0).all()
    assert ExperimentTask(experiment(forces={"load": "drawn"})).has_load
    assert not ExperimentTask(experiment(forces={"load": [1, 2]})).has_load


FIELDS = {"curl": 10, "elastic_field": {"stiffness": 20, "center": "target"}}


def test_a_trial_has_the_field_or_none_or_a_channel_by_their_shares():
    forces = {**FIELDS, "channel": {"stiffness": 500, "damping": 30, "share": 0.2}, "field_off_share": 0.3}
    trials = draw(experiment(forces=forces))
    field = trials.forces.velocity_gain.any(axis=(1, 2))
    assert (field == trials.forces.position_gain.any(axis=(1, 2))).all()
    channel = trials.forces.walls.any(axis=1)
    assert not (field & channel).any()
    assert (field.mean(), channel.mean()) == pytest.approx((0.5, 0.2), abs=0.02)
    assert (trials.forces.velocity_gain[field] == [[0, 10], [-10, 0]]).all()
    assert (trials.forces.position_gain[field] == [[20, 0], [0, 20]]).all()
    assert (trials.forces.walls[channel] == [500, 30]).all()
    np.testing.assert_allclose(trials.forces.center, hand_position(trials.goal, ARM), atol=1e-6)


def test_pulses_come_in_a_window_after_the_cue_and_not_without_one():
    forces = {"pulse": {"force": {"size": 3, "directions": 4}, "at": [2, 4], "steps": 5, "share": 0.5}}
    trials = draw(experiment(forces=forces, timeline={"go": 7, "no_go_share": 0.5}))
    pulse, window = trials.forces.pulse, trials.forces.pulse_window
    comes = pulse.any(axis=1)
    assert comes.mean() == pytest.approx(0.25, abs=0.02)
    assert (trials.timeline.go[comes] == 7).all()
    assert set(window[comes, 0].tolist()) == {9, 10, 11}
    assert (window[comes, 1] - window[comes, 0] == 5).all()
    assert (window[~comes] == NEVER).all()
    np.testing.assert_allclose(np.linalg.norm(pulse[comes], axis=1), 3, rtol=1e-6)
    assert len({tuple(row) for row in np.round(pulse[comes], 3).tolist()}) == 4


def test_a_condition_holds_in_all_trials_which_are_otherwise_the_same():
    forces = {**FIELDS, "channel": {"share": 0.2}, "field_off_share": 0.3, "load": [[1, 0], [0, 1]]}
    of = experiment(forces=forces, timeline={"go": [3, 9]})
    mixed = draw(of, 50)
    for condition, (field, walls) in {"field": (True, False), "null": (False, False), "channel": (False, True)}.items():
        trials = draw(of.with_condition(condition), 50)
        assert (trials.forces.velocity_gain.any(axis=(1, 2)) == field).all()
        assert (trials.forces.walls.any(axis=1) == walls).all()
        for name in ("start", "goal", "load"):
            assert (getattr(trials, name) == getattr(mixed, name)).all()
        assert (trials.timeline.go == mixed.timeline.go).all()
    assert draw(experiment().with_condition("channel"), 2).forces.walls.all(), "of an experiment without forces, too"
    with pytest.raises(ValueError, match="unknown condition 'fields'"):
        of.with_condition("fields")
    with pytest.raises(ValueError, match="channel needs a target"):
        experiment(target="start").with_condition("channel")


def test_experiments_that_differ_in_one_part_have_the_same_trials_but_for_it():
    plain, rich = experiment(), experiment(timeline={"go": [3, 9]}, forces={"curl": 5, "load": [[1, 0], [0, 2]]})
    assert (draw(plain, 20).goal == draw(rich, 20).goal).all()


def test_an_arms_trials_do_not_depend_on_how_many_arms_there_are():
    of = experiment(forces=FIELDS | {"field_off_share": 0.5}, timeline={"go": [3, 9]}, trial={"trial_length": 12})
    few, many = ArmVecEnv(2, of, seed=3), ArmVecEnv(5, of, seed=3)
    action = np.random.default_rng(0).uniform(-1, 1, (30, 6)).astype(np.float32)
    few.reset(), many.reset()
    for row in action:
        one, two = few.step(np.tile(row, (2, 1))), many.step(np.tile(row, (5, 1)))
        assert (one[0] == two[0][:2]).all()
        assert (one[1] == two[1][:2]).all()


def test_settings_of_trials_are_the_experiments_unless_others_are_given(tmp_path):
    of = experiment(trial={"trial_length": 30, "threshold": 0.02, "losses": {"dominant": {"hand_speed": 0.5}}})
    env = ArmEnv(of, threshold=0.04, losses={"last_steps": 5})
    assert (env.settings.trial_length, env.settings.threshold) == (30, 0.04)
    assert (env.settings.losses.dominant.hand_speed, env.settings.losses.last_steps) == (0.5, 5)
    with pytest.raises(ValueError, match=r"timeline\.go must come within the trial of 10 steps"):
        ArmEnv(experiment(timeline={"go": 20}), trial_length=10)


def test_any_experiment_is_an_environment_of_gymnasiums(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("start: {hand: [0.0, 0.4]}\ntarget: {center_out: {number: 3}}\ntrial: {trial_length: 7}\n")
    for task in (str(path), path, experiment_from_file(path), "curl_field", "centre_out"):
        env = gymnasium.make("bilateral_rl/Experiment-v0", task=task)
        observation, _ = env.reset(seed=1)
        np.testing.assert_allclose(observation[12:14], [0.0, 0.4], atol=1e-6)
        batch = gymnasium.make_vec("bilateral_rl/Experiment-v0", num_envs=2, task=task)
        assert (batch.reset(seed=1)[0][0] == observation).all()
        batch.close()
    assert env.unwrapped.batch.task.experiment == experiment_named("center_out")
    with pytest.raises(ValueError, match=r"Unknown task ''; choose from .*, or give the \.yaml file of an experiment"):
        gymnasium.make("bilateral_rl/Experiment-v0")


def test_a_task_of_an_experiment_survives_pickling_and_says_what_its_trials_have():
    task = ExperimentTask(experiment_named("curl_field"))
    copy = pickle.loads(pickle.dumps(task))
    uniform = np.random.default_rng(0).random((4, task.n_uniform))
    assert (copy.trials(uniform, TrialSettings()).goal == task.trials(uniform, TrialSettings()).goal).all()
    assert task.features == {"field"}
    assert (task.id, task.judged_by) == ("curl_field", "goal_completion")
    assert ExperimentTask(experiment(target="start")).judged_by == "time_in_goal"
    assert ExperimentTask(dataclasses.replace(experiment(), judged_by="time_in_goal")).judged_by == "time_in_goal"
    with pytest.raises(TypeError, match="experiment must be an Experiment, got str"):
        ExperimentTask("curl_field")
