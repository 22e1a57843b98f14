import numpy as np
import pytest

from bilateral_rl.analysis.trial_records import summaries
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.envs import ArmEnv, TrialSettings
from bilateral_rl.runs.policies import build_policy


@pytest.fixture
def policy(small):
    return build_policy(small)


def test_an_evaluation_repeats_itself(policy):
    evaluator = Evaluator("random_reach", TrialSettings(), 16, seed=3)
    first, second = evaluator.run(policy), evaluator.run(policy)
    assert first.plan is second.plan
    for a, b in zip(vars(first).values(), vars(second).values(), strict=True):
        np.testing.assert_array_equal(a, b)


def test_trial_i_is_the_first_trial_of_an_environment_with_seed_plus_i(policy):
    record = Evaluator("hold_position", TrialSettings(), 4, seed=10).run(policy)
    for i in range(4):
        env = ArmEnv("hold_position")
        observation, _ = env.reset(seed=10 + i)
        info: dict = {}
        for step in range(50):
            np.testing.assert_allclose(record.hand[i, step], observation[12:14], atol=1e-6)
            action, _ = policy.predict(observation, deterministic=True)
            observation, _, _, _, info = env.step(action)
            assert info["distance"] == pytest.approx(record.distance[i, step], abs=1e-5)
        assert info["vector_return"] == pytest.approx(record.vector_return[i], rel=1e-4)


def test_the_joints_put_the_hand_where_it_is(policy):
    record = Evaluator("random_reach", TrialSettings(), 4, seed=0).run(policy)
    upper, fore = record.arm.link_length
    shoulder, elbow = np.moveaxis(record.joint.astype(float), -1, 0)
    x = upper * np.cos(shoulder) + fore * np.cos(shoulder + elbow)
    y = upper * np.sin(shoulder) + fore * np.sin(shoulder + elbow)
    assert np.ptp(shoulder, axis=1).min() > 0.01
    np.testing.assert_allclose(record.hand, np.stack((x, y), axis=-1), atol=1e-6)


def test_a_summary_is_in_percent_centimeters_and_steps(policy):
    record = Evaluator("random_reach", TrialSettings(), 2, seed=0).run(policy)
    distance = np.full((2, 50), 0.3, dtype=np.float32)
    distance[0, 9:] = 0.01  # within the goal from step 10 on
    record = type(record)(**{**vars(record), "distance": distance, "start_distance": np.array([0.5, 0.5])})
    summary = record.summary(0.05)
    assert summary["goal_completion_percent"] == 50
    assert summary["speed_to_goal_cm_per_step"] == pytest.approx(5)
    assert summary["time_in_goal_steps"] == pytest.approx(41 / 2)
    assert summary["final_error_cm"] == pytest.approx(15.5, rel=1e-5)


def test_the_table_has_a_row_a_trial_and_agrees_with_the_summary(policy):
    record = Evaluator("random_reach", TrialSettings(), 32, seed=0).run(policy)
    table, summary = record.table(0.05), record.summary(0.05)
    assert len(table) == 32
    assert 100 * table["goal_completion"].mean() == pytest.approx(summary["goal_completion_percent"])
    assert table["time_in_goal_steps"].mean() == pytest.approx(summary["time_in_goal_steps"])


def test_reports_give_two_three_and_five_centimeters_and_the_runs_own_threshold(policy):
    record = Evaluator("random_reach", TrialSettings(threshold=0.1), 4, seed=0).run(policy)
    assert list(summaries(record, 0.1)) == [0.02, 0.03, 0.05, 0.1]
    assert list(summaries(record, 0.05000001)) == [0.02, 0.03, 0.05000001]


def test_stochastic_trials_differ_from_deterministic_ones(policy):
    evaluator = Evaluator("random_reach", TrialSettings(), 4, seed=0)
    assert not np.array_equal(evaluator.run(policy).hand, evaluator.run(policy, deterministic=False).hand)
