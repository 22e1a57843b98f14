"""What each side supplies along trainings: logged, left out by old runs, and a sentence where a side is silent."""

import dataclasses
import shutil

import numpy as np
import pandas as pd
import pytest
import torch
from rl_runs import ALGORITHMS, curves, evaluations, small_rl
from supervised_runs import scalars, table, with_values

from bilateral_rl.analysis.modulation import TAGS_OF, SideModulation, side_modulation
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.config.resolve import resolve
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import load_policy
from bilateral_rl.training.run import resume, train
from bilateral_rl.training.side_by_side import SideBySideLearner
from bilateral_rl.training.silence import silence_notes
from bilateral_rl.vocabulary import SIDES

# Logs


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_every_evaluation_logs_what_each_side_supplies(whole_run, algo):
    folder = whole_run(algo)
    rows, shown, config = evaluations(folder), curves(folder), folder.config()
    record = Evaluator(config.task, config.trial, config.evaluation.trials, config.evaluation.seed).run(
        load_policy(folder)
    )
    expected = side_modulation(load_policy(folder).motor_network, record).measures()
    for name, tag in TAGS_OF[1].items():
        assert float(rows[-1][name]) == pytest.approx(expected[name], rel=1e-4)
        assert [step for step, _ in shown[tag]] == [int(row["timesteps"]) for row in rows]
        np.testing.assert_allclose([value for _, value in shown[tag]], [float(row[name]) for row in rows], rtol=1e-4)


@pytest.mark.usefixtures("no_pictures")
@pytest.mark.parametrize("algo", ["ppo", "bptt"])
def test_a_network_with_one_side_gets_none_of_it(tmp_path, small_bptt, algo):
    config = small_bptt(model="uni_dl") if algo == "bptt" else with_values(small_rl("ppo"), model="uni_dl")
    outcome = train(config, tmp_path)
    logs = [outcome.folder.path / ("epochs.csv" if algo == "bptt" else "evaluations.csv")]
    shown = scalars(outcome.folder, 0) if algo == "bptt" else curves(outcome.folder)
    assert not [name for name in (*pd.read_csv(logs[0]), *shown) if name.startswith(("contribution", "combination"))]
    assert outcome.notes == []


# Runs of versions that did not log it


def without_sides(folder):
    """Make the evaluations of a run what version 0.2.0 would have written."""
    path = folder.path / "evaluations.csv"
    pd.read_csv(path, dtype=str).drop(columns=list(TAGS_OF[1])).to_csv(path, index=False, lineterminator="\n")
    folder.save_resume(folder.load_resume() | {"file.evaluations.csv": torch.tensor(path.stat().st_size)})
    return folder


def test_seeds_of_which_some_are_old_have_one_table(tmp_path, whole_run):
    folder = RunFolder(tmp_path)
    for seed in (0, 1):
        child = RunFolder(shutil.copytree(whole_run("ppo").path, tmp_path / f"seed_{seed}"))
        if seed == 0:
            without_sides(child)
    SideBySideLearner(dataclasses.replace(whole_run("ppo").config(), seeds=2), folder).write_tables(folder)
    merged = pd.read_csv(tmp_path / "evaluations.csv").groupby("seed")
    assert merged.get_group(0)["contribution_dominant"].isna().all()
    assert merged.get_group(1)["contribution_dominant"].notna().all()


@pytest.mark.usefixtures("no_pictures")
def test_an_old_supervised_run_goes_on_with_the_bits_of_a_new_one(bptt_run, tmp_path, same_bits):
    old = RunFolder(shutil.copytree(bptt_run.path, tmp_path / "old"))
    state = old.load_resume()
    old.save_resume(state | {"history": state["history"][..., : -len(TAGS_OF[1])].contiguous()})
    longer = with_values(bptt_run.config(), epochs=8)
    for folder in (bptt_run, old):
        resume(folder, longer)
    for name in ("final", "best"):
        assert same_bits(old.load_weights(name), bptt_run.load_weights(name))
    for seed, rows in table(bptt_run).items():
        for row, of_old in zip(rows, table(old)[seed], strict=True):
            known = {name: value for name, value in row.items() if row["epoch"] > 6 or name not in TAGS_OF[1]}
            assert {name: value for name, value in of_old.items() if not np.isnan(value)} == known


# Silence


def modulation(dominant, non_dominant):
    return SideModulation({"dominant": dominant, "non_dominant": non_dominant}, {"dominant": 1.0, "non_dominant": 1.0})


WEIGHTS = {"dominant": 0.5, "non_dominant": 0.25}


@pytest.mark.parametrize(
    ("algo", "cure"),
    [("ppo", "a smaller ppo.weight_penalty than 0.003"), ("bptt", "a smaller bptt.penalty_coefficient than 0.003")],
)
def test_a_silent_side_is_a_sentence_that_says_how_silent_why_and_what_to_do(algo, cure):
    name = "penalty_coefficient" if algo == "bptt" else "weight_penalty"
    config = resolve(algo, None, [{algo: {name: 0.003}}])
    assert silence_notes(modulation(3.0, 1.0), WEIGHTS, config) == []
    (note,) = silence_notes(modulation(98.0, 2.0), WEIGHTS, config)
    assert "The non-dominant side is silent: it supplies 2.0 % of the commands' modulation." in note
    assert "combination/" in note
    assert cure in note
    (note,) = silence_notes(modulation(98.0, 0.0), WEIGHTS | {"non_dominant": 0.0}, config)
    assert "it does not move the commands, as its combination weight is 0." in note


def test_a_side_that_moves_neither_of_two_arms_is_silent_and_fixed_weights_are_not_looked_for():
    of_paths = {f"{arm}_arm/{side}": 1.0 for arm in SIDES for side in SIDES}
    weak = of_paths | {"dominant_arm/non_dominant": 0.01, "non_dominant_arm/non_dominant": 0.02}
    for trained, where in ((None, "contribution/ since when"), (True, "contribution/ and combination/ since when")):
        config = resolve("ppo", "two_reaches", [{"network": {"trained_combination": trained}}])
        assert silence_notes(SideModulation(of_paths, of_paths), of_paths, config) == []
        (note,) = silence_notes(SideModulation(weak, of_paths), of_paths, config)
        assert "it supplies at most 2.0 % of the modulation of either arm's commands" in note
        assert where in note


def test_a_smaller_penalty_is_no_advice_where_none_acts_on_the_side():
    (note,) = silence_notes(modulation(2.0, 98.0), WEIGHTS, resolve("ppo", None, []))
    assert "The dominant side is silent" in note
    assert "smaller" not in note
    (note,) = silence_notes(modulation(2.0, 98.0), WEIGHTS, resolve("ppo", None, [], model="bi_ns"))
    assert "smaller" in note
    none = resolve("ppo", None, [{"ppo": {"weight_penalty": 0.0}}])
    (note,) = silence_notes(modulation(98.0, 2.0), WEIGHTS, none)
    assert "smaller" not in note


@pytest.mark.usefixtures("no_pictures")
@pytest.mark.parametrize("algo", ["ppo", "td3", "bptt"])
def test_a_training_with_a_side_of_weight_0_ends_with_a_note(tmp_path, small_bptt, algo):
    """Its network begins so, and does not learn."""
    rate = {algo: {"learning_rate": 1e-12}}
    config = small_bptt(seeds=1, **rate) if algo == "bptt" else small_rl(algo, **rate)
    config = with_values(config, trial={"sensory_noise": 0.0})
    begun = train(config, tmp_path)
    assert begun.notes == []
    weights = begun.folder.load_weights("final")
    (name,) = (name for name in weights if name.endswith("combination_non_dominant") and "target" not in name)
    begun.folder.save_weights("final", weights | {name: torch.zeros_like(weights[name])})
    (note,) = train(with_values(config, init_from=str(begun.folder.path)), tmp_path).notes
    assert note.startswith("The non-dominant side is silent")


@pytest.mark.usefixtures("no_pictures")
def test_of_several_seeds_the_note_names_the_silent_one(bptt_run):
    state = bptt_run.load_resume()
    columns = list(table(bptt_run)[0][0])[2:]  # behind seed and epoch
    state["history"][..., [columns.index(f"contribution_{side}") for side in SIDES]] = 1.0
    state["history"][1, :, columns.index("contribution_dominant")] = 0.0
    bptt_run.save_resume(state)
    bptt_run.write_json("status.json", bptt_run.status() | {"state": "running"})  # killed at its end
    (note,) = resume(bptt_run, bptt_run.config()).notes
    assert note.startswith("Seed 1: The dominant side is silent: it does not move the commands.")
