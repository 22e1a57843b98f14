"""`bilateral-rl lesion`: what is printed, written and refused, and that the run stays as it is."""

import io
import itertools
import json
import re
import shutil
from types import SimpleNamespace

import pandas as pd
import pytest
from rich.console import Console
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from treatments import AS_TRAINED

from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.analysis.results import COLUMNS, NETWORKS, State, by_seed, read_results
from bilateral_rl.commands import lesion as command
from bilateral_rl.policies.lesions import LESIONS
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.study.lesioning import LesionSettings, LesionStudy

RUN = "runs/random_reach/cc_s-bptt-1"
PLACE = f"{RUN}-lesions"
METRICS = ["goal_completion_5cm", "final_error"]
SHALLOW_AND_DEEP = [name for name in LESIONS if "callosum" not in name]


def files(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def of_model(results, metric, lesion, protocol, network="trained"):
    return by_seed(results, metric, State("random_reach", "cc_s", lesion, protocol, network))


def scalars(place):
    """By tag, the values at each step, of all the events in a folder."""
    events = EventAccumulator(str(place))
    events.Reload()
    return {tag: {event.step: event.value for event in events.Scalars(tag)} for tag in events.Tags()["scalars"]}


def rows_of_table(out):
    """The printed rows: head, then for each metric its name and the states."""
    return [[cell.strip() for cell in line[1:-1].split("│")] for line in out.splitlines() if line.startswith("│")]


@pytest.fixture(scope="module")
def lesioned(_trained_bptt, tmp_path_factory):
    """What the bare command, but with few trials, did to a run of three seeds."""
    run = RunFolder(tmp_path_factory.mktemp("lesioned") / RUN)
    shutil.copytree(_trained_bptt.path, run.path)
    before, console = files(run.path), Console(file=io.StringIO(), width=80)
    options = {"lesions": None, "control": True, "profile": None, "spring": None}
    tests = {"trials": 8, "seed": 7, "weights": "final"}
    retraining = {"retrain": None, "no_retrain": False, "settings": {}}
    command.lesion(run=str(run.path), task=None, out=None, console=console, **retraining, **options, **tests)
    place = run.path.with_name("cc_s-bptt-1-lesions")
    return SimpleNamespace(run=run, before=before, out=console.file.getvalue(), place=place)


@pytest.fixture(scope="module")
def results(lesioned):
    return read_results(lesioned.place / "lesions.csv")


# What it leaves


def test_the_run_is_byte_identical_afterwards(lesioned):
    assert files(lesioned.run.path) == lesioned.before
    assert len(lesioned.before) > 5


def test_beside_the_run_lie_the_table_the_figures_and_the_events(lesioned):
    names = sorted(re.sub(r"(tfevents).*", r"\1", path.name) for path in lesioned.place.iterdir())
    figures = [f"lesions_{metric}.{kind}" for metric in METRICS for kind in ("pdf", "png")]
    assert names == sorted(["events.out.tfevents", "lesions.csv", "settings.json", *figures])
    asked = json.loads((lesioned.place / "settings.json").read_text())
    assert asked["weights"] == "final"
    assert asked["lesions"] is None
    assert sorted(path.name for path in lesioned.run.path.parent.iterdir()) == ["cc_s-bptt-1", "cc_s-bptt-1-lesions"]


def test_the_file_holds_the_rows_of_the_study(lesioned, results):
    expected = LesionStudy(lesioned.run, LesionSettings(("callosum",), trials=8, seed=7)).run()
    rows = results[results["lesion"].isin(["intact", "callosum"])].reset_index(drop=True)
    pd.testing.assert_frame_equal(rows, expected, check_exact=True)
    assert tuple(results.columns) == COLUMNS
    assert list(dict.fromkeys(results["lesion"])) == ["intact", *LESIONS]


def test_tensorboard_holds_the_means_over_the_seeds_by_epochs_of_retraining(lesioned, results):
    found = scalars(lesioned.place)
    assert len(found) == 8 * results["metric"].nunique() * 2 * 2
    for name, protocol, network in itertools.product(("intact", "callosum"), ("output", "everything"), NETWORKS):
        means = [of_model(results, "effort", name, of, network).mean() for of in ("none", protocol)]
        control = "/fresh" if network == "fresh" else ""
        tag = f"lesions_effort/{name}/{protocol}{control}"
        assert found[tag] == pytest.approx(dict(enumerate(means)), rel=1e-6)


# What it prints


def test_the_table_shows_mean_and_standard_deviation_of_every_state(lesioned, results):
    printed = rows_of_table(lesioned.out)
    labels = ["Goal completion within 5 cm (%)", "Final error (cm)"]
    for metric, label, (head, *states) in zip(METRICS, labels, (printed[:17], printed[17:34]), strict=True):
        assert head == [label, "", "", ""]
        assert [state[0] for state in states[::2]] == [
            *("intact", "shallow dominant", "shallow non-dominant", "deep dominant", "deep non-dominant"),
            *("callosum", "callosum, deep dominant", "callosum, deep non-dominant"),
        ]
        assert {state[0] for state in states[1::2]} == {"fresh network"}
        for (name, network), state in zip(itertools.product(("intact", *LESIONS), NETWORKS), states, strict=True):
            for cell, protocol in zip(state[1:], ("none", "output", "everything"), strict=True):
                values = of_model(results, metric, name, protocol, network)
                assert [float(part) for part in cell.split(" ± ")] == pytest.approx(
                    [values.mean(), values.std(ddof=1)], abs=0.051
                )
    assert re.search(r"without ┃ output layer ┃ +everything", lesioned.out)
    assert "mean ± standard deviation over 3 seeds" in lesioned.out


def test_the_sign_of_the_specialization_index(trained, call, undrawn, monkeypatch):
    """The dominant side works alone where the non-dominant one is lesioned."""

    def made_up(self, on_state):
        values = {"intact": 90.0, "deep_non_dominant": 60.0, "deep_dominant": 20.0}
        return pd.DataFrame(
            [("cc_s", "random_reach", "bptt", 0, lesion, *AS_TRAINED, metric, value)
             for lesion, value in values.items() for metric in METRICS],
            columns=list(COLUMNS),
        )  # fmt: skip

    monkeypatch.setattr(LesionStudy, "run", made_up)
    _, out, _ = call("lesion", RUN, "--no-retrain", "--lesion", "deep_dominant", "--lesion", "deep_non_dominant")
    assert "(above 0: the dominant side does more alone): without retraining: +0.500" in " ".join(out.split())


def test_nothing_is_wrapped_or_cut_at_80_columns(lesioned):
    table = [line for line in lesioned.out.splitlines() if line.startswith(("┃", "│", "┏"))]
    assert all(len(line) <= 80 for line in table)
    assert all(row[0] for row in rows_of_table(lesioned.out))
    assert "…" not in lesioned.out


def test_it_says_what_was_tested_and_where_the_results_are(lesioned):
    assert f"{lesioned.run.path} (final), 8 trials of seed 7" in lesioned.out
    assert f"Saved in {lesioned.place}: lesions.csv, figures and tensorboard." in lesioned.out


# Options


def test_flags_reach_the_study(call, trained, undrawn, tmp_path):
    flags = ["--lesion", "callosum_deep_dominant", "--lesion", "deep_dominant", "--profile", "released", "--no-control"]
    retrain = ["--retrain", "none", "--retrain", "combination", "--retrain-epochs", 2, "--retrain-learning-rate", 0.01]
    penalty = ["--retrain-penalty", "activity", "--retrain-penalty-coefficient", 0.5]
    more = ["--trials", 4, "--seed", 3, "--weights", "best", "--out", "elsewhere/x"]
    code, out, err = call("lesion", f"{RUN}:1", *flags, *retrain, *penalty, *more)
    assert (code, err) == (0, "")
    protocols = Protocol("none"), Protocol("combination", 2, 0.01, "activity", 0.5)
    settings = LesionSettings(("callosum_deep_dominant", "deep_dominant"), protocols, False, "released", 4, 3)
    expected = LesionStudy(trained, settings, 1, "best").run()
    pd.testing.assert_frame_equal(read_results(tmp_path / "elsewhere/x/lesions.csv"), expected, check_exact=True)
    assert expected["protocol"].iloc[-1] == "combination-2-epochs-lr-0.01-penalty-activity-0.5"
    assert "(best), 4 trials of seed 3" in out
    assert "Specialization" not in out
    assert "seeds" not in out
    assert not (tmp_path / PLACE).exists()


def test_the_optimizer_and_the_trials_of_the_training_go_on(call, trained, undrawn, tmp_path):
    flags = ["--retrain-optimizer", "continued", "--retrain-trials", "training", "--trials", 2, "--lesion", "callosum"]
    assert call("lesion", RUN, "--retrain", "output", *flags)[0] == 0
    results = read_results(tmp_path / PLACE / "lesions.csv")
    assert set(results["protocol"]) == {"output-continued-training-trials"}
    assert set(results.loc[results["network"] == "trained", "optimizer"]) == {"continued"}
    assert set(results["trials"]) == {"training"}


def test_without_retraining_nothing_is_said_of_it(call, trained, undrawn, tmp_path):
    code, out, err = call("lesion", RUN, "--no-retrain", "--trials", 4, "--lesion", "callosum")
    assert (code, err) == (0, "")
    assert {len(row) for row in rows_of_table(out)} == {2}
    assert "retrained" not in out
    results = read_results(tmp_path / PLACE / "lesions.csv")
    assert set(results["protocol"]) == {"none"}
    assert all(list(values) == [0] for values in scalars(tmp_path / PLACE).values())


def test_a_second_call_replaces_what_the_first_one_left_unless_the_settings_are_others(
    call, trained, undrawn, tmp_path
):
    command = ("lesion", RUN, "--no-retrain", "--trials", 4, "--lesion", "callosum")
    assert call(*command)[0] == 0
    (tmp_path / PLACE / "lesions_of_before.png").touch()
    assert call(*command)[0] == 0
    left = sorted(path.name for path in (tmp_path / PLACE).iterdir())
    assert len(left) == 3
    assert left[0].startswith("events.out.tfevents.")
    before = (tmp_path / PLACE / "lesions.csv").read_bytes()
    code, _, err = call(*command[:2], "--trials", 6, "--lesion", "deep_dominant")
    assert code == 2
    assert " ".join(err.split()).endswith(
        "other settings (lesions: callosum there and deep_dominant asked for; protocols: none there and none, output, "
        "everything asked for; trials: 4 there and 6 asked for); choose another --out, or remove it."
    )
    assert (tmp_path / PLACE / "lesions.csv").read_bytes() == before


def test_the_seeds_of_a_run_have_places_of_their_own(call, trained, undrawn, tmp_path):
    for run in (RUN, f"{RUN}:0", f"{RUN}:2"):
        assert call("lesion", run, "--no-retrain", "--trials", 2, "--lesion", "callosum")[0] == 0
    for place, seeds in ((PLACE, {0, 1, 2}), (f"{RUN}-seed-0-lesions", {0}), (f"{RUN}-seed-2-lesions", {2})):
        assert set(read_results(tmp_path / place / "lesions.csv")["seed"]) == seeds


def test_a_run_is_found_from_inside_it(call, trained, undrawn, tmp_path, monkeypatch):
    monkeypatch.chdir(trained.path)
    assert call("lesion", ".", "--no-retrain", "--trials", 2, "--lesion", "callosum")[0] == 0
    assert (tmp_path / PLACE / "lesions.csv").is_file()


def test_a_network_of_one_side_is_tested_intact_and_has_no_index(call, make_run, undrawn):
    run = make_run("uni_ndl", task="hold_position", seeds=2)
    code, out, err = call("lesion", run.path, "--trials", 2)
    assert (code, err) == (0, "")
    results = read_results(run.path.with_name("uni_ndl-bptt-1-lesions") / "lesions.csv")
    assert set(results["lesion"]) == {"intact"}
    assert "Time within 5 cm (steps)" in out
    assert "Specialization" not in out
    assert " ".join(out.split()).index("uni_ndl is one network and has no hemispheres to lesion") < out.index(
        "lesions.csv"
    )


def test_values_that_are_no_numbers_are_said(call, make_run, tmp_path):
    run = make_run(seeds=2, bptt={"learning_rate": 1e39})
    code, out, err = call("lesion", run.path, "--trials", 2, "--lesion", "callosum")
    assert (code, err) == (0, "")
    for row in rows_of_table(out):
        assert row[2] == ("" if row[1] == "" else "–")
    assert (run.path.with_name("cc_s-bptt-1-lesions") / "lesions_final_error.png").is_file()


# What is refused


def unchanged(call, tmp_path, *arguments):
    """The error of a call that must change nothing."""
    before = files(tmp_path)
    code, out, err = call("lesion", *arguments)
    assert (code, out) == (2, "")
    assert err.startswith("Error: ")
    assert len(err.strip().splitlines()) == 1
    assert files(tmp_path) == before
    return err


MISTAKES = [
    (["runs/none"], "no run runs/none"),
    ([f"{RUN}:3"], "has no seed 3; it has seeds 0 to 2"),
    ([RUN, "--lesion", "lobotomy"], "callosum_deep_non_dominant"),
    ([RUN, "--profile", "code"], "paper, released"),
    ([RUN, "--spring", "0"], "random_reach is a task of one arm and has no spring between two hands"),
    ([RUN, "--weights", "step_1"], "best, final"),
    ([RUN, "--trials", "0"], "--trials must be at least 1"),
    ([RUN, "--seed", "-1"], "--seed must be at least 0"),
    ([RUN, "--retrain", "all"], "choose from none, output, combination, everything"),
    ([RUN, "--no-retrain", "--retrain", "output"], "leave one of them out"),
    ([RUN, "--no-retrain", "--retrain-epochs", "2"], "--retrain-epochs says how to retrain, but nothing is retrained"),
    ([RUN, "--retrain-epochs", "0"], "--retrain-epochs: epochs must be at least 1, got 0"),
    ([RUN, "--out", RUN], "lies in the run"),
    ([RUN, "--out", f"{RUN}/lesions"], "lies in the run"),
    ([RUN, "--out", "runs"], "holds other things"),
    ([RUN, "--out", f"{RUN}/config.yaml"], "lies in the run"),
    ([RUN, "--out", "a_file"], "a_file: File exists. Choose another --out"),
    ([RUN, "--out", "/proc/nothing"], "Choose another --out"),
    ([RUN, "--out", "link"], "lies in the run"),
]


def test_a_mistake_is_one_clear_sentence_and_changes_nothing(call, trained, tmp_path):
    (tmp_path / "a_file").touch()
    (tmp_path / "link").symlink_to(trained.path / "weights")
    for arguments, says in MISTAKES:
        assert says in unchanged(call, tmp_path, *arguments), arguments
        assert not (tmp_path / PLACE).exists()
