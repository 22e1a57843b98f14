"""Grids, the trainings at their points, and what they left."""

import dataclasses
import json

import pandas as pd
import pytest
from treatments import AS_TRAINED

from bilateral_rl.analysis.results import COLUMNS
from bilateral_rl.config.resolve import resolve
from bilateral_rl.io.errors import UserError
from bilateral_rl.study.lesioning import measured_metrics
from bilateral_rl.study.sweep import (
    MAX_POINTS,
    Sweep,
    parse_grid,
    point_name,
    read_sweep,
    result_file,
)

GRID = {"bptt.penalty_coefficient": ["1e-3", "3e-5"], "model": ["uni_dl", "uni_ndl"]}


def test_a_grid_is_read_as_it_is_written():
    grid = parse_grid(["bptt.penalty=weights,activity", "model= uni_dl , cc_s", "seed=3"])
    assert grid == {"bptt.penalty": ["weights", "activity"], "model": ["uni_dl", "cc_s"], "seed": ["3"]}
    grid = parse_grid(["network.critic_arch=[32,32],[64, 64]", "ppo.gamma=0.9,0.97"])
    assert grid == {"network.critic_arch": ["[32,32]", "[64, 64]"], "ppo.gamma": ["0.9", "0.97"]}
    configs = [Sweep("ppo", grid).config(point) for point in Sweep("ppo", grid).points()]
    assert [config.network.critic_arch for config in configs] == [(32, 32), (32, 32), (64, 64), (64, 64)]
    assert parse_grid(["init_from=runs/a=b"]) == {"init_from": ["runs/a=b"]}


@pytest.mark.parametrize("item", ["bptt.penalty", "=1,2", "epochs=", "epochs=1,,2", "epochs=1,", "", "a=[1,2", "a=1]"])
def test_what_is_no_grid_is_refused(item):
    with pytest.raises(UserError, match="--grid takes key=value,value") as error:
        parse_grid([item])
    assert repr(item) in str(error.value)


def test_a_setting_is_given_once():
    with pytest.raises(UserError, match="--grid has epochs twice"):
        parse_grid(["epochs=1", "epochs=2"])


def test_points_are_all_combinations_the_last_setting_fastest():
    points = Sweep("bptt", GRID).points()
    assert [tuple(point.values()) for point in points] == [
        ("1e-3", "uni_dl"),
        ("1e-3", "uni_ndl"),
        ("3e-5", "uni_dl"),
        ("3e-5", "uni_ndl"),
    ]
    assert {tuple(point) for point in points} == {tuple(GRID)}


def test_the_training_at_a_point_has_its_settings_over_those_of_all():
    overrides = {"seeds": 3, "model": "cc_s", "bptt": {"penalty_coefficient": 5.0, "patience": 7}}
    sweep = Sweep("bptt", GRID, overrides)
    config = sweep.config(sweep.points()[3], threads=2)
    expected = {"seeds": 3, "threads": 2, "bptt": {"penalty_coefficient": 3e-5, "patience": 7}}
    assert config == resolve("bptt", "random_reach", [expected], model="uni_ndl")


def test_defaults_are_those_of_the_task_at_the_point():
    sweep = Sweep("ppo", {"task": ["random_reach", "hold_position"]})
    assert [sweep.config(point) for point in sweep.points()] == [
        resolve("ppo", task, [{"threads": 1}]) for task in ("random_reach", "hold_position")
    ]


def test_every_point_has_a_job_of_its_own_name_result_and_runs():
    sweep = Sweep("bptt", GRID, {"seeds": 2}, trials=32)
    jobs = sweep.jobs(threads=2)
    assert [job.name for job in jobs] == [
        "penalty_coefficient=1e-3,model=uni_dl",
        "penalty_coefficient=1e-3,model=uni_ndl",
        "penalty_coefficient=3e-5,model=uni_dl",
        "penalty_coefficient=3e-5,model=uni_ndl",
    ]
    assert len({job.result for job in jobs}) == len({job.arguments["runs"] for job in jobs}) == 4
    for job, point in zip(jobs, sweep.points(), strict=True):
        assert json.loads(json.dumps(job.arguments)) == job.arguments
        assert job.arguments["config"] == sweep.config(point, 2).to_values()
        (table,) = job.arguments["tables"]
        assert table["lesions"] == {
            "lesions": ["intact"], "protocols": [{"retrain": "none"}], "control": False, "trials": 32,
        }  # fmt: skip
        assert job.result == table["result"] == result_file(point)
        assert job.threads == 2


def test_more_seeds_and_two_losses_are_more_work():
    costs = [job.cost for job in Sweep("bptt", {"seeds": ["1", "4"], "model": ["uni_b", "cc_s"]}).jobs()]
    assert costs[2] == 4 * costs[0]
    assert costs[1] > costs[0]


def test_names_are_safe_as_those_of_files():
    name = point_name({"init_from": "../runs/a b:3", "network.critic_arch": "$x"})
    assert name == "init_from=.._runs_a_b_3,critic_arch=_x"


def test_points_that_are_one_are_refused():
    for grid in (
        {"epochs": ["3", "4", "3"]},
        {"bptt.learning_rate": ["1e-3", "0.001"]},
        {"bptt.trials": ["640", "640.0"], "model": ["cc_s", "bi_s"]},
        {"init_from": ["a b", "a_b"]},
    ):
        with pytest.raises(UserError, match="more than once; give every value once"):
            Sweep("bptt", grid).jobs()


def test_a_sweep_that_cannot_be_is_refused():
    for algo, grid, overrides, message in (
        ("bptt", {}, {}, "needs a --grid of 1 to 1,000 points, got none"),
        ("bptt", {"seed": [str(i) for i in range(MAX_POINTS + 1)]}, {}, "got 1001"),
        ("bptt", {"algo": ["ppo", "bptt"]}, {}, "leave algo out"),
        ("bptt", {"epochs": ["1"]}, {"algo": "ppo"}, "leave algo out"),
        ("bptt", {"nothing": ["1"]}, {}, "Unknown setting 'nothing'"),
        ("bptt", {"epochs": ["1", "many"]}, {}, "epochs must be a whole number"),
        ("bptt", {"timesteps": ["1"]}, {}, "timesteps is a setting of another algorithm"),
        ("dqn", {"seed": ["1"]}, {}, "Unknown algorithm 'dqn'"),
        ("ppo", {"task": ["swim"]}, {}, "Unknown task 'swim'"),
    ):
        with pytest.raises(UserError, match=message):
            Sweep(algo, grid, overrides).jobs()


def test_as_many_points_as_there_may_be():
    assert len(Sweep("bptt", {"seed": [str(i) for i in range(MAX_POINTS)]}).points()) == MAX_POINTS


def write(folder, sweep, n, seeds=(0, 1)):
    point = sweep.points()[n]
    config = sweep.config(point)
    rows = [(config.model, config.task, "bptt", s, "intact", *AS_TRAINED, "effort", 10.0 * n + s) for s in seeds]
    path = folder / result_file(point)
    path.parent.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(rows, columns=list(COLUMNS)).to_csv(path, index=False)
    return path


def test_results_are_read_with_their_points(tmp_path):
    sweep = Sweep("bptt", GRID)
    assert read_sweep(sweep, tmp_path).empty
    for n in (0, 3):
        write(tmp_path, sweep, n)
    (tmp_path / "results" / "other.csv").write_text("of another sweep")
    results = read_sweep(sweep, tmp_path)
    assert list(results["value"]) == [0, 1, 30, 31]
    assert list(results["model"]) == ["uni_dl"] * 2 + ["uni_ndl"] * 2
    assert list(results["bptt.penalty_coefficient"]) == ["1e-3"] * 2 + ["3e-5"] * 2
    assert list(results["point"].unique()) == [point_name(sweep.points()[n]) for n in (0, 3)]


def test_a_grid_over_first_seeds_keeps_every_seed(tmp_path):
    sweep = Sweep("bptt", {"seed": ["0", "100"]}, {"seeds": 2})
    write(tmp_path, sweep, 0, (0, 1))
    write(tmp_path, sweep, 1, (100, 101))
    results = read_sweep(sweep, tmp_path)
    assert list(results["seed"]) == [0, 1, 100, 101]
    assert list(results["point"]) == ["seed=0"] * 2 + ["seed=100"] * 2


def test_damaged_results_are_refused_with_what_to_do(tmp_path):
    sweep = Sweep("bptt", GRID)
    write(tmp_path, sweep, 1).write_text("")
    with pytest.raises(UserError, match="remove it and call the command again"):
        read_sweep(sweep, tmp_path)


def test_a_training_is_measured_at_its_own_radius_too():
    config = resolve("bptt", "hold_position", [{"trial": {"threshold": 0.042}}])
    names = {metric.name for metric in measured_metrics(config)}
    assert {"time_in_goal_1cm", "time_in_goal_4.2cm", "hold_speed"} <= names
    assert "goal_completion_5cm" not in names
    other = dataclasses.replace(config, task="random_reach")
    assert "goal_completion_4.2cm" in {metric.name for metric in measured_metrics(other)}
