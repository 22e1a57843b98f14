"""A run in Python: what it tells, its policies, and tests of them as tables."""

import json

import numpy as np
import pandas as pd
import pytest

import bilateral_rl as brl
from bilateral_rl.analysis.metrics import find_metric
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import LESIONS
from bilateral_rl.runs.policies import load_policies

FEW = {"trials": 6, "seed": 3}


def test_a_run_tells_what_it_is(loaded, bptt_run):
    assert (loaded.path, loaded.seeds, loaded.config) == (bptt_run.path, [0, 1, 2], bptt_run.config())
    assert (loaded.status["state"], loaded.status["epochs"]) == ("finished", 6)
    assert repr(loaded) == f"Run('{bptt_run.path}': cc_s learned random_reach by bptt, seeds 0 to 2, finished)"
    assert str(loaded) == loaded.name == str(bptt_run.path)
    assert loaded.lesions_folder.name == "cc_s-bptt-1-lesions"


def test_one_seed_can_be_named_in_every_way(loaded):
    one = brl.load(loaded.path, seed=2)
    assert one == brl.load(f"{loaded.path}:2") == brl.load(loaded, seed=np.int64(2)) == brl.load(one)
    assert (one.seeds, one.name) == ([2], f"{loaded.path}:2")
    assert one.lesions_folder.name == "cc_s-bptt-1-seed-2-lesions"


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (lambda run: brl.load(run.path.parent), "it has no config.yaml. .bilateral_rl.list_runs... shows those"),
        (lambda run: brl.load(3), "A run is named by its folder, such as runs/random_reach/cc_s-ppo-1, not by 3"),
        (lambda run: brl.load(run, seed=7), "has no seed 7; it has seeds 0 to 2"),
        (lambda run: run.policy(), "has seeds 0 to 2: say which one, as seed=0"),
        (lambda run: run.policy(seed=3), "has no seed 3"),
        (lambda run: brl.load(run, 1).policy(seed=2), ":1 has no seed 2; it has seed 1"),
        (lambda run: run.policy(0, lesion="lobotomy"), "Unknown lesion 'lobotomy'; choose from intact, "),
        (lambda run: run.policy(0, weights="first"), "the run's weights are: best, final"),
        (lambda run: run.evaluate(trials=0), "^`trials` must be at least 1, got 0"),
        (lambda run: run.evaluate(trials=2.5), "^`trials` must be a whole number, got 2.5"),
        (lambda run: run.evaluate(trials=True), "^`trials` must be a whole number, got True"),
        (lambda run: run.evaluate(seed=-1), "^`seed` must be at least 0, got -1"),
        (lambda run: run.evaluate(lesion=["callosum"]), "Unknown lesion"),
        (lambda run: run.evaluate(task="juggle"), "Unknown task 'juggle'"),
        (lambda run: run.evaluate(settings={"ppo.gamma": 1}), "ppo.gamma changes nothing in a test"),
        (lambda run: run.evaluate(settings="trial.load=axes"), "^`settings` takes settings by name"),
        (lambda run: run.record(lesion="lobotomy"), "Unknown lesion 'lobotomy'"),
        (lambda run: run.record(trials=0), "^`trials` must be at least 1"),
        (lambda run: run.record_to("trials.xls"), "trials.xls"),
        (lambda run: run.evaluate(by="network"), "`by` must be one of seed, trial, target"),
        (lambda run: run.lesion("lobotomy"), "cannot have the lesion 'lobotomy'; choose from intact, "),
        (lambda run: run.lesion(3), "^`lesions` takes a name or a list of names, not 3"),
        (lambda run: run.lesion(retrain="all"), "^Unknown `retrain` 'all'"),
        (lambda run: run.lesion(retrain_epochs=0), "^`retrain_epochs`: epochs must be at least 1"),
        (lambda run: run.lesion(out=run.path), "lies in the run, which stays as it is; choose another `out`"),
        (lambda run: run.lesion(out=3), "^`out` takes a path, not 3"),
        (lambda run: run.lesion(control="no"), "^`control` must be True or False, got 'no'"),
        (lambda run: run.lesion(progress="no"), "^`progress` must be True, False or a console of rich, got 'no'"),
        (lambda run: run.evaluate(deterministic="no"), "^`deterministic` must be True or False"),
        (lambda run: run.lesion(profile="code"), "Unknown profile 'code'"),
        (lambda run: brl.list_runs(out=None), "^`out` takes a path, not None"),
    ],
)
def test_a_slip_is_a_sentence_that_names_the_argument(loaded, wrong, says):
    with pytest.raises(UserError, match=says):
        wrong(loaded)


def test_a_policy_is_lesioned_for_good_and_a_copy_of_its_own(loaded):
    observation = np.full((4, 16), 0.5, np.float32)
    policy, intact = loaded.policy(seed=1, lesion="deep_dominant"), loaded.policy(seed=1)
    expected = load_policies(loaded.folder)[1]
    before = expected.predict(observation, deterministic=True)[0]
    np.testing.assert_array_equal(intact.predict(observation, deterministic=True)[0], before)
    with expected.motor_network.lesioned("deep_dominant"):
        after = expected.predict(observation, deterministic=True)[0]
    np.testing.assert_array_equal(policy.predict(observation, deterministic=True)[0], after)
    assert (before != after).any()
    assert policy.motor_network.lesion == LESIONS["deep_dominant"]
    assert brl.load(loaded, 1).policy().motor_network.lesion != policy.motor_network.lesion


def test_a_released_run_has_the_lesions_of_its_code(make_run):
    run = brl.load(make_run(profile="released").path)
    assert run.policy(lesion="callosum_deep_dominant").motor_network.lesion.input_of == "dominant"


def test_a_table_by_trial_and_its_means_by_seed(loaded):
    trials, means = (loaded.evaluate(**FEW, lesion="callosum", by=by) for by in ("trial", "seed"))
    assert len(trials) == 3 * 6
    assert set(trials["lesion"]) == set(means["lesion"]) == {"callosum"}
    assert sorted(means["threshold_m"].unique()) == [0.02, 0.03, 0.05]
    own = means[means["threshold_m"] == 0.05].set_index("seed")
    by_seed = trials.groupby("seed").mean(numeric_only=True)
    for of_trials, of_means, factor in (
        ("goal_completion", "goal_completion_percent", 100),
        ("final_error_m", "final_error_cm", 100),
        ("time_in_goal_steps", "time_in_goal_steps", 1),
        ("return_dominant", "return_dominant", 1),
    ):
        np.testing.assert_allclose(factor * by_seed[of_trials], own[of_means], rtol=1e-5)
    shares = own[["contribution_percent_dominant", "contribution_percent_non_dominant"]].sum(axis=1)
    np.testing.assert_allclose(shares, 100)


def test_what_is_tested_is_the_lesioned_network_in_the_trials_of_the_commands(loaded):
    policy, config = loaded.policy(2, lesion="shallow_dominant"), loaded.config
    record = Evaluator(config.task, config.trial, 6, 3).run(policy)
    row = brl.load(loaded, 2).evaluate(6, seed=3, lesion="shallow_dominant").query("threshold_m == 0.05")
    assert row["final_error_cm"].tolist() == [pytest.approx(100 * record.distance[:, -1].mean())]


def test_lesions_are_the_table_of_the_command_and_nothing_is_written_unasked(loaded, undrawn, call):
    given = {"lesions": "callosum", "retrain": ["none", "everything"], **FEW, "progress": False}
    results = loaded.lesion(**given)
    assert {path.name for path in loaded.path.parent.iterdir()} == {loaded.path.name}
    options = ["--lesion", "callosum", "--retrain", "none", "--retrain", "everything", "--trials", 6, "--seed", 3]
    assert call("lesion", loaded.path, *options)[0] == 0
    written = pd.read_csv(loaded.lesions_folder / "lesions.csv", keep_default_na=False, na_values=[""])
    pd.testing.assert_frame_equal(results, written, check_dtype=False)
    kept = loaded.lesion(**given, out=loaded.lesions_folder)  # the same study
    pd.testing.assert_frame_equal(results, kept)
    assert json.loads((loaded.lesions_folder / "settings.json").read_text())["trials"] == 6
    metric = find_metric("final_error")
    intact = results.query("metric == 'final_error' and lesion == 'intact' and network == 'trained'")
    evaluator = Evaluator(loaded.config.task, loaded.config.trial, 6, 3)
    assert intact.query("protocol == 'none'")["value"].tolist() == [
        metric.value(evaluator.run(policy)) for policy in load_policies(loaded.folder).values()
    ]


def test_runs_are_listed(loaded, run):
    out = loaded.path.parents[1]
    damaged = out / "random_reach" / "cc_s-ppo-2"
    damaged.mkdir()
    (damaged / "config.yaml").write_text("[")
    table = brl.list_runs(out).set_index("run")
    assert list(table.columns) == ["task", "model", "algo", "seeds", "state", "timesteps", "epochs"]
    assert table.loc[str(loaded.path)].fillna(-1).tolist() == ["random_reach", "cc_s", "bptt", 3, "finished", -1, 6]
    assert table.loc[str(run.path), ["algo", "timesteps"]].tolist() == ["ppo", 4000]
    assert table.loc[str(damaged), "state"] == "unreadable"
    assert brl.load(table.index[0]).path == loaded.path
    assert list(brl.list_runs(out / "nothing").columns) == ["run", *table.columns]
