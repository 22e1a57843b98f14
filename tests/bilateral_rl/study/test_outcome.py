import dataclasses
import json
import shutil

import pandas as pd
import pytest
from treatments import AS_TRAINED

from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.analysis.results import COLUMNS
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.study.grid import Grid
from bilateral_rl.study.outcome import StudyResults, learning_history, refuse_other_settings, runs_of, unsourced
from bilateral_rl.study.plan import Study
from bilateral_rl.study.provenance import describe_source
from bilateral_rl.study.readings import load_readings
from bilateral_rl.study.trainings import Table, Training

TABLES = Grid(Study(algo="ppo", seeds=2), load_readings()).all_tables


def table_of(config):
    return Table(Training("base", config), Protocol("none"), "paper", "paper")


def results_of(folder, tables):
    return StudyResults(folder).of(tables)


def write(folder, table, value):
    config, path = table.training.config, folder / table.path
    path.parent.mkdir(parents=True, exist_ok=True)
    row = (config.model, config.task, config.algo, config.seed, "intact", *AS_TRAINED, "effort", value)
    pd.DataFrame([row], columns=list(COLUMNS)).to_csv(path, index=False)
    return path


def test_results_are_those_of_the_tables_that_are_there(tmp_path):
    for i in (3, 0, 20):
        write(tmp_path, TABLES[i], i)
    (tmp_path / "results" / "base" / "random_reach" / "other.csv").write_text("not of this study")
    results = results_of(tmp_path, TABLES)
    assert list(results["value"]) == [0, 3, 20]
    assert list(results["seed"]) == [TABLES[i].training.config.seed for i in (0, 3, 20)]


def test_results_can_say_what_they_are_of(tmp_path):
    tables = Grid(Study(seeds=2), load_readings(["text-released-lesions", "text-penalty-none"])).all_tables
    chosen = [next(t for t in tables if t.lesions == "released"), next(t for t in tables if t.training.name != "base")]
    for value, table in enumerate(chosen):
        write(tmp_path, table, value)
    named = StudyResults(tmp_path).named(tables)
    assert list(named)[:2] == ["training", "lesions_of"]
    assert [tuple(row) for row in named[["training", "lesions_of", "value"]].to_numpy()] == [
        ("base", "released", 0.0),
        ("bptt.penalty_coefficient=0.0", "paper", 1.0),
    ]


def test_where_nothing_is_done_there_are_no_results_and_no_runs(tmp_path):
    results = results_of(tmp_path, TABLES)
    assert list(results) == list(COLUMNS)
    assert results.empty
    assert runs_of(tmp_path, TABLES) == {}
    assert learning_history({}).empty


def test_a_damaged_file_of_results_is_refused_with_what_to_do(tmp_path):
    for text in ("", "model,task\ncc_s,random_reach\n", '"'):
        path = write(tmp_path, TABLES[0], 1.0)
        path.write_text(text)
        with pytest.raises(UserError, match=r"; remove it and call the command again\.$") as error:
            results_of(tmp_path, TABLES)
        assert str(path) in str(error.value)


def test_results_of_a_run_by_other_settings_are_refused(tmp_path, bptt_run):
    config = bptt_run.config()
    path = write(tmp_path, table_of(config), 1.0)
    other = table_of(dataclasses.replace(config, bptt=dataclasses.replace(config.bptt, learning_rate=0.5)))
    refuse_other_settings(tmp_path, [table_of(config), other])  # it does not say what it is of
    path.with_suffix(".json").write_text(json.dumps(describe_source(bptt_run, "final", path.parent)))
    on_another_machine = table_of(dataclasses.replace(config, threads=7))
    refuse_other_settings(tmp_path, [table_of(config), on_another_machine])
    with pytest.raises(UserError, match=r"made by other settings than this study would now; choose another --out"):
        refuse_other_settings(tmp_path, [other])
    shutil.rmtree(bptt_run.path)
    refuse_other_settings(tmp_path, [other])


def test_runs_are_those_whose_results_are_there(tmp_path, bptt_run):
    table = table_of(bptt_run.config())
    folder = tmp_path  # bptt_run lies in runs/ below it
    assert runs_of(folder, [table]) == {}
    write(folder, table, 1.0)
    assert runs_of(folder, [table]) == {"cc_s": [bptt_run]}


def test_the_history_of_supervised_runs_has_a_row_a_seed_and_epoch(bptt_run):
    history = learning_history({"cc_s": [bptt_run]})
    assert set(history["model"]) == {"cc_s"}
    assert sorted(set(zip(history["seed"], history["epoch"], strict=True))) == [
        (seed, epoch) for seed in range(3) for epoch in range(1, 7)
    ]
    assert history["validation_loss"].notna().all()


def test_the_history_of_other_runs_has_a_row_a_seed_and_evaluation(run):
    history = learning_history({"cc_s": [run], "bi_s": [run]})
    assert list(history["model"].unique()) == ["cc_s", "bi_s"]
    assert set(history["seed"]) == {0}
    assert history["timesteps"].max() == 4000


def test_results_of_weights_that_their_run_no_longer_has_are_refused(tmp_path, bptt_run):
    table = table_of(bptt_run.config())
    path = write(tmp_path, table, 1.0)
    assert unsourced([path, tmp_path / "not there.csv"]) == [path]  # as in version 0.1.0, and read all the same
    assert len(results_of(tmp_path, [table])) == 1
    RunFolder(path.parent).write_json(path.with_suffix(".json").name, describe_source(bptt_run, "final", path.parent))
    assert unsourced([path]) == []
    assert len(results_of(tmp_path, [table])) == 1
    moved = tmp_path.with_name("moved")
    tmp_path.rename(moved)
    run = RunFolder(moved / bptt_run.path.relative_to(tmp_path))
    assert len(results_of(moved, [table])) == 1
    run.save_weights("final", {name: tensor * 0 for name, tensor in run.load_weights("final").items()})
    with pytest.raises(UserError, match=r"no longer has; remove it and call the command again\.$"):
        results_of(moved, [table])
    shutil.rmtree(run.path)  # to save space
    assert len(results_of(moved, [table])) == 1
