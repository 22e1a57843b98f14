"""Every trial of two arms is tested both ways: what one hand did, the other does in the next trial."""

import dataclasses

import numpy as np
import pytest
import torch

from bilateral_rl.analysis.both_ways import OddTrialsError
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.envs import TrialSettings
from bilateral_rl.envs.experiments.experiment import Arms
from bilateral_rl.envs.experiments.files import experiment_named
from bilateral_rl.envs.experiments.forces import Forces
from bilateral_rl.envs.experiments.task import ExperimentTask
from bilateral_rl.envs.two_arms import SpringSettings, TwoArmSettings
from bilateral_rl.policies import make_network
from bilateral_rl.vocabulary import SIDES

NOISY = TrialSettings(
    trial_length=5, sensory_noise=0.01, motor_noise=0.05, feedback_delay=1,
    two_arms=TwoArmSettings(spring=SpringSettings(stiffness=50.0, damping=1.0)),
)  # fmt: skip


class Ambidextrous:
    """Does with each arm the same, by what it sees of it."""

    def __init__(self):
        self._weights = np.random.default_rng(0).normal(size=(20, 6)).astype(np.float32)

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        views = observation.reshape(-1, 20)
        # Row by row: a product of matrices may round a row by where it stands.
        commands = np.stack([np.tanh((view[:, None] * self._weights).sum(axis=0)) for view in views])
        return commands.reshape(len(observation), 12), None


@pytest.fixture(scope="module")
def record():
    return Evaluator("reach_and_hold", NOISY, 6, seed=3).run(Ambidextrous())


def per_trial(values):
    return values.reshape(-1, 2, *values.shape[1:])


def in_unlike_fields():
    """An experiment with a field on each hand, of which one is three times the other, and targets from lists."""
    experiment = experiment_named("bimanual_curl_field")
    weak = dataclasses.replace(experiment.arms.dominant, forces=Forces(curl=5.0))
    return ExperimentTask(dataclasses.replace(experiment, exchange=0.5, arms=Arms(weak, experiment.arms.non_dominant)))


@pytest.mark.parametrize("task", [lambda: "reach_and_hold", in_unlike_fields])
def test_the_arms_change_places_in_every_other_trial_to_the_bit(task):
    alone = dataclasses.replace(NOISY, two_arms=TwoArmSettings())  # a spring's force is rounded in one arm's frame
    record = Evaluator(task(), alone, 6, seed=3).run(Ambidextrous())
    if record.plan.is_of_experiment:
        assert np.ptp(record.plan.target_index) > 0
        assert (record.field_force != 0).any()
    for name in ("target_index", "condition", "goal"):
        values = per_trial(getattr(record.plan, name))
        np.testing.assert_array_equal(values[1::2], values[::2, ::-1], err_msg=name)
    for field in dataclasses.fields(TrialRecord):
        values = getattr(record, field.name)
        if isinstance(values, np.ndarray):
            drawn, exchanged = per_trial(values)[::2], per_trial(values)[1::2]
            np.testing.assert_array_equal(exchanged, drawn[:, ::-1], err_msg=field.name)
    np.testing.assert_array_equal(per_trial(record.plan.role)[1::2], per_trial(record.plan.role)[::2, ::-1])


def test_so_no_hand_has_the_easier_trials(record):
    by_hand = record.summaries_by_hand(0.05)
    for role in ("reach", "hold"):
        assert by_hand["dominant", role] == pytest.approx(by_hand["non_dominant", role], rel=1e-4, nan_ok=True)


def test_a_row_says_whose_it_is(record):
    assert record.plan.trial.tolist() == [i // 2 for i in range(12)]
    assert record.plan.hand.tolist() == [*SIDES] * 6
    assert all(sorted(roles) == ["hold", "reach"] for roles in per_trial(record.plan.role))
    assert record.observation.shape == (12, 5, 20)
    assert record.force.shape == (12, 5, 2)
    assert np.ptp(record.force, axis=1).min() > 0  # of the spring, which is another one in each step


def test_a_hand_is_where_its_view_sees_it_before_any_noise():
    record = Evaluator("two_reaches", TrialSettings(trial_length=3), 2, seed=0).run(Ambidextrous())
    np.testing.assert_array_equal(record.observation[:, :, 12:14], record.hand[:, :3])
    np.testing.assert_array_equal(record.observation[:, 0, 16:18], record.target)


def test_the_spring_pulls_both_hands_alike_in_the_frame_of_the_body(record):
    force = per_trial(record.body_vectors(record.force))
    np.testing.assert_allclose(force[:, 0], -force[:, 1], atol=1e-5)


def test_the_even_trials_are_the_first_ones_of_their_seeds(record):
    other = Evaluator("reach_and_hold", NOISY, 2, seed=5).run(Ambidextrous())
    np.testing.assert_array_equal(per_trial(record.hand)[2:4], per_trial(other.hand))


def test_an_odd_number_is_refused():
    with pytest.raises(OddTrialsError, match="must be even, got 3"):
        Evaluator("two_holds", NOISY, 3, seed=0)


def test_a_hand_that_always_reaches_does_so_in_tests():
    arms = TwoArmSettings(roles="non_dominant_reaches")
    plan = Evaluator("reach_and_hold", dataclasses.replace(NOISY, two_arms=arms), 3, seed=0).plan
    assert plan.role.tolist() == ["hold", "reach"] * 3


def test_the_sides_exchange_the_noise_of_their_hidden_units():
    evaluator = Evaluator("two_reaches", TrialSettings(trial_length=3), 4, seed=0)
    network = make_network("bilateral", 40, 12, units=6, hidden_noise=0.1, n_arms=2)
    noise = evaluator.hidden_noise(network).reshape(2, 2, 3, 2, 2, 3)  # pair, way, step, layer, side, unit
    assert torch.equal(noise[:, 1], noise[:, 0].flip(dims=(3,)))
