"""The trainings that a study comes to."""

import os

import pytest
import yaml

from bilateral_rl.analysis.goals import JUDGED_RADII
from bilateral_rl.config.catalogue import ALGORITHMS, MODELS
from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import MAX_SEED
from bilateral_rl.envs.tasks import TASKS, RandomReach
from bilateral_rl.io.errors import UserError
from bilateral_rl.study.calibration import CALIBRATED
from bilateral_rl.study.plan import Study, side_by_side


def test_a_new_task_does_not_join_the_paper(monkeypatch):
    monkeypatch.setitem(TASKS, "new", RandomReach)
    assert len(Study(seeds=2).configs()) == 14


def test_a_preview_is_shorter_and_tests_less():
    for algo, name in (("bptt", "epochs"), ("ppo", "timesteps")):
        whole, quick = (Study(algo=algo, quick=quick) for quick in (False, True))
        assert getattr(quick.configs()[0], name) < getattr(whole.configs()[0], name) / 5
        assert quick.tests.keys() == {"trials", "retraining_trials"}
        assert whole.tests == {}
    assert Study(quick=True).configs()[0].epochs == 10
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


@pytest.mark.parametrize("profile", ["paper", "released"])
def test_reinforcement_learning_has_its_own_calibrated_penalty_or_that_of_train(monkeypatch, profile):
    calibrated = {"random_reach": 0.125, "hold_position": 0.25}
    monkeypatch.setitem(CALIBRATED, "ppo", calibrated)
    monkeypatch.delitem(CALIBRATED, "td3", raising=False)
    study = Study(algo="ppo", profile=profile, seeds=1)
    assert study.is_calibrated
    assert {(c.task, c.ppo.weight_penalty) for c in study.configs()} == set(calibrated.items())
    assert not Study(algo="td3", profile=profile).is_calibrated
    for config in Study(algo="td3", profile=profile, seeds=1).configs():
        assert config.td3.weight_penalty == resolve("td3", config.task).td3.weight_penalty


def test_a_penalty_of_ones_own_is_not_the_calibrated_one():
    overrides = {"bptt": {"penalty_coefficient": 0.5}}
    assert Study(overrides={"bptt": {"epsilon": 1e-6}}).is_calibrated
    assert not Study(overrides=overrides).is_calibrated
    assert not Study(profile="released").is_calibrated
    assert {coefficient for _, coefficient in penalties(Study(overrides=overrides)).values()} == {0.5}


def test_what_is_calibrated_is_calibrated_for_every_task():
    for algo, by_task in CALIBRATED.items():
        assert algo in ALGORITHMS
        assert set(by_task) == set(JUDGED_RADII)
        assert all(coefficient >= 0 for coefficient in by_task.values())


def test_a_study_can_be_of_some_models():
    study = Study(algo="sac", seeds=2, models=("bi_s", "bi_ns"))
    assert {(c.task, c.model, c.seed) for c in study.configs()} == {
        (task, model, seed) for task in JUDGED_RADII for model in ("bi_s", "bi_ns") for seed in (0, 1)
    }
    assert study.name == "reproduce-sac-paper-bi_s-bi_ns"
    assert yaml.safe_load(yaml.safe_dump(study.to_values())) == study.to_values()
    assert Study(models=tuple(reversed(MODELS))).name == Study().name == "reproduce-bptt-paper"


def test_specialized_models_are_probed_as_they_learn_by_reinforcement():
    quick, short = Study(algo="ppo", seeds=1, quick=True), Study(algo="sac", seeds=1, overrides={"timesteps": 250})
    for config in [*quick.configs(), *short.configs()]:
        every = config.evaluation.lesion_probe_every
        assert (11 < config.timesteps / every <= 12) if config.model in ("bi_s", "cc_s") else every == 0
    assert short.configs()[0].timesteps == 250


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_a_training_can_be_made_elsewhere_by_what_its_configuration_says(algo):
    for config in Study(algo=algo, seeds=1).configs():
        assert resolve(None, None, [yaml.safe_load(yaml.safe_dump(config.to_values()))]) == config


def test_how_often_is_probed_can_be_set():
    for every in (0, 7):
        study = Study(algo="ppo", seeds=1, overrides={"evaluation": {"lesion_probe_every": every}})
        assert {config.evaluation.lesion_probe_every for config in study.configs()} == {every}


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
    assert len(rl.configs()) == 14 * 2
    assert {(config.seed, config.seeds) for config in rl.configs()} == {(103, 1), (104, 1)}
    assert rl.name == "reproduce-ppo-paper-quick-seeds-103-104"


def test_a_study_explores_unless_all_seeds_are_from_100_on():
    for study, purpose in (
        (Study(), "exploration"),
        (Study(first_seed=99, seeds=30), "exploration"),
        (Study(first_seed=100, seeds=1), "confirmation"),
        (Study(overrides={"seed": 100}), "confirmation"),
        (Study(first_seed=100, quick=True), "exploration"),
    ):
        assert study.purpose == purpose


def test_settings_of_a_task_come_on_top_of_all_others():
    study = Study(overrides={"epochs": 7})
    configs = study.configs(training={"hold_position": {"epochs": 2, "bptt": {"penalty_coefficient": 0.5}}})
    assert {(config.task, config.epochs, config.penalty_coefficient) for config in configs} == {
        ("random_reach", 7, 1e-3),
        ("hold_position", 2, 0.5),
    }


def test_a_study_that_cannot_be_is_refused():
    for wrong, message in (
        ({"algo": "dqn"}, "Unknown algorithm 'dqn'"),
        ({"profile": "mine"}, "Unknown profile 'mine'"),
        ({"seeds": 0}, "--seeds must be at least 1"),
        ({"models": ("cc_s", "nope")}, "Unknown model 'nope'"),
        ({"models": ()}, "one model or more"),
        ({"models": ("cc_s", "cc_s")}, "each once"),
        ({"overrides": {"model": "cc_s"}}, "--set cannot change model"),
        ({"overrides": {"seeds": 3}}, "--set cannot change seeds"),
        ({"overrides": {"profile": "released"}}, "--set cannot change profile"),
    ):
        with pytest.raises(UserError, match=message):
            Study(**wrong)


def test_settings_that_cannot_be_are_refused():
    for overrides in ({"nothing": 1}, {"epochs": "many"}, {"timesteps": 5}):
        with pytest.raises(UserError):
            Study(overrides=overrides).configs()
    for algo in ("bptt", "ppo"):
        with pytest.raises(UserError, match="The last seed"):
            Study(algo=algo, seeds=2, first_seed=MAX_SEED).configs()


def test_processors_are_shared_among_the_jobs_at_a_time(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)))
    assert side_by_side(None, 14, "bptt") == (8, 1)
    assert side_by_side(2, 14, "bptt") == (2, 4)
    assert side_by_side(3, 14, "bptt") == (3, 2)
    assert side_by_side(20, 14, "bptt") == (14, 1)
    assert side_by_side(None, 3, "bptt") == (3, 2)
    assert side_by_side(2, 14, "ppo") == (2, 1)
    with pytest.raises(UserError, match="--jobs must be at least 1, got 0"):
        side_by_side(0, 14, "bptt")
