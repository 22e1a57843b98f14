"""`bilateral-rl sweep`, with made-up results in the place of trainings."""

import re

import pandas as pd
import pytest
from treatments import AS_TRAINED

from bilateral_rl.analysis.results import COLUMNS
from bilateral_rl.api import jobs as command
from bilateral_rl.commands.jobs import INTERRUPTED_EXIT
from bilateral_rl.io.errors import UserError
from bilateral_rl.study.jobs import JobOutcome, JobState

GRID = ("--grid", "epochs=1,2", "--grid", "model=uni_dl,uni_ndl", "--jobs", 4, "--out", "study")


@pytest.fixture
def prepare(tmp_path, toy_models):
    """Writes results of one point: values by seed, by metric."""

    def write(name, task="random_reach", **metrics):
        rows = [
            ("uni_dl", task, "bptt", seed, "intact", *AS_TRAINED, metric.replace("_at_", "_"), value)
            for metric, values in metrics.items()
            for seed, value in enumerate(values)
        ]
        path = tmp_path / "prepared" / f"{name}.csv"
        path.parent.mkdir(exist_ok=True)
        pd.DataFrame(rows, columns=list(COLUMNS)).to_csv(path, index=False)

    return write


def cells(out, *first):
    """Those of the row that begins with these."""
    rows = [[cell.strip() for cell in re.split("[│┃]", line)[1:-1]] for line in out.splitlines()]
    (row,) = [row for row in rows if row[: len(first)] == list(first)]
    return row[len(first) :]


def test_what_came_out_stands_side_by_side(invoke, prepare, tmp_path):
    for epochs, low in ((1, 80.0), (2, 90.0)):
        for model, more in (("uni_dl", 0.0), ("uni_ndl", 5.0)):
            values = [low + more - 1, low + more, low + more + 1]
            prepare(f"epochs={epochs},model={model}", goal_completion_5cm=values, final_error=[epochs, epochs, epochs])
    code, out = invoke("sweep", *GRID)
    assert code == 0
    for epochs, model, expected in (("1", "uni_dl", "80"), ("1", "uni_ndl", "85"), ("2", "uni_ndl", "95")):
        assert cells(out, epochs, model) == [f"{expected}.0 ± 1.0", f"{epochs} ± 0", "3"]
    assert cells(out, "epochs", "model")[0] == "Goal completion within 5 cm (%)"
    written = pd.read_csv(tmp_path / "study" / "sweep.csv")
    assert len(written) == 4 * 3 * 2
    assert sorted(set(written["epochs"])) == [1, 2]
    assert "study/sweep.csv" in out
    code, out = invoke("sweep", *GRID)
    assert code == 0
    assert "4 of 4 jobs were done before." in out


def test_points_that_failed_are_said_and_left_out(invoke, prepare, tmp_path):
    prepare("epochs=2,model=uni_dl", goal_completion_5cm=[91.0], final_error=[float("nan")])
    code, out = invoke("sweep", *GRID)
    assert code == 0
    assert cells(out, "2", "uni_dl") == ["91", "–", "1"]
    assert out.count("Failed:") == 3
    assert "Failed: epochs=1,model=uni_ndl: ValueError: <b>no uni_ndl</b>" in out
    assert set(pd.read_csv(tmp_path / "study" / "sweep.csv")["point"]) == {"epochs=2,model=uni_dl"}


def test_where_nothing_is_done_the_logs_are_named(invoke, toy_models):
    with pytest.raises(UserError, match=r"No training of the sweep is done; the logs are in study/logs\."):
        invoke("sweep", *GRID)


def test_metrics_can_be_chosen(invoke, prepare):
    prepare("epochs=1", time_in_goal_1cm=[3.0, 5.0], effort=[0.25, 0.25], task="hold_position")
    options = ("--grid", "epochs=1", "--set", "task=hold_position", "--out", "study")
    _, out = invoke("sweep", *options, "--metric", "time_in_goal_1cm", "--metric", "effort")
    assert cells(out, "epochs") == ["Time within 1 cm (steps)", "Effort (s)", "seeds"]
    assert cells(out, "1") == ["4.0 ± 1.4", "0.25 ± 0", "2"]


def test_tasks_are_each_shown_by_their_own_metric(invoke, prepare):
    prepare("task=random_reach", goal_completion_5cm=[90.0], final_error=[2.0])
    prepare("task=hold_position", time_in_goal_5cm=[40.0], final_error=[3.0], task="hold_position")
    _, out = invoke("sweep", "--grid", "task=random_reach,hold_position", "--out", "study")
    assert cells(out, "random_reach") == ["90", "–", "2", "1"]
    assert cells(out, "hold_position") == ["–", "40", "3", "1"]


def test_a_sweep_over_first_seeds_shows_every_seed(invoke, prepare):
    prepare("seed=0", goal_completion_5cm=[90.0, 92.0], final_error=[2.0, 2.0])
    _, out = invoke("sweep", "--grid", "seed=0", "--set", "seeds=2", "--out", "study")
    assert cells(out, "0") == ["91.0 ± 1.4", "2 ± 0", "2"]


def test_seeds_can_be_named(invoke, monkeypatch):
    asked = []
    monkeypatch.setattr(command, "run_local", lambda jobs, *_: asked.extend(jobs) or [])
    with pytest.raises(UserError, match="No training of the sweep is done"):
        invoke("sweep", "--grid", "epochs=1,2", "--seeds", "100..104", "--set", "bptt.patience=2")
    configs = [job.arguments["config"] for job in asked]
    assert [(c["epochs"], c["seed"], c["seeds"], c["bptt"]["patience"]) for c in configs] == [
        (1, 100, 5, 2),
        (2, 100, 5, 2),
    ]


def test_interrupted_it_says_so(invoke, monkeypatch, tmp_path):
    def stop(jobs, *_):
        return [JobOutcome(job, JobState.INTERRUPTED) for job in jobs]

    monkeypatch.setattr(command, "run_local", stop)
    code, out = invoke("sweep", *GRID)
    assert code == INTERRUPTED_EXIT
    assert "Stopped with 0 of 4 jobs done; called again, it goes on." in out


def test_what_cannot_be_done_is_refused_before_anything_is_written(invoke, tmp_path):
    for options, message in (
        (["--grid", "epochs"], "--grid takes key=value,value"),
        (["--grid", "epochs=1,1"], "more than once"),
        (["--grid", "epochs=1", "--trials", 0], "--trials must be at least 1"),
        (["--grid", "epochs=1", "--jobs", 0], "--jobs must be at least 1"),
        (["--grid", "epochs=1", "--metric", "beauty"], "Unknown metric 'beauty'"),
        (["--grid", "epochs=1", "--metric", "time_in_goal_4cm"], "No training of the sweep is measured by time_in_g"),
        (["--grid", "epochs=1", "--metric", "hold_speed"], "No training of the sweep is measured by hold_speed"),
        (["--grid", "units=5"], "Unknown setting 'units' among the settings; it is network.units."),
        (["--grid", "seeds=2,3", "--seeds", 2], "leave seeds out of --set and --grid"),
        (["--grid", "epochs=1", "--set", "seeds=2", "--seeds", 2], "leave seeds out of --set and --grid"),
        (["--grid", "seed=0,100", "--seeds", "0..4"], "names the first seed, and so does seed in --set or --grid"),
    ):
        with pytest.raises(UserError, match=message):
            invoke("sweep", *options)
    assert not list(tmp_path.iterdir())
