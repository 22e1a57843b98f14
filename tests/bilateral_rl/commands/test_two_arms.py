"""Commands on a run of two arms: what they print and write by hand and role."""

import itertools
import json
import re
import shlex
import shutil

import pandas as pd
import pytest
from rl_runs import curves, small_rl

from bilateral_rl.api.run import load
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.study import lesion_folder
from bilateral_rl.training.lesion_probe import LesionProbe
from bilateral_rl.training.probe_table import PROBE, read_probe
from bilateral_rl.training.run import train
from bilateral_rl.video import files
from bilateral_rl.vocabulary import SIDES

HANDS = [(hand, role) for hand in SIDES for role in ("reach", "hold")]
OF_HANDS = [
    *(f"{name}_of_{hand}_reach" for hand in SIDES for name in ("goal_completion_percent", "final_error_cm")),
    *(f"{name}_of_{hand}_hold" for hand in SIDES for name in ("time_in_goal_steps", "final_error_cm")),
]


@pytest.fixture(scope="module")
def _trained(tmp_path_factory):
    config = small_rl("ppo", "reach_and_hold", timesteps=800, evaluation={"lesion_probe_every": 800})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(LesionProbe, "_draw", lambda *_: None)  # which takes longer than the training
        return train(config, tmp_path_factory.mktemp("two_arms") / "runs").folder


@pytest.fixture
def run(_trained, tmp_path):
    """A finished run of a cc_s that has hardly learned anything, at runs/reach_and_hold/cc_s-ppo-1."""
    path = tmp_path / "runs" / "reach_and_hold" / _trained.path.name
    shutil.copytree(_trained.path, path)
    return RunFolder(path)


def rows(out):
    """The cells of all tables, without their heads."""
    return [[cell.strip() for cell in line[1:-1].split("│")] for line in out.splitlines() if line.startswith("│")]


def test_evaluate_says_and_writes_what_each_hand_did(invoke, run, tmp_path):
    by_trial, measures = tmp_path / "trials.csv", tmp_path / "measures.json"
    _, out = invoke("evaluate", run.path, "--trials", 8, "--csv", by_trial, "--json", measures)
    of_hands = [row for row in rows(out) if len(row) == 5 and row[1] in ("reach", "hold")]
    assert [tuple(row[:2]) for row in of_hands] == [(hand.replace("_", "-"), role) for hand, role in HANDS]
    assert [row[2] == "–" for row in of_hands] == [False, True] * 2  # a hold has no goal to complete
    assert [row[0] for row in rows(out) if row[0] == "0" and row[1] == "dominant"] == ["0"]  # what each side supplies
    table = pd.read_csv(by_trial)
    assert len(table) == 16
    assert set(table.groupby("trial")["role"].agg(tuple)) == {("hold", "reach"), ("reach", "hold")}
    assert (table["start_x_m"].where(table["hand"] == SIDES[0], -table["start_x_m"]) > 0.05).all()
    assert table["max_deviation_m"].notna().eq(table["role"] == "reach").all()
    assert table["drift_m"].notna().eq(table["role"] == "hold").all()
    written = json.loads(measures.read_text())["by_hand"]
    assert {(row["hand"], row["role"]) for row in written} == {*HANDS}
    assert {row["threshold_m"] for row in written} == {0.02, 0.03, 0.05}


def test_trials_are_taken_apart_by_hand_and_role(invoke, run, tmp_path):
    path = tmp_path / "parts.csv"
    _, out = invoke("evaluate", run.path, "--trials", 8, "--by", "hand,role", "--csv", path)
    parts = pd.read_csv(path)
    assert list(zip(parts["hand"], parts["role"], strict=True)) == HANDS
    assert (parts["trials"] == 4).all()
    assert parts["perpendicular_deviation_until_2cm"].isna().tolist() == [False, True] * 2
    assert parts["hold_drift"].isna().tolist() == [True, False] * 2
    assert re.search(r"non-dominant │ hold  │ +4 │", out)
    assert {"reaches", "straight", "error"} <= set(
        re.findall(r"\w+", out)
    )  # of headings, none of which breaks within a word
    with pytest.raises(UserError, match="must be even, got 7"):
        invoke("evaluate", run.path, "--trials", 7)


def test_another_task_of_two_arms_is_tested_with_a_lesion(invoke, run):
    _, out = invoke("evaluate", run.path, "--trials", 8, "--task", "two_holds", "--set", "trial.max_load=5",
                    "--lesion", "deep_dominant", "--by", "role")  # fmt: skip
    assert "two_holds" in out
    assert "100.0 %" not in out.split("What each side")[0]  # a hold, which starts in its goal, completes none
    assert [row[0] for row in rows(out) if row[1] == "16"] == ["hold"]


def test_lesions_are_told_of_each_hand_and_its_side_of_the_lesion(invoke, run, monkeypatch):
    notes = {}
    monkeypatch.setattr(
        lesion_folder, "save", lambda figure, path: notes.update({path.name: figure.get_supxlabel().replace("\n", " ")})
    )
    _, out = invoke("lesion", run.path, "--trials", 8, "--no-retrain", "--no-control", "--lesion", "deep_non_dominant")
    names = [row[0] for row in rows(out) if len(row) == 2]
    begin = names.index("Final error, hands that hold")
    assert names[begin + 2 : begin + 8] == [
        "intact", "dominant hand", "non-dominant hand",
        "deep non-dominant", "ipsilesional (dominant)", "contralesional (non-dominant)",
    ]  # fmt: skip
    assert "spring of 50 N/m between the hands" in out
    whose = {
        "lesions_goal_completion_5cm": "Values are means of both hands, where they reach.",
        "lesions_goal_completion_5cm_by_hand": "",
        "lesions_final_error": "Values are means of both hands, where they reach and where they hold.",
        "lesions_final_error_by_hand": "",
    }
    assert notes.keys() == whose.keys()
    for name, words in whose.items():
        assert words in notes[name]
        assert "A spring of 50 N/m ties the hands." in notes[name]
    _, out = invoke("compare", run.path, "--metric", "final_error_of_non_dominant_hold")
    assert "Final error, non-dominant hand that holds (cm)" in out


def test_lesions_with_another_spring_have_a_place_of_their_own(invoke, run, undrawn):
    few = ("--trials", 8, "--no-retrain", "--no-control", "--lesion", "deep_dominant")
    place = run.path.with_name(f"{run.path.name}-lesions")
    _, out = invoke("lesion", run.path, *few)
    tied = (place / "lesions.csv").read_bytes()
    differing = r"with other settings \(spring: the run's own there and 0 asked for\); choose another --out"
    with pytest.raises(UserError, match=differing):
        invoke("lesion", run.path, *few, "--spring", 0)
    assert (place / "lesions.csv").read_bytes() == tied
    (command,) = re.findall("without it: bilateral-rl (.*)", out)
    assert "Tested without a spring between the hands" in invoke(*shlex.split(command))[1]
    free = place.with_name(f"{place.name}-spring-0")
    assert json.loads((free / "settings.json").read_text())["spring"] == 0
    table = pd.read_csv(free / "lesions.csv")
    loaded = load(run.path)
    pd.testing.assert_frame_equal(
        table, loaded.lesion("deep_dominant", "none", spring=0, control=False, trials=8, progress=False)
    )
    tested = loaded.evaluate(8, lesion="deep_dominant", settings={"trial.two_arms.spring.stiffness": 0}, by="hand,role")
    for row in tested.to_dict("records"):
        name = f"final_error_of_{row['hand']}_{row['role']}"
        (value,) = table[(table["lesion"] == "deep_dominant") & (table["metric"] == name)]["value"]
        assert value == pytest.approx(row["final_error"])


def test_lesions_with_another_spring_are_compared_as_such_and_made_anew_with_it(invoke, run, undrawn):
    few = ("--trials", 8, "--no-retrain", "--no-control", "--lesion", "callosum")
    invoke("lesion", run.path, *few, "--spring", 12.5)
    assert "tests with a spring of 12.5 N/m between the hands" in invoke("compare", run.path)[1]
    weights = run.load_weights("final")
    run.save_weights("final", {name: -tensor for name, tensor in weights.items()})
    with pytest.raises(UserError, match=r"--spring 12\.5"):
        invoke("compare", run.path)


def test_evaluations_and_probes_are_logged_by_hand_and_role(run):
    logged, evaluations = curves(run), pd.read_csv(run.path / "evaluations.csv")
    table = read_probe(run.path / PROBE)
    for name in OF_HANDS:
        shown = [value for _, value in logged[f"evaluation/{name}"]]
        assert shown == pytest.approx(evaluations[name].tolist(), rel=1e-4)
        assert [value for _, value in logged[f"lesions_{name}/deep_dominant"]] == pytest.approx(
            table[(table["lesion"] == "deep_dominant") & (table["network"] == "trained")][name].tolist(), rel=1e-4
        )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("evaluate", "--task", "random_reach"), "learned to move two arms, and random_reach is a task of one arm"),
        (
            ("evaluate", "--task", "two_reaches", "--set", "trial.two_arms.roles=dominant_reaches"),
            r"trial\.two_arms\.roles has no effect on two_reaches, whose trials have roles of their own",
        ),
        (("lesion", "--retrain", "combination"), "weights that mix the sides, which are fixed in these networks"),
        (("lesion", "--spring", "-1"), "spring must be at least 0, got -1"),
        (("lesion", "--spring", "1e5"), "a spring of 100000 N/m .* makes the hands swing"),
        (("compare", "--metric", "final_error_of_dominant_rest"), "Unknown metric 'final_error_of_dominant_rest'"),
    ],
)
def test_what_two_arms_do_not_have_is_refused(invoke, run, arguments, message):
    command, *options = arguments
    with pytest.raises(UserError, match=message):
        invoke(command, run.path, *options)


def test_python_tells_of_hands_as_commands_do(run):
    loaded = load(run.path)
    parts = loaded.evaluate(8, by="hand")
    assert parts["hand"].tolist() == [*SIDES]
    trials = loaded.evaluate(8, by="trial").query("role == 'reach'").groupby("hand")
    expected = 100 * trials["max_deviation_m"].mean()
    assert parts["perpendicular_deviation_until_2cm"].tolist() == pytest.approx(expected[[*SIDES]].tolist())


def test_a_published_run_says_what_each_hand_is_judged_by(invoke, run, tmp_path):
    invoke("export", run.path, "--out", tmp_path / "shared", "--trials", 8)
    card = (tmp_path / "shared" / "README.md").read_text()
    for hand, words in itertools.product(SIDES, ("that reaches", "that holds")):
        assert card.count(f", {hand.replace('_', '-')} hand {words}") in (
            1,
            2,
        )  # the head has those with a value


def test_a_video_shows_as_many_trials_as_asked_for_and_is_broad(invoke, run, tmp_path, monkeypatch):
    films = []
    monkeypatch.setattr(files, "write", lambda path, film, *_: films.append(film))
    invoke("render", run.path, "--trials", 1, "--size", 320, "--out", tmp_path / "arms.gif")
    (film,) = films
    assert (film.trials, film.fps) == (1, 25)
    height, width = film.shape
    assert (height, width % 2) == (320, 0)
    assert width > 1.3 * height
    assert {one.role for one in film.performances[0].scene(0, 0, "").arms} == {"reach", "hold"}


def test_a_recording_has_both_arms_and_its_trials_come_in_pairs(invoke, run, tmp_path):
    path = tmp_path / "arms.csv"
    invoke("record", run.path, "--trials", 4, "--out", path)
    table = pd.read_csv(path)
    assert {"role_dominant", "hand_non_dominant_x_m", "spring_force_dominant_y_N"} <= {*table}
    assert (table["hand_dominant_x_m"][table["step"] == 0] > 0.04).all()
    other = tmp_path / "odd.csv"
    with pytest.raises(UserError, match="must be even, got 5"):
        invoke("record", run.path, "--trials", 5, "--out", other)
    assert not other.exists()
