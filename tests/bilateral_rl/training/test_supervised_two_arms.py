"""Supervised training of two arms from start to end: seeds alone, stops, what it says of each hand, and retraining."""

import numpy as np
import pytest
import torch
from supervised_runs import Watch, scalars, table
from trainers import finish, of_seed

from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.bptt.history import history_columns
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.envs.measures import trial_measures
from bilateral_rl.envs.trials import TrialBatch
from bilateral_rl.policies.lesions import LESIONS
from bilateral_rl.runs.policies import build_network, load_policies
from bilateral_rl.training.retraining import Retraining
from bilateral_rl.training.run import resume, train
from bilateral_rl.vocabulary import SIDES

SETTINGS = {"model": "cc_s", "task": "reach_and_hold", "network": {"units": 8}}
"""One shape for all tests here: each costs a compilation."""


def small_pair(small_bptt, **values):
    return small_bptt(**SETTINGS | {"bptt": {"learning_rate": 0.02, "trials": 64}} | values)


@pytest.fixture(scope="module")
def whole(small_bptt, tmp_path_factory):
    return train(small_pair(small_bptt), tmp_path_factory.mktemp("whole")).folder


def test_a_seed_of_a_stack_ends_with_the_bits_it_has_alone(make_trainer, small_bptt, same_bits):
    stacks = [finish(make_trainer(small_pair(small_bptt, seeds=3, seed=5, threads=n))) for n in (1, 2)]
    for index in range(3):
        alone = finish(make_trainer(small_pair(small_bptt, seeds=1, seed=5 + index, threads=1)))
        assert all(same_bits(of_seed(stack, index), of_seed(alone, 0)) for stack in stacks)
    assert len(torch.unique(stacks[0].weights, dim=0)) == 3


@pytest.mark.usefixtures("no_pictures")
def test_a_training_that_was_stopped_ends_with_the_same_bits(tmp_path, small_bptt, whole, assert_same_end):
    config = small_pair(small_bptt)
    folder = train(config, tmp_path, Watch(6)).folder
    resume(folder, config)
    assert_same_end(folder, whole)


def test_the_history_and_tensorboard_tell_of_each_hand_by_its_role(whole):
    """Validation trials done once more, by the environment and the torch network."""
    config = whole.config()
    task, trial, n = config.make_task(), config.trial, config.bptt.validation_trials
    for seed, policy in load_policies(whole).items():
        uniform = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2,))).random((n, task.n_uniform))
        batch = TrialBatch(task, trial, n)
        batch.start(np.arange(n, dtype=np.int32), task.trials(uniform, trial))
        for _ in range(trial.trial_length):
            with torch.no_grad():
                batch.step(2 * policy.motor_network.excitation(torch.from_numpy(batch.observation)).numpy() - 1)
        row, reaches, arm = table(whole)[seed][-1], batch.start_distance > 1e-6, np.arange(2 * n) % 2
        for number, hand in enumerate(SIDES):
            for role, rows in (("reach", reaches), ("hold", ~reaches)):
                own = rows & (arm == number)
                if own.any():
                    means = trial_measures(batch.distance[own], batch.start_distance[own], trial.threshold).means()
                    final = row[f"final_error_cm_of_{hand}_{role}"]
                    assert final == pytest.approx(means["final_error_cm"], rel=1e-3)
                    assert row[f"time_in_goal_steps_of_{hand}_{role}"] == pytest.approx(
                        means["time_in_goal_steps"], rel=1e-6
                    )
        assert "goal_completion_percent_of_dominant_hold" not in row
        means = trial_measures(batch.distance[reaches], batch.start_distance[reaches], trial.threshold).means()
        assert row["goal_completion_percent"] == pytest.approx(means["goal_completion_percent"], rel=1e-6), (
            "reaches alone"
        )
        shown = scalars(whole, seed)["evaluation/final_error_cm_of_dominant_reach"]
        assert shown[-1][1] == pytest.approx(row["final_error_cm_of_dominant_reach"], rel=1e-6, nan_ok=True)


@pytest.mark.parametrize("name", ["callosum", "deep_dominant"])
def test_the_output_layers_alone_adapt_to_a_lesion(whole, name):
    config = whole.config()
    layout = Layout(build_network(config))
    before = layout.pack([policy.motor_network.state_dict() for policy in load_policies(whole).values()])
    after = Retraining(config, Protocol("output"), threads=1).run(before, config.all_seeds, [LESIONS[name]] * 2)
    for v in layout.variables:
        moved = (after != before)[:, v.offset : v.offset + v.size]
        assert moved.any() == v.name.startswith("output"), v.name


def test_columns_of_the_history(small_bptt):
    for task, n in (("reach_and_hold", 10), ("two_reaches", 6), ("two_holds", 4)):
        config = small_pair(small_bptt, task=task)
        columns = history_columns(config, Layout(build_network(config)))
        assert len([name for name in columns if "_of_" in name]) == n
        assert len(set(columns)) == len(columns)
