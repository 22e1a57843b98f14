"""`bilateral-rl reproduce`, with made-up results in the place of trainings; a real one takes a minute and is slow."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest
import yaml
from made_up_results import make_results
from one_arm_tasks import ONE_ARM_TASKS

from bilateral_rl.api import jobs as command
from bilateral_rl.commands.jobs import INTERRUPTED_EXIT
from bilateral_rl.commands.reproduce import by_spring
from bilateral_rl.config.resolve import resolve
from bilateral_rl.figures.style import new_figure
from bilateral_rl.io.errors import UserError
from bilateral_rl.study import local, reproduction
from bilateral_rl.study.drawing import Drawing
from bilateral_rl.study.jobs import JobOutcome, JobState
from bilateral_rl.study.plan import Study

QUICK = ("reproduce", "--quick", "--jobs", 4, "--out", "study")


@pytest.fixture
def prepared(tmp_path, toy_models, monkeypatch):
    """Results of every training that bear out the paper, and one small figure in the place of all that is shown."""
    for protocol in ("output", "everything"):
        results = make_results(protocol=protocol)
        results["metric"] = results["metric"].replace("time_in_goal_5cm", "time_in_goal_1cm")
        for (task, model, followed), rows in results.groupby(["task", "model", "protocol"]):
            path = tmp_path / "prepared" / "base" / task / model / f"{followed}.csv"
            path.parent.mkdir(parents=True, exist_ok=True)
            rows.to_csv(path, index=False)
    figure = Drawing("models_random_reach", "Models.", new_figure(1.0))
    monkeypatch.setattr(reproduction, "draw_study", lambda *_: iter([figure]))
    monkeypatch.setattr(reproduction, "study_tables", lambda *_: iter([]))
    return tmp_path / "prepared"


def test_a_training_that_fails_stops_nothing_and_is_tried_again(invoke, prepared, tmp_path, monkeypatch):
    missing = prepared / "base" / "hold_position" / "uni_ndl" / "none.csv"
    kept = missing.rename(prepared / "kept.csv")
    code, out = invoke(*QUICK)
    assert code == 0
    assert "14 trainings, of 42 networks, into study" in out
    assert "Failed: hold_position/uni_ndl: ValueError: <b>no uni_ndl</b> & nothing else" in out
    assert re.search(r"C3 .*undecided", out)
    assert re.search(r"C1 .* supported", out)
    assert "Report: study/report.html" in out
    page = (tmp_path / "study" / "report.html").read_text()
    assert "Preview: 3 seeds" in page
    assert "No verdict here is a result" in out
    assert "&lt;b&gt;no uni_ndl&lt;/b&gt; &amp; nothing else" in page
    assert "&lt;script&gt;alert(&#39;uni_ndl&#39;)" in page  # of its log
    assert "<script" not in page

    kept.rename(missing)
    logs = {path: path.read_bytes() for path in (tmp_path / "study" / "logs").rglob("*.log")}
    code, out = invoke(*QUICK)
    assert code == 0
    assert "13 of 14 jobs were done before." in out
    assert "text: Of 14 claims: 14 supported" in out
    assert "everything: Of 14 claims: 14 supported" in out
    grown = [path for path, before in logs.items() if path.read_bytes() != before]
    assert grown == [tmp_path / "study" / "logs" / "hold_position" / "uni_ndl.log"]

    monkeypatch.setattr(local, "JobProcess", None)  # nothing is left to start
    (tmp_path / "study" / "report.html").unlink()
    code, out = invoke(*QUICK)
    assert code == 0
    assert "14 of 14 jobs were done before." in out
    assert (tmp_path / "study" / "report.html").is_file()


def test_with_more_readings_it_makes_what_is_missing(invoke, prepared, tmp_path):
    _, out = invoke(*QUICK, "--readings", "text")
    assert "Left to do: about" in out
    assert re.search(r"base +│ 42 +│ 42 +│ none, output +│ 22 of 22 ", out)
    made = {path: path.stat().st_mtime_ns for path in (tmp_path / "study" / "results").rglob("*.csv")}
    assert {path.name for path in made} == {"none.csv", "output.csv"}
    _, out = invoke(*QUICK, "--readings", "everything", "--readings", "text-speed")
    assert re.search(r"base +│ 42 +│ 24 +│ none, everything, output +│ 8 of 30 ", out)
    assert "6 of 14 jobs were done before." in out  # of unilateral networks
    assert {path: path.stat().st_mtime_ns for path in made} == made
    assert re.search(r"C4 .*supported +│ undecided", out)  # the speed of lesioned networks was not made up
    assert set(pd.read_csv(tmp_path / "study" / "claims.csv")["reading"]) == {"everything", "text-speed"}


def test_springs_stand_behind_their_protocol_where_a_line_can_break():
    names = ["none-spring-50", "none-spring-0", "everything-lr-0.001-spring-50", "output"]
    assert by_spring(names) == ["none (spring 50 and 0 N/m)", "everything-lr-0.001 (spring 50 N/m)", "output"]


def test_of_many_readings_the_verdicts_are_counted(invoke, prepared):
    readings = ("text", "everything", "text-speed", "everything-speed")
    _, out = invoke(*QUICK, *(word for name in readings for word in ("--readings", name)))
    assert re.search(r"C1 .*│ 4 +│ 0 +│ 0 ", out)
    assert re.search(r"C4 .*│ 2 +│ 0 +│ 2 ", out)


def test_a_file_can_be_a_reading(invoke, prepared, tmp_path):
    (tmp_path / "mine.yaml").write_text("{anchor: everything, why: Why not., source: Nobody.}")
    _, out = invoke(*QUICK, "--readings", "mine.yaml")
    assert "mine: Of 14 claims: 14 supported" in out


@pytest.fixture
def outcomes(monkeypatch):
    """Jobs are not done; they end as ``ends`` says, by name, and otherwise well. What was asked for is kept."""

    class Outcomes:
        def __init__(self):
            self.ends, self.calls = {}, []

        def __call__(self, jobs, folder, where, *_):
            self.calls.append((jobs, folder, where))
            return [JobOutcome(job, *self.ends.get(job.name, (JobState.DONE,))) for job in jobs]

    made = Outcomes()
    monkeypatch.setattr(command, "run_local", made)
    monkeypatch.setattr("bilateral_rl.study.ray_cluster.run_on_ray", made)
    return made


@pytest.mark.parametrize(
    ("options", "name", "first", "seeds"),
    [
        ([], "reproduce-bptt-paper", 0, 10),
        (["--quick", "--profile", "released"], "reproduce-bptt-released-quick", 0, 3),
        (["--quick", "--seeds", 5], "reproduce-bptt-paper-quick", 0, 5),
        (["--algo", "ppo"], "reproduce-ppo-paper", 0, 10),
        (["--algo", "sac", "--models", "bi_ns", "--models", "cc_s"], "reproduce-sac-paper-bi_ns-cc_s", 0, 10),
        (["--seeds", "100..129"], "reproduce-bptt-paper-seeds-100-129", 100, 30),
        (["--seeds", "0..4"], "reproduce-bptt-paper", 0, 5),
    ],
)
def test_a_study_goes_to_a_folder_of_its_own(invoke, outcomes, tmp_path, options, name, first, seeds):
    code, out = invoke("reproduce", *options)
    assert code == 0
    folder = tmp_path / "runs" / name
    study = yaml.safe_load((folder / "study.yaml").read_text())
    assert (study["first_seed"], study["seeds"]) == (first, seeds)
    jobs = outcomes.calls[0][0]
    trained = {seed for job in jobs for seed in resolve(None, None, [job.arguments["config"]]).all_seeds}
    assert trained == set(range(first, first + seeds))
    assert f"Report: runs/{name}/report.html" in out
    assert (folder / "report.html").is_file()
    assert "Of 14 claims: 0 supported, 0 not supported, 14 undecided." in out
    assert "No claim can be judged: models that they are about were left out, or have no results." in out


def test_models_can_be_chosen(invoke, outcomes):
    invoke("reproduce", "--models", "bi_s", "--models", "bi_ns", "--models", "bi_s", "--out", "study")
    ((jobs, _, _),) = outcomes.calls
    assert sorted(job.name for job in jobs) == [
        f"{task}/{m}" for task in sorted(ONE_ARM_TASKS) for m in ("bi_ns", "bi_s")
    ]
    with pytest.raises(UserError, match=r"holds a study with models = \['bi_ns', 'bi_s'\], not"):
        invoke("reproduce", "--out", "study")


def test_so_many_at_a_time_share_the_processors(invoke, outcomes, monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(6)))
    invoke("reproduce", "--jobs", 2)
    ((jobs, _, at_once),) = outcomes.calls
    assert at_once == 2
    assert {job.threads for job in jobs} == {3}


def test_jobs_are_handed_to_a_cluster(invoke, outcomes):
    invoke("reproduce", "--ray", "head:6379", "--out", "study")
    ((jobs, folder, address),) = outcomes.calls
    assert (len(jobs), folder, address) == (14, Path("study"), "head:6379")


def test_interrupted_it_concludes_nothing(invoke, outcomes, tmp_path):
    outcomes.ends["random_reach/cc_s"] = (JobState.INTERRUPTED,)
    code, out = invoke("reproduce", "--out", "study")
    assert code == INTERRUPTED_EXIT
    assert "Stopped with 13 of 14 jobs done; called again, it goes on." in out
    assert {path.name for path in (tmp_path / "study").iterdir()} == {"study.yaml"}


def test_errors_are_printed_as_they_are(invoke, outcomes):
    outcomes.ends["random_reach/cc_s"] = (JobState.FAILED, 1.0, "KeyError: '[/bold] [red]'")
    _, out = invoke("reproduce", "--out", "study")
    assert "Failed: random_reach/cc_s: KeyError: '[/bold] [red]'" in out


def test_what_cannot_be_done_is_refused_before_anything_is_written(invoke, outcomes, tmp_path):
    for options, message in (
        (["--seeds", 0], "--seeds must be at least 1"),
        (["--seeds", "0..4", "--set", "seed=7"], r"--seeds 0\.\.4 names the first seed, and so does --set seed"),
        (["--jobs", 0], "--jobs must be at least 1"),
        (["--algo", "dqn"], "Unknown algorithm"),
        (["--readings", "mine"], "Unknown reading 'mine'"),
        (["--readings", "nothing.yaml"], "Cannot read the configuration nothing.yaml"),
        (["--readings", "text-continued", "--algo", "ppo"], "by ppo"),
        (["--readings", "text-penalty-none", "--profile", "released"], "so does --profile released"),
        (["--readings", "text-released-lesions", "--profile", "released"], "so does --profile released"),
        (["--profile", "mine"], "Unknown profile"),
        (["--models", "mine"], "Unknown model 'mine'"),
        (["--set", "model=cc_s"], "--set cannot change model"),
        (["--set", "epochs=none"], "epochs must be a whole number"),
        (["--set", "epochs"], "--set takes key=value"),
    ):
        with pytest.raises(UserError, match=message):
            invoke("reproduce", *options)
    assert not list(tmp_path.iterdir())
    assert not outcomes.calls


def test_of_all_readings_those_that_do_not_fit_are_left_out_aloud(invoke, outcomes):
    _, out = invoke("reproduce", "--readings", "all", "--profile", "released", "--out", "study")
    assert "8 readings are left out, as they ask for what --algo bptt and --profile released leave no room for" in out
    assert "text-penalty-none" in out
    assert "everything-released-lesions" in out


def test_a_cluster_that_is_refused_leaves_no_folder(invoke, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(UserError, match="Ray is not installed"):
        invoke("reproduce", "--ray", "local", "--out", "new/study")
    assert not list(tmp_path.iterdir())


def test_a_folder_of_another_study_is_refused(invoke, outcomes):
    invoke("reproduce", "--out", "study", "--set", "epochs=2")
    with pytest.raises(UserError, match=r"study holds a study with overrides = \{'epochs': 2\}, not \{\}"):
        invoke("reproduce", "--out", "study")
    assert len(outcomes.calls) == 1


@pytest.mark.slow
def test_the_whole_interrupted_and_gone_on_with(tmp_path):
    tiny = ["epochs=1", "bptt.trials=64", "bptt.validation_trials=8", "trial.trial_length=10"]
    arguments = ["reproduce", "--quick", "--seeds", "2", "--out", str(tmp_path / "study")]
    words = [
        sys.executable,
        "-m",
        "bilateral_rl.commands.app",
        *arguments,
        *(w for item in tiny for w in ("--set", item)),
    ]
    process = subprocess.Popen(words, text=True, stdout=subprocess.PIPE)
    while not list((tmp_path / "study").rglob("everything.csv")) and process.poll() is None:
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=120)
    assert process.returncode == INTERRUPTED_EXIT
    before = re.search(r"Stopped with (\d+) of 14 jobs done", out)
    assert 0 < int(before[1]) < 14
    out = subprocess.run(words, text=True, capture_output=True, check=True).stdout
    assert f"{before[1]} of 14 jobs were done before." in out
    assert "Failed" not in out
    results = pd.read_csv(tmp_path / "study" / "results.csv")
    assert len(results.groupby(["task", "model", "seed"])) == 14 * 2
    assert set(results.loc[results["model"] == "cc_s", "lesion"]) > {"intact", "callosum", "deep_dominant"}
    page = (tmp_path / "study" / "report.html").read_text()
    assert "14 of 14 trainings are done." in page
    figures = list((tmp_path / "study" / "figures").glob("*.png"))
    assert page.count("data:image/png;base64,") == len(figures) > 30
    runs = [config.task for config in Study(seeds=2).configs()]
    assert len(list((tmp_path / "study").glob("runs/*/*/config.yaml"))) == len(runs)
