"""What follows from results: verdicts, tables, figures and the report, whatever is missing."""

import pandas as pd
import pytest
from made_up_results import make_results

from bilateral_rl.analysis.goals import JUDGED_RADII
from bilateral_rl.config.resolve import resolve
from bilateral_rl.figures.style import new_figure
from bilateral_rl.io.errors import UserError
from bilateral_rl.study import reproduction
from bilateral_rl.study.calibration import CALIBRATED
from bilateral_rl.study.drawing import Drawing
from bilateral_rl.study.grid import Grid
from bilateral_rl.study.jobs import JobOutcome, JobState
from bilateral_rl.study.plan import Study
from bilateral_rl.study.readings import load_readings
from bilateral_rl.study.reproduction import conclude

TEXT = Grid(Study(), load_readings(["text"]))


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


def fill(folder, results, without=(), grid=TEXT):
    """The results of each job that is not among ``without``; how all jobs ended."""
    jobs = {job.name: job for job in grid.jobs(folder)}
    for table in grid.all_tables:
        config = table.training.config
        rows = results[(results["task"] == config.task) & (results["model"] == config.model)]
        if table.training.job_name not in without:
            path = folder / table.path
            path.parent.mkdir(parents=True, exist_ok=True)
            rows[rows["protocol"] == table.protocol.name].to_csv(path, index=False)
    failed = (JobState.FAILED, 5.0, "ValueError: it went wrong")
    return [JobOutcome(job, *(failed if name in without else (JobState.DONE,))) for name, job in jobs.items()]


def concluded(folder, *arguments, grid=TEXT):
    """The claims as the first reading judges them."""
    return conclude(grid, folder, *arguments)[0].claims


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def verdicts(claims):
    return {claim.number: claim.verdict for claim in claims}


def test_results_that_bear_out_the_paper_support_every_claim_and_all_is_written_the_same_twice(tmp_path, one_figure):
    said = []
    outcomes = fill(tmp_path, results_of_study())
    claims = concluded(tmp_path, outcomes, said.append)
    assert verdicts(claims) == {f"C{i}": "supported" for i in range(1, 15)}
    assert said == ["computing the claims", "drawing the figures", "writing the report"]
    results = pd.read_csv(tmp_path / "results.csv")
    expected = results_of_study()
    assert len(results) == len(expected)
    assert set(results["training"]) == {"base"}
    assert set(results["lesions_of"]) == {"paper"}
    assert results["value"].sum() == pytest.approx(expected["value"].sum())
    assert one_figure == [(len(expected), JUDGED_RADII, {"random_reach": {}, "hold_position": {}})]
    parts = pd.read_csv(tmp_path / "claims.csv")
    assert list(parts["claim"].unique()) == [claim.number for claim in claims]
    assert set(parts["reading"]) == {"text"}
    deciding = parts[parts["beside"].isna()]
    assert len(deciding) == sum(len(claim.components) for claim in claims)
    assert set(deciding["component_verdict"]) == {"supported"}
    assert set(parts.loc[parts["beside"].notna(), "claim"]) == {"C4", "C5", "C6", "C7", "C8"}
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
    assert names == {f"{kind}_{task}" for kind in kinds for task in JUDGED_RADII} | {
        "deep_minus_shallow",
        "penalty",
        "seeds",
    }
    answer = pd.read_csv(tmp_path / "answer.csv")
    assert list(answer["claim"]) == [claim.number for claim in claims]
    assert set(answer["verdict"]) == {"supported"}
    power = pd.read_csv(tmp_path / "power.csv")
    assert len(power) == len(deciding)
    assert power["seeds"].between(2, 50).all()
    page = (tmp_path / "report.html").read_text()
    assert "Of 14 claims: 14 supported, 0 not supported, 0 undecided." in page
    assert page.count("<img ") == 1
    written = contents(tmp_path)
    for outdated in ("figures/curve_C1.png", "figures/specialization_untrained.pdf", "tables/pairs_of_old.csv"):
        (tmp_path / outdated).write_bytes(b"of an earlier call")
    own = tmp_path / "figures" / "mine.png"
    own.write_bytes(b"a reader's own")
    concluded(tmp_path, outcomes)
    assert contents(tmp_path) == written | {own: b"a reader's own"}


def test_readings_judge_the_same_results_each_by_its_own_measure(tmp_path, no_tables):
    """C4 holds by speed and not by completion: the dominant side of Bi-S is faster, and completes fewer reaches."""
    readings = ("text", "text-speed", "everything", "text-hold-3cm")
    grid = Grid(Study(), load_readings(readings))
    sides = {("bi_s", "deep_non_dominant"): (60, 2.2), ("bi_s", "deep_dominant"): (90, 1.6)}
    sides |= {("bi_ns", lesion): (75, 1.9) for lesion in ("deep_non_dominant", "deep_dominant")}
    changes = {
        (model, name, lesion): value
        for (model, lesion), values in sides.items()
        for name, value in zip(("completion", "speed"), values, strict=True)
    }
    judgements = conclude(grid, tmp_path, fill(tmp_path, results_of_study(changes), grid=grid))
    assert [judgement.reading for judgement in judgements] == list(readings)
    c4 = {judgement.reading: verdicts(judgement.claims)["C4"] for judgement in judgements}
    assert c4 == {
        "text": "not supported",
        "text-speed": "supported",
        "everything": "undecided",  # nobody retrained everything
        "text-hold-3cm": "not supported",
    }
    c3 = {judgement.reading: verdicts(judgement.claims)["C3"] for judgement in judgements}
    assert c3 == dict.fromkeys(readings[:3], "supported") | {"text-hold-3cm": "undecided"}  # of 1 cm alone
    parts = pd.read_csv(tmp_path / "claims.csv")
    assert list(parts["reading"].unique()) == list(readings)
    shown = parts[(parts["claim"] == "C4") & parts["beside"].isna()].groupby("reading")["verdict"].first()
    assert shown.to_dict() == c4
    speed = judgements[1]
    assert (speed.anchor, speed.choices["measure of a reach"]) == ("text", "speed")


def test_tables_and_figures_show_the_protocols_of_the_anchors(tmp_path, one_figure, no_tables):
    readings = load_readings(["text", "everything", "text-3-epochs", "combination", "text-penalty-none"])
    grid = Grid(Study(), readings)
    rows = [make_results(protocol=reading.protocol.name) for reading in readings[:4]]
    results = pd.concat(rows).drop_duplicates()
    conclude(grid, tmp_path, fill(tmp_path, results, grid=grid))
    shown = results["protocol"].isin(["none", "output", "everything"])
    ((n_shown, _, _),) = one_figure
    assert n_shown == shown.sum() < len(results)


def test_verdicts_follow_the_results(tmp_path, no_tables):
    changes = {("uni_dl", "speed", "intact"): 2.0, ("bi_ns", "hold", "deep_dominant"): 22}
    claims = concluded(tmp_path, fill(tmp_path, results_of_study(changes)))
    against = {number for number, verdict in verdicts(claims).items() if verdict == "not supported"}
    assert {"C2", "C5"} <= against
    assert verdicts(claims)["C1"] == verdicts(claims)["C9"] == "supported"
    parts = pd.read_csv(tmp_path / "claims.csv")
    assert set(parts.loc[parts["verdict"] == "not supported", "claim"]) == against


def test_a_failed_training_leaves_its_claims_undecided_and_the_others_as_they_are(tmp_path, no_tables):
    outcomes = fill(tmp_path, results_of_study(), without={"hold_position/uni_ndl"})
    claims = {claim.number: claim for claim in concluded(tmp_path, outcomes)}
    assert claims["C3"].verdict == claims["C13"].verdict == "undecided"
    assert claims["C3"].note == "no results of uni_ndl in hold_position"
    assert {claims[number].verdict for number in ("C1", "C2", "C4", "C9", "C12")} == {"supported"}
    page = (tmp_path / "report.html").read_text()
    assert "13 of 14 trainings are done" in page
    assert "ValueError: it went wrong" in page
    assert "no results of uni_ndl in hold_position" in page


def test_of_some_models_only_claims_on_them_are_judged_and_the_others_are_named(tmp_path, no_tables):
    models = ("bi_ns", "bi_s")
    grid = Grid(Study(models=models), load_readings(["text"]))
    results = results_of_study()
    outcomes = fill(tmp_path, results[results["model"].isin(models)], grid=grid)
    assert len(outcomes) == 4
    claims = {claim.number: claim for claim in concluded(tmp_path, outcomes, grid=grid)}
    assert claims["C4"].verdict == claims["C5"].verdict == "supported"
    others = [number for number in claims if number not in ("C4", "C5")]
    assert all(claims[number].unjudged for number in others)
    page = (tmp_path / "report.html").read_text()
    assert f"{', '.join(others[:-1])} and C14 cannot be judged: models that they are about were left out" in page
    assert "2 of seven models (Bi-NS, Bi-S) on two tasks" in page


def test_the_penalty_of_the_study_stands_beside_that_of_train(tmp_path, no_tables, monkeypatch):
    monkeypatch.setitem(CALIBRATED, "td3", {"random_reach": 0.125, "hold_position": 0.0})
    train = {task: resolve("td3", task).td3.weight_penalty for task in JUDGED_RADII}
    grid = Grid(Study("td3", models=("uni_ndl",), seeds=1), load_readings(["text"]))
    conclude(grid, tmp_path, [])
    table = pd.read_csv(tmp_path / "tables" / "penalty.csv")
    assert table["this study"].tolist() == [0.125, 0.0]
    assert table["train"].tolist() == list(train.values())
    page = (tmp_path / "report.html").read_text()
    assert "This study has λ = 0.125 in random reach and λ = 0 in hold position; train has λ = " in page
    assert "C1, C2, C3 are no tests" in page


def test_where_every_training_failed_there_is_a_report_still(tmp_path):
    outcomes = fill(tmp_path, results_of_study(), without={job.name for job in TEXT.jobs(tmp_path)})
    claims = concluded(tmp_path, outcomes)
    assert set(verdicts(claims).values()) == {"undecided"}
    assert "0 of 14 trainings are done" in (tmp_path / "report.html").read_text()


def test_damaged_results_are_refused_with_what_to_do(tmp_path):
    outcomes = fill(tmp_path, results_of_study())
    (tmp_path / outcomes[4].job.result).write_text("")
    with pytest.raises(UserError, match="remove it and call the command again"):
        concluded(tmp_path, outcomes)
