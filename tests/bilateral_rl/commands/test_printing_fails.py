"""Output that is cut off, as by `| head -1`, loses nothing: commands write their files before they print."""

import json
import zipfile
from pathlib import Path

import pandas as pd
import pytest
from rich.console import Console
from stable_baselines3 import PPO
from treatments import AS_TRAINED

from bilateral_rl.analysis.results import COLUMNS
from bilateral_rl.api import jobs
from bilateral_rl.commands import app as cli
from bilateral_rl.envs import ArmVecEnv
from bilateral_rl.runs.folder import find_runs
from bilateral_rl.study import reproduction
from bilateral_rl.study.jobs import JobOutcome, JobState

RUN = "runs/random_reach/cc_s-bptt-1"
FEW = ("--trials", 4)


class CutOff(Console):
    """A console that prints so often, and then ends the program, as rich does where nobody reads."""

    def __init__(self, prints: int) -> None:
        super().__init__(width=80)
        self._left = prints

    def print(self, *objects, **options):
        self._left -= 1
        if self._left < 0:
            raise SystemExit(1)


@pytest.fixture
def cut_off(call, monkeypatch):
    """Calls a command whose output is cut off after so many prints."""

    def cut(*arguments, prints=0):
        monkeypatch.setattr(cli, "console", CutOff(prints))
        code, _, err = call(*arguments)
        assert (code, err) == (1, "")

    # `call` sets a console of its own, once
    return cut


def test_evaluate(cut_off, trained, tmp_path):
    cut_off("evaluate", RUN, *FEW, "--csv", "t.csv", "--json", "t.json")
    assert len(pd.read_csv(tmp_path / "t.csv")) == 3 * 4
    assert json.loads((tmp_path / "t.json").read_text())["trials"] == 4


def test_record(cut_off, trained, tmp_path):
    cut_off("record", RUN, "--trials", 1, "--out", "reach.csv")
    assert len(pd.read_csv(tmp_path / "reach.csv")) == 3 * 21


def test_compare_models(cut_off, trained, make_run, tmp_path):
    cut_off("compare", RUN, make_run("uni_b", seeds=2).path, *FEW, "--csv", "pairs.csv")
    assert len(pd.read_csv(tmp_path / "pairs.csv")) == 1


def test_lesion_and_compare_lesions(cut_off, trained, undrawn, tmp_path):
    cut_off("lesion", RUN, *FEW, "--no-retrain", "--lesion", "callosum")
    names = {path.name.split(".tfevents")[0] for path in (tmp_path / f"{RUN}-lesions").iterdir()}
    assert names == {"lesions.csv", "settings.json", "events.out"}
    cut_off("compare", RUN, "--csv", "pairs.csv")
    assert len(pd.read_csv(tmp_path / "pairs.csv")) == 1


def test_render(cut_off, trained, tmp_path):
    cut_off("render", RUN, "--trials", 1, "--size", 320, "--out", "video.gif")  # of several seeds the first: a note
    assert (tmp_path / "video.gif").stat().st_size > 10_000


def test_import(cut_off, tmp_path):
    PPO("CallosalPolicy", ArmVecEnv(2), n_steps=8, batch_size=16, device="cpu").save(tmp_path / "model.zip")
    assert zipfile.is_zipfile(tmp_path / "model.zip")
    cut_off("import", "model.zip", "--trust-pickle", "--task", "random_reach")
    (run,) = find_runs(tmp_path / "runs")
    assert run.weight_names() == ["final"]


@pytest.fixture
def done_jobs(monkeypatch):
    """All jobs are done as soon as they begin."""
    monkeypatch.setattr(jobs, "run_local", lambda jobs, *_: [JobOutcome(job, JobState.DONE, 1.0) for job in jobs])


def test_reproduce(cut_off, done_jobs, monkeypatch, tmp_path):
    monkeypatch.setattr(reproduction, "draw_study", lambda *_: iter([]))
    monkeypatch.setattr(reproduction, "study_tables", lambda *_: iter([]))
    cut_off("reproduce", "--quick", "--out", "study", prints=2)
    assert {"report.html", "results.csv", "claims.csv"} <= {path.name for path in (tmp_path / "study").iterdir()}


def test_sweep(cut_off, toy_models, tmp_path):
    path = Path(tmp_path, "study", "results", "epochs=1.csv")
    path.parent.mkdir(parents=True)
    row = ["cc_s", "random_reach", "bptt", 0, "intact", *AS_TRAINED, "final_error", 5.0]
    pd.DataFrame([row], columns=list(COLUMNS)).to_csv(path, index=False)
    (tmp_path / "study" / "study.yaml").write_text("{sweep: {epochs: ['1']}, algo: bptt, overrides: {}, trials: 1024}")
    cut_off("sweep", "--grid", "epochs=1", "--out", "study", prints=1)  # the one that is done was done before
    assert list(pd.read_csv(tmp_path / "study" / "sweep.csv")["value"]) == [5.0]
