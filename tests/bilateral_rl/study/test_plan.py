"""The trainings that a study comes to."""

import importlib
import inspect
import json
import os
from pathlib import Path

import pytest

from bilateral_rl.analysis.goals import JUDGED_RADII
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import MAX_SEED
from bilateral_rl.envs.tasks import TASKS, RandomReach
from bilateral_rl.io.errors import UserError
from bilateral_rl.study.plan import Study, side_by_side

PAIRS = [(task, model) for task in JUDGED_RADII for model in MODELS]


def test_supervised_training_has_a_job_a_model_and_task():
    jobs = Study(seeds=10).jobs()
    assert [job.name for job in jobs] == [f"{task}/{model}" for task, model in PAIRS]
    assert len(jobs) == 14
    for job, (task, model) in zip(jobs, PAIRS, strict=True):
        config = job.arguments["config"]
        assert (config["task"], config["model"], config["algo"], config["seeds"]) == (task, model, "bptt", 10)
        assert job.result == f"results/{task}/{model}.csv"


def test_reinforcement_learning_has_a_job_a_model_task_and_seed():
    jobs = Study(algo="ppo", seeds=3).jobs()
    assert len(jobs) == len({job.name for job in jobs}) == len({job.result for job in jobs}) == 14 * 3
    trainings = [tuple(job.arguments["config"][name] for name in ("task", "model", "seed")) for job in jobs]
    assert sorted(trainings) == sorted((task, model, seed) for task, model in PAIRS for seed in range(3))


def test_a_new_task_does_not_join_the_paper(monkeypatch):
    monkeypatch.setitem(TASKS, "new", RandomReach)
    study = Study(seeds=2)
    assert study.n_jobs == len(study.jobs()) == 14


def test_no_two_jobs_number_runs_in_one_folder():
    for algo in ("bptt", "ppo"):
        # A run's folder is <runs>/<task>/<model>-<algo>-<n>.
        jobs = Study(algo=algo, seeds=3).jobs()
        kinds = [
            (job.arguments["runs"], *(job.arguments["config"][name] for name in ("task", "model"))) for job in jobs
        ]
        assert len(set(kinds)) == len(jobs)


@pytest.mark.parametrize("study", [Study(), Study(algo="ppo", quick=True), Study(profile="released", quick=True)])
def test_arguments_fit_what_is_called_and_survive_the_way_to_it(study):
    for job in study.jobs(threads=2):
        module, _, name = job.work.partition(":")
        work = getattr(importlib.import_module(module), name)
        inspect.signature(work).bind(Path(), None, **job.arguments)
        assert json.loads(json.dumps(job.arguments)) == job.arguments
        assert resolve(None, None, [job.arguments["config"]]).to_values() == job.arguments["config"]
        assert job.arguments["result"] == job.result
        assert job.threads == job.arguments["config"]["threads"] == 2


def test_a_preview_is_shorter_and_tests_less():
    for algo, name in (("bptt", "epochs"), ("ppo", "timesteps")):
        whole, quick = (Study(algo=algo, quick=quick).jobs()[0].arguments for quick in (False, True))
        assert quick["config"][name] < whole["config"][name] / 5
        assert {"trials", "retraining_trials"} <= quick["lesions"].keys()
        assert whole["lesions"] == {"profile": "paper"}
    assert Study(quick=True).jobs()[0].arguments["config"]["epochs"] == 10
    assert Study(quick=True).name == "reproduce-bptt-paper-quick"
    assert Study(algo="ppo").name == "reproduce-ppo-paper"


def penalties(study):
    return {config.task: (config.penalty, config.penalty_coefficient) for config in study.configs()}


def test_the_calibrated_penalty_is_that_of_supervised_training_as_in_the_papers_text():
    assert penalties(Study()) == {"random_reach": ("weights", 1e-3), "hold_position": ("weights", 3e-5)}
    assert penalties(Study(quick=True)) == penalties(Study())
    assert {kind for kind, _ in penalties(Study(profile="released")).values()} == {"released"}
    for config in Study(profile="released").configs():
        assert (config.profile, config.bptt.penalty, config.bptt.penalty_coefficient) == ("released", None, None)
    default = resolve("ppo", "hold_position").ppo.weight_penalty
    assert {config.ppo.weight_penalty for config in Study(algo="ppo").configs()} == {default}


def test_lesions_are_those_of_the_profile():
    for profile in ("paper", "released"):
        assert {job.arguments["lesions"]["profile"] for job in Study(profile=profile).jobs()} == {profile}


def test_overrides_win():
    overrides = {"epochs": 2, "seed": 7, "bptt": {"penalty": "activity", "penalty_coefficient": 0.5}}
    study = Study(quick=True, overrides=overrides)
    assert {(config.epochs, config.seed) for config in study.configs()} == {(2, 7)}
    assert set(penalties(study).values()) == {("activity", 0.5)}
    seeds = {config.seed for config in Study(algo="ppo", seeds=2, overrides={"seed": 7}).configs()}
    assert seeds == {7, 8}


def test_seeds_can_begin_anywhere():
    study = Study(seeds=30, first_seed=100)
    assert {tuple(config.all_seeds) for config in study.configs()} == {tuple(range(100, 130))}
    assert study.name == "reproduce-bptt-paper-seeds-100-129"
    rl = Study(algo="ppo", seeds=2, quick=True, first_seed=103)
    assert len(rl.jobs()) == rl.n_jobs == 14 * 2
    assert {(config.seed, config.seeds) for config in rl.configs()} == {(103, 1), (104, 1)}
    assert {job.result.rpartition("-")[2] for job in rl.jobs()} == {"103.csv", "104.csv"}
    assert rl.name == "reproduce-ppo-paper-quick-seeds-103-104"


def test_seeds_explore_unless_all_are_from_100_on():
    for study, purpose in (
        (Study(), "exploration"),
        (Study(first_seed=99, seeds=30), "exploration"),
        (Study(first_seed=100, seeds=1), "confirmation"),
        (Study(overrides={"seed": 100}), "confirmation"),
    ):
        assert study.purpose == purpose


def test_trainings_with_two_losses_count_as_longer():
    costs = {job.arguments["config"]["model"]: job.cost for job in Study().jobs()}
    longer = {model for model, cost in costs.items() if cost > costs["uni_b"]}
    assert longer == {"bi_s", "cc_s"}


def test_a_study_that_cannot_be_is_refused():
    for wrong, message in (
        ({"algo": "dqn"}, "Unknown algorithm 'dqn'"),
        ({"profile": "mine"}, "Unknown profile 'mine'"),
        ({"seeds": 0}, "--seeds must be at least 1"),
        ({"overrides": {"model": "cc_s"}}, "--set cannot change model"),
        ({"overrides": {"seeds": 3}}, "--set cannot change seeds"),
        ({"overrides": {"profile": "released"}}, "--set cannot change profile"),
    ):
        with pytest.raises(UserError, match=message):
            Study(**wrong)


def test_settings_that_cannot_be_are_refused():
    for overrides in ({"nothing": 1}, {"epochs": "many"}, {"timesteps": 5}):
        with pytest.raises(UserError):
            Study(overrides=overrides).jobs()
    for algo in ("bptt", "ppo"):
        with pytest.raises(UserError, match="The last seed"):
            Study(algo=algo, seeds=2, first_seed=MAX_SEED).jobs()


def test_what_cannot_be_retrained_after_a_lesion_is_refused_before_it_is_trained():
    for trial in ({"motor_noise": 0.1}, {"feedback_delay": 2}):
        with pytest.raises(UserError, match="leave both out of --set"):
            Study(algo="ppo", overrides={"trial": trial}).jobs()


def test_processors_are_shared_among_the_jobs_at_a_time(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)))
    assert side_by_side(None, 14) == (8, 1)
    assert side_by_side(2, 14) == (2, 4)
    assert side_by_side(3, 14) == (3, 2)
    assert side_by_side(20, 14) == (14, 1)
    assert side_by_side(None, 3) == (3, 2)
    with pytest.raises(UserError, match="--jobs must be at least 1, got 0"):
        side_by_side(0, 14)
