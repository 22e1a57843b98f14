"""The trainings and tables of results that readings come to."""

import dataclasses
import importlib
import inspect
import json
from pathlib import Path

import pytest
import yaml

from bilateral_rl.analysis.goals import JUDGED_RADII
from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.config.parse import build
from bilateral_rl.config.resolve import resolve
from bilateral_rl.io.errors import UserError
from bilateral_rl.study.agenda import agenda
from bilateral_rl.study.grid import Grid
from bilateral_rl.study.lesioning import LesionSettings
from bilateral_rl.study.plan import Study
from bilateral_rl.study.readings import load_readings
from bilateral_rl.study.trainings import BASE

PAIRS = [(task, model) for task in JUDGED_RADII for model in MODELS]
UNILATERAL = ("uni_b", "uni_dl", "uni_ndl")
NOWHERE = Path("no such folder")


def grid(*readings, threads=1, **study):
    return Grid(Study(**{"seeds": 2} | study), load_readings(readings or ("text", "everything")), threads)


def own_reading(folder, **values):
    path = folder / "mine.yaml"
    path.write_text(yaml.safe_dump({"why": "Because.", "source": "Nowhere."} | values))
    return str(path)


def names_of(tables):
    return [table.name for table in tables]


def fill(folder, tables):
    for table in tables:
        (folder / table.path).parent.mkdir(parents=True, exist_ok=True)
        (folder / table.path).write_text("")


def test_the_anchors_share_every_training():
    made = grid(seeds=10)
    jobs = made.jobs(NOWHERE)
    assert [job.name for job in jobs] == [f"{task}/{model}" for task, model in PAIRS]
    for job, (task, model) in zip(jobs, PAIRS, strict=True):
        config = job.arguments["config"]
        assert (config["task"], config["model"], config["algo"], config["seeds"]) == (task, model, "bptt", 10)
        assert job.arguments["runs"] == job.arguments["known_runs"] == "runs"
        names = ["none"] if model in UNILATERAL else ["none", "output", "everything"]
        expected = [f"results/base/{task}/{model}/{name}.csv" for name in names]
        assert [table["result"] for table in job.arguments["tables"]] == expected
        assert job.result == expected[-1]


def test_unilateral_networks_are_tested_intact_and_have_no_control():
    for training, tables in grid().tables.items():
        for table in tables:
            settings = build(LesionSettings, table.settings)
            unilateral = training.config.model in UNILATERAL
            assert (settings.lesions, settings.control) == ((("intact",), False) if unilateral else (None, True))
            assert settings.protocols == (table.protocol,)


def test_reinforcement_learning_has_a_job_a_model_task_and_seed():
    jobs = grid(algo="ppo", seeds=3).jobs(NOWHERE)
    assert len(jobs) == len({job.name for job in jobs}) == len({job.result for job in jobs}) == 14 * 3
    trainings = [tuple(job.arguments["config"][name] for name in ("task", "model", "seed")) for job in jobs]
    assert sorted(trainings) == sorted((task, model, seed) for task, model in PAIRS for seed in range(3))
    assert {job.arguments["runs"] for job in jobs} == {f"runs/seed-{seed}" for seed in range(3)}
    (job,) = (job for job in jobs if job.name == "hold_position/cc_s-seed-2")
    assert job.result == "results/base/hold_position/cc_s-seed-2/everything.csv"


@pytest.mark.parametrize(("algo", "readings"), [("bptt", "all"), ("ppo", "everything-speed")])
def test_no_two_jobs_number_runs_in_one_folder_or_write_one_file(algo, readings):
    jobs = grid(readings, algo=algo, seeds=3).jobs(NOWHERE)
    kinds = [(job.arguments["runs"], *(job.arguments["config"][name] for name in ("task", "model"))) for job in jobs]
    assert len(set(kinds)) == len({job.name for job in jobs}) == len(jobs)
    results = [table["result"] for job in jobs for table in job.arguments["tables"]]
    assert len(set(results)) == len(results)


@pytest.mark.parametrize("study", [{}, {"algo": "ppo", "quick": True}, {"profile": "released", "quick": True}])
def test_arguments_fit_what_is_called_and_survive_the_way_to_it(study):
    for job in grid(threads=2, **study).jobs(NOWHERE):
        module, _, name = job.work.partition(":")
        work = getattr(importlib.import_module(module), name)
        inspect.signature(work).bind(Path(), None, **job.arguments)
        assert json.loads(json.dumps(job.arguments)) == job.arguments
        assert resolve(None, None, [job.arguments["config"]]).to_values() == job.arguments["config"]
        assert job.threads == job.arguments["config"]["threads"] == 2
        for table in job.arguments["tables"]:
            settings = build(LesionSettings, table["lesions"])
            assert settings.profile == study.get("profile", "paper")
            assert (settings.trials == 256) == study.get("quick", False)


def test_all_shipped_readings_come_to_six_distinct_trainings():
    tables = grid("all").tables
    of_name = {}
    for training, its_tables in tables.items():
        of_name.setdefault(training.name, []).append((training.config, names_of(its_tables)))
    assert {name: len(trainings) for name, trainings in of_name.items()} == {
        BASE: 14,
        "bptt.penalty=activity,bptt.penalty_coefficient=0.01": 14,
        "bptt.penalty_coefficient=0.0": 14,
        "bptt.penalty_coefficient=0.0001": 14,
        "bptt.validation_trials=1024": 14,
        "trial.load=direction": 7,
    }
    assert {config.task for config, _ in of_name["trial.load=direction"]} == {"hold_position"}
    protocols = {
        "none", "output", "everything", "combination", "output-3-epochs", "everything-3-epochs", "output-lr-0.01",
        "everything-lr-0.01", "output-continued", "everything-continued", "output-training-trials",
        "everything-training-trials",
    }  # fmt: skip
    released = {f"{name}-released-lesions" for name in ("none", "output", "everything")}
    for name, trainings in of_name.items():
        for config, names in trainings:
            kind = config.spec.architecture
            more = {"unilateral": set(), "bilateral": protocols, "callosal": protocols | released}[kind]
            expected = more if name == BASE else {"none", "output", "everything"}
            assert set(names) == ({"none"} if kind == "unilateral" else expected)


def test_readings_that_differ_in_how_results_are_judged_alone_share_them():
    made = grid("everything", "everything-speed", "everything-hold-3cm", "everything-alone-shallow")
    first, *others = (made.tables_of(reading) for reading in made.readings)
    assert all(tables == first for tables in others)
    assert len(made.all_tables) == len(first)


def test_a_training_is_told_by_its_settings_and_not_by_how_they_are_written(tmp_path):
    calibrated = {"bptt": {"penalty": "weights", "penalty_coefficient": 0.001}}
    made = grid("text", own_reading(tmp_path, training={"random_reach": calibrated}))
    assert {training.name for training in made.tables} == {BASE}
    path = own_reading(tmp_path, training={"init_from": "../some where/run"})
    (name,) = {training.name for training in grid(path).tables}
    assert name.startswith("init_from=.._some_where_run-")  # letters alone would not tell it from others


def test_a_study_goes_on_with_more_readings_and_makes_what_is_missing(tmp_path):
    few, more = grid("everything"), grid("text", "everything")
    fill(tmp_path, few.all_tables)
    assert all(job.is_done(tmp_path) for job in few.jobs(tmp_path))
    for job in more.jobs(tmp_path):
        hemispheres = not job.name.endswith(UNILATERAL)
        assert job.is_done(tmp_path) != hemispheres
        made = [Path(table["result"]).name for table in job.arguments["tables"]]
        assert made == (["output.csv"] if hemispheres else [])


def test_a_job_that_lacks_a_table_is_not_done_whichever_it_is(tmp_path):
    made = grid("text", "everything")
    fill(tmp_path, made.all_tables)
    for table in made.all_tables:
        (tmp_path / table.path).unlink()
        undone = [job for job in made.jobs(tmp_path) if not job.is_done(tmp_path)]
        assert [(job.name, job.result) for job in undone] == [(table.training.job_name, table.path)]
        fill(tmp_path, [table])


def test_what_is_left_to_do_is_told_with_its_cost(tmp_path):
    made = grid("text", "text-load-direction")
    base, load = agenda(made, tmp_path)
    assert (base.name, base.networks, base.to_train) == (BASE, 28, 28)
    assert (load.name, load.networks, load.to_train) == ("trial.load=direction", 14, 14)
    assert (base.protocols, base.tables, base.to_measure) == (("none", "output"), 6 + 2 * 8, 6 + 2 * 8)
    assert 28 * 13 < base.seconds < 28 * 13 * 2
    fill(tmp_path, made.all_tables)
    assert {(step.to_train, step.to_measure, step.seconds) for step in agenda(made, tmp_path)} == {(0, 0, 0.0)}


def test_a_training_that_is_made_costs_nothing_more(tmp_path, bptt_run):
    config = bptt_run.config()
    made = grid("text", seeds=config.seeds)
    (training,) = (t for t in made.tables if t.job_name == "random_reach/cc_s")
    own = dataclasses.replace(training, config=config)  # bptt_run lies in runs/ below it
    made.tables[own] = [dataclasses.replace(table, training=own) for table in made.tables.pop(training)]
    assert own.is_made(tmp_path)
    assert not own.is_made(tmp_path / "elsewhere")
    tables_alone = made.seconds_left(own, tmp_path)
    assert 0 < tables_alone < made.seconds_left(own, tmp_path / "elsewhere")
    assert [job.cost for job in made.jobs(tmp_path) if job.name == "random_reach/cc_s"] == [tables_alone]
    fill(tmp_path, made.tables[own])
    assert made.seconds_left(own, tmp_path) == 0


def test_a_preview_costs_less():
    for algo in ("bptt", "ppo"):
        whole, quick = (agenda(grid(algo=algo, quick=quick), NOWHERE)[0].seconds for quick in (False, True))
        assert quick < whole / 2


def test_trainings_with_two_losses_count_as_longer():
    costs = {job.arguments["config"]["model"]: job.cost for job in grid("text-penalty-none").jobs(NOWHERE)}
    assert costs["bi_s"] > costs["bi_ns"] > costs["uni_b"]


@pytest.mark.parametrize(
    ("readings", "study", "message"),
    [
        (
            ["text-penalty-none"],
            {"profile": "released"},
            "text-penalty-none sets the weight penalty, and so does --pro",
        ),
        (
            ["text-released-lesions"],
            {"profile": "released"},
            "sets the combined lesions, and so does --profile released",
        ),
        (["text-validation-1024"], {"algo": "ppo"}, "changes the training by bptt, and this study trains by ppo"),
        (
            ["text-continued"],
            {"algo": "sac"},
            "goes on with the training's optimizer, which a training by sac does not",
        ),
        (["text-training-trials"], {"algo": "ppo"}, "goes on with the training's trials, which a training by ppo does"),
    ],
)
def test_readings_that_a_study_leaves_no_room_for_are_refused(readings, study, message):
    with pytest.raises(UserError, match=message):
        grid(*readings, **study)


def test_the_other_readings_go_with_every_profile_and_algorithm():
    for study in ({"profile": "released"}, {"algo": "ppo"}):
        made = grid("text", "everything-speed", "combination", "text-lr-0.01", "everything-alone-shallow", **study)
        assert {training.name for training in made.tables} == {BASE}


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"training": {"model": "cc_s"}}, "The reading mine cannot change model, which is the study's to choose"),
        ({"training": {"seed": 3}}, "The reading mine cannot change seed, which"),
        # Two jobs, with these settings and without them, would write one file.
        ({"training": {"threads": 4}}, "The reading mine cannot change threads, which"),
        ({"training": {"hold_position": {"device": "cuda"}}}, "The reading mine cannot change device, which"),
        ({"training": {"bptt": None}}, "cannot be trained. bptt must be settings by name, got None"),
        ({"training": {"bptt": [1]}}, "cannot be trained. bptt must be settings by name"),
        ({"training": {"bptt": 3}}, "cannot be trained. bptt must be settings by name, got 3"),
        ({"training": {"nothing": 1}}, "The reading mine cannot be trained. Unknown setting 'nothing'"),
        ({"training": {"epochs": "many"}}, "The reading mine cannot be trained. epochs must be a whole number"),
    ],
)
def test_training_settings_that_cannot_be_are_refused_with_the_reading(tmp_path, values, message):
    with pytest.raises(UserError, match=message):
        grid(own_reading(tmp_path, **values))


def test_a_penalty_after_a_lesion_is_refused_with_the_released_profile(tmp_path):
    path = own_reading(tmp_path, protocol={"retrain": "everything", "penalty_coefficient": 0.1})
    assert grid(path).readings[0].protocol == Protocol("everything", penalty_coefficient=0.1)
    with pytest.raises(UserError, match="mine sets the weight penalty"):
        grid(path, profile="released")
