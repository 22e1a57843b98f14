"""Plans of trials: conditions, cues and targets of trials that are written out by hand."""

import numpy as np
import pytest

from bilateral_rl.analysis.trial_plans import plan_of
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.envs import TrialSettings
from bilateral_rl.envs.kinematics import hand_position
from bilateral_rl.envs.tasks import NEVER, HandForces, Task, Timeline, Trials
from bilateral_rl.envs.trial_checks import checked_trials

SETTINGS = TrialSettings(trial_length=20)


class Everything(Task):
    """Five trials: in the field, with a jump in it, in a channel, without a cue, with a pulse."""

    id = "everything"
    n_uniform = 0
    has_timeline = has_forces = True

    def trials(self, uniform, settings):
        n = 5
        gain = np.zeros((n, 2, 2))
        gain[:2] = [[0, 15], [-15, 0]]
        pulse, window = np.zeros((n, 2)), np.full((n, 2), NEVER)
        pulse[4], window[4] = [3, 0], [5, 8]
        walls = np.zeros((n, 2))
        walls[2] = [2000, 50]
        forces = HandForces(gain, np.zeros((n, 2, 2)), np.zeros((n, 2)), pulse, window, walls)
        timeline = Timeline(np.array([0, 4, 4, 30, 0]), np.array([NEVER, 9, NEVER, NEVER, 25]), np.array([1.0, 1.2]))
        return Trials(np.array([0.8, 1.2]), np.array([0.9, 1.3]), np.zeros(2), timeline, forces)


@pytest.fixture
def plan():
    task = Everything()
    trials = checked_trials(task.trials(np.zeros((5, 0)), SETTINGS), 5, task, SETTINGS)
    return plan_of(trials, task.target_indices(np.zeros((5, 0)), SETTINGS), SETTINGS)


def test_a_condition_joins_what_a_trial_has(plan):
    assert list(plan.condition) == ["field", "field+jump", "channel", "no_go", "pulse"]
    assert list(plan.has("field")) == [True, True, False, False, False]
    assert list(plan.has("jump")) == [False, True, False, False, False]


def test_steps_after_the_end_do_not_come(plan):
    assert list(plan.go) == [0, 4, 4, NEVER, 0]
    assert list(plan.jump) == [NEVER, 9, NEVER, NEVER, NEVER]
    assert list(plan.onset) == [0, 9, 4, NEVER, 0]
    assert plan.pulse.tolist() == [[NEVER, NEVER]] * 4 + [[5, 8]]


def test_the_angle_leads_from_the_start_to_the_goal(plan):
    start, goal = (hand_position(np.array(angles), SETTINGS.arm) for angles in ([0.8, 1.2], [0.9, 1.3]))
    np.testing.assert_allclose(plan.goal, np.tile(goal, (5, 1)), atol=1e-7)
    there = start + np.linalg.norm(goal - start) * np.stack([np.cos(plan.target_angle), np.sin(plan.target_angle)], 1)
    np.testing.assert_allclose(there, np.tile(goal, (5, 1)), atol=1e-6)
    assert (plan.target_index == -1).all()


def test_the_papers_trials_have_no_condition_and_their_target_from_the_start():
    for task, apart in (("random_reach", True), ("hold_position", False)):
        plan = Evaluator(task, SETTINGS, 4, seed=0).plan
        assert set(plan.condition) == {"null"}
        assert not plan.onset.any()
        assert np.isfinite(plan.target_angle).all() == apart
