"""What follows from results: verdicts, tables, figures and the report, whatever is missing."""

import pandas as pd
import pytest
from made_up_results import make_results

from bilateral_rl.analysis.goals import JUDGED_RADII
from bilateral_rl.figures.style import new_figure
from bilateral_rl.io.errors import UserError
from bilateral_rl.study import reproduction
from bilateral_rl.study.drawing import Drawing
from bilateral_rl.study.jobs import JobOutcome, JobState
from bilateral_rl.study.plan import Study
from bilateral_rl.study.reproduction import conclude

STUDY = Study()


@pytest.fixture(autouse=True)
def one_figure(monkeypatch):
    """In the place of all; what all are is the business of the drawings' own tests."""
    drawn = []

    def draw_study(results, radii, runs):
        drawn.append((len(results), dict(radii), runs))
        yield Drawing("speed_random_reach", "Random reach: speed.", new_figure(1.0))

    monkeypatch.setattr(reproduction, "draw_study", draw_study)
    return drawn


@pytest.fixture
def no_tables(monkeypatch):
    """They take longer than all else."""
    monkeypatch.setattr(reproduction, "study_tables", lambda *_: iter([]))


def results_of_study(changes=None):
    """Results that bear out every claim, but for the changes; the hold is judged at the study's radius."""
    results = make_results(changes)
    radius = f"{100 * JUDGED_RADII['hold_position']:g}cm"
    results["metric"] = results["metric"].replace("time_in_goal_5cm", f"time_in_goal_{radius}")
    return results


def fill(folder, results, without=()):
    """The results of each job that is not among ``without``; how all jobs ended."""
    outcomes = []
    for job in STUDY.jobs():
        if job.name in without:
            outcomes.append(JobOutcome(job, JobState.FAILED, 5.0, "ValueError: it went wrong"))
            continue
        task, _, model = job.name.partition("/")
        path = folder / job.result
        path.parent.mkdir(parents=True, exist_ok=True)
        results[(results["task"] == task) & (results["model"] == model)].to_csv(path, index=False)
        outcomes.append(JobOutcome(job, JobState.DONE))
    return outcomes


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def verdicts(claims):
    return {claim.number: claim.verdict for claim in claims}


def test_results_that_bear_out_the_paper_support_every_claim_and_all_is_written_the_same_twice(tmp_path, one_figure):
    said = []
    outcomes = fill(tmp_path, results_of_study())
    claims = conclude(STUDY, tmp_path, outcomes, said.append)
    assert verdicts(claims) == {f"C{i}": "supported" for i in range(1, 15)}
    assert said == ["computing the claims", "drawing the figures", "writing the report"]
    results = pd.read_csv(tmp_path / "results.csv")
    expected = results_of_study()
    assert len(results) == len(expected)
    assert results["value"].sum() == pytest.approx(expected["value"].sum())
    assert one_figure == [(len(expected), JUDGED_RADII, {"random_reach": {}, "hold_position": {}})]
    parts = pd.read_csv(tmp_path / "claims.csv")
    assert list(parts["claim"].unique()) == [claim.number for claim in claims]
    assert len(parts) == sum(len(claim.components) for claim in claims)
    assert set(parts["component_verdict"]) == {"supported"}
    first = claims[0].components[0]
    row = parts.iloc[0]
    assert (row["low"], row["estimate"], row["high"]) == pytest.approx(
        (first.estimate.low, first.estimate.value, first.estimate.high)
    )
    assert {path.name for path in (tmp_path / "figures").iterdir()} == {
        "speed_random_reach.png",
        "speed_random_reach.pdf",
    }
    names = {path.stem for path in (tmp_path / "tables").iterdir()}
    kinds = ("models", "tests", "pairs", "lesions", "specialization")
    assert names == {f"{kind}_{task}" for kind in kinds for task in JUDGED_RADII} | {"deep_minus_shallow"}
    page = (tmp_path / "report.html").read_text()
    assert "Of 14 claims: 14 supported, 0 not supported, 0 undecided." in page
    assert page.count("<img ") == 1
    written = contents(tmp_path)
    conclude(STUDY, tmp_path, outcomes)
    assert contents(tmp_path) == written


def test_verdicts_follow_the_results(tmp_path, no_tables):
    changes = {("uni_dl", "speed", "intact"): 2.0, ("bi_ns", "hold", "deep_dominant"): 22}
    claims = conclude(STUDY, tmp_path, fill(tmp_path, results_of_study(changes)))
    against = {number for number, verdict in verdicts(claims).items() if verdict == "not supported"}
    assert {"C2", "C5"} <= against
    assert verdicts(claims)["C1"] == verdicts(claims)["C9"] == "supported"
    parts = pd.read_csv(tmp_path / "claims.csv")
    assert set(parts.loc[parts["verdict"] == "not supported", "claim"]) == against


def test_a_failed_training_leaves_its_claims_undecided_and_the_others_as_they_are(tmp_path, no_tables):
    outcomes = fill(tmp_path, results_of_study(), without={"hold_position/uni_ndl"})
    claims = {claim.number: claim for claim in conclude(STUDY, tmp_path, outcomes)}
    assert claims["C3"].verdict == claims["C13"].verdict == "undecided"
    assert claims["C3"].note == "no results of uni_ndl in hold_position"
    assert {claims[number].verdict for number in ("C1", "C2", "C4", "C9", "C12")} == {"supported"}
    page = (tmp_path / "report.html").read_text()
    assert "13 of 14 trainings are done" in page
    assert "ValueError: it went wrong" in page
    assert "no results of uni_ndl in hold_position" in page


def test_where_every_training_failed_there_is_a_report_still(tmp_path):
    outcomes = fill(tmp_path, results_of_study(), without={job.name for job in STUDY.jobs()})
    claims = conclude(STUDY, tmp_path, outcomes)
    assert set(verdicts(claims).values()) == {"undecided"}
    assert "0 of 14 trainings are done" in (tmp_path / "report.html").read_text()


def test_damaged_results_are_refused_with_what_to_do(tmp_path):
    outcomes = fill(tmp_path, results_of_study())
    (tmp_path / outcomes[4].job.result).write_text("")
    with pytest.raises(UserError, match="remove it and call the command again"):
        conclude(STUDY, tmp_path, outcomes)
