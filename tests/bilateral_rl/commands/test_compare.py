"""`bilateral-rl compare`: which runs are one group, what is computed of them, printed, written and refused."""

import io
import itertools

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from treatments import AS_TRAINED, RETRAINED, treated

from bilateral_rl.analysis.comparison import compare, compare_lesions
from bilateral_rl.analysis.formats import f_statistic
from bilateral_rl.analysis.metrics import find_metric
from bilateral_rl.analysis.results import COLUMNS, State, read_results
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.runs.policies import load_policies

TRIALS = ["--trials", 4, "--seed", 3]
EFFORT = ["--metric", "effort"]


def values(run, metric="effort"):
    """The values of a run's seeds, computed by hand from the trials of ``TRIALS``."""
    config = run.config()
    evaluator = Evaluator(config.task, config.trial, 4, 3)
    return [find_metric(metric).value(evaluator.run(policy)) for policy in load_policies(run).values()]


def compared(call, tmp_path, *arguments):
    """What is printed, in one line and as it is, and the pairs of the file."""
    code, out, err = call("compare", *arguments, "--csv", tmp_path / "pairs.csv")
    assert (code, err) == (0, "")
    return " ".join(out.split()), out, pd.read_csv(tmp_path / "pairs.csv")


def assert_same_pairs(written, expected):
    expected = expected.reset_index(drop=True).astype({"note": object})
    pd.testing.assert_frame_equal(written.astype({"note": object}).fillna({"note": ""}), expected, check_dtype=False)


def groups(out):
    """Mean, standard deviation and seeds of each group in the first table."""
    first = out.split("└")[0]
    rows = [[cell.strip() for cell in line[1:-1].split("│")] for line in first.splitlines() if line.startswith("│")]
    return {name: (mean, sd, int(n)) for name, mean, sd, _, n, *_ in rows}


# Models


def test_groups_tests_and_pairs_are_those_of_the_seeds_values(call, make_run, tmp_path):
    models = ["uni_b", "bi_s", "cc_ns"]
    runs = [make_run(model, seeds=n) for model, n in zip(models, (5, 6, 5), strict=True)]
    text, out, pairs = compared(call, tmp_path, *[run.path for run in runs], *TRIALS, *EFFORT)
    rows = [
        (model, "random_reach", "bptt", seed, "intact", *AS_TRAINED, "effort", value)
        for model, run in zip(models, runs, strict=True)
        for seed, value in enumerate(values(run))
    ]
    expected = compare(pd.DataFrame(rows, columns=list(COLUMNS)), "effort", "random_reach")
    assert_same_pairs(pairs, expected.pairs.assign(metric="effort"))
    assert list(groups(out)) == models
    for model, (mean, sd, n) in groups(out).items():
        assert n == expected.groups.loc[model, "n"]
        assert float(mean) == pytest.approx(expected.groups.loc[model, "mean"], rel=0.05)
        assert float(sd) == pytest.approx(expected.groups.loc[model, "sd"], rel=0.1)
    assert f"one-way ANOVA: {f_statistic(expected.anova)}, p " in text
    assert f"Welch's ANOVA: {f_statistic(expected.welch)}, p " in text
    assert "Note" not in out
    assert text.startswith("random_reach: Effort (s)")
    assert "bootstrap over the seeds" in text


def test_nothing_is_cut_at_80_columns(call, make_run, tmp_path):
    runs = [make_run("uni_ndl", seeds=2), make_run("uni_ndl", seeds=2, seed=1)]
    _, out, _ = compared(call, tmp_path, *[run.path for run in runs], *TRIALS, *EFFORT, "--metric", "sparc")
    assert "…" not in out
    assert all(len(line) <= 80 for line in out.splitlines())
    rows = [line.split("│")[1].strip() for line in out.splitlines() if line.startswith("│")]
    assert rows == ["uni_ndl-bptt-1", "uni_ndl-bptt-2", "uni_ndl-bptt-1 −", "uni_ndl-bptt-2"] * 2


def test_by_default_models_are_compared_by_what_the_paper_judges_the_task_by(call, make_run, tmp_path):
    for task, metric in (("random_reach", "goal_completion_4.5cm"), ("hold_position", "time_in_goal_4.5cm")):
        runs = [make_run(m, task=task, seeds=2, trial={"threshold": 0.045}) for m in ("uni_b", "bi_s")]
        *_, pairs = compared(call, tmp_path, *[run.path for run in runs], *TRIALS)
        assert list(pairs["metric"]) == [metric]


def test_runs_of_one_model_are_seeds_of_one_group(call, make_run, tmp_path):
    first = [make_run("cc_s", "ppo", seed=seed) for seed in (4, 2, 9)]
    second = [make_run("uni_b", "ppo", seed=seed) for seed in (2, 4)]
    _, out, pairs = compared(call, tmp_path, *[run.path for run in (*first, *second)], *TRIALS, *EFFORT)
    assert {name: n for name, (*_, n) in groups(out).items()} == {"cc_s": 3, "uni_b": 2}
    samples = [np.concatenate([values(run) for run in runs]) for runs in (first, second)]
    assert pairs["difference"].tolist() == pytest.approx([samples[0].mean() - samples[1].mean()])
    assert pairs["p_tukey"].tolist() == pytest.approx([stats.f_oneway(*samples).pvalue], abs=1e-6)


def test_seeds_of_one_run_can_be_a_group(call, make_run, tmp_path):
    cc, uni = make_run("cc_s", seeds=4), make_run("uni_b", seeds=2)
    *_, pairs = compared(call, tmp_path, f"{cc.path}:1", f"{cc.path}:3", uni.path, *TRIALS, *EFFORT)
    expected = np.mean([values(cc)[1], values(cc)[3]]) - np.mean(values(uni))
    assert pairs["difference"].tolist() == pytest.approx([expected])
    assert list(pairs["first"]) == ["cc_s"]


def test_runs_that_share_a_seed_are_groups_of_their_own(call, make_run, tmp_path):
    runs = [make_run("cc_s", seeds=2), make_run("cc_s", seeds=2, seed=1), make_run("uni_b", seeds=2)]
    *_, pairs = compared(call, tmp_path, *[run.path for run in runs], *TRIALS, *EFFORT)
    names = ["cc_s-bptt-1", "cc_s-bptt-2", "uni_b"]
    assert list(zip(pairs["first"], pairs["second"], strict=True)) == list(itertools.combinations(names, 2))


@pytest.mark.parametrize("setting", [{"bptt": {"learning_rate": 0.01}}, {"network": {"units": 12}}])
def test_runs_that_differ_in_more_than_seeds_are_groups_of_their_own(call, make_run, tmp_path, setting):
    runs = [make_run("cc_s", seeds=2), make_run("cc_s", seeds=2, seed=2, **setting)]
    *_, pairs = compared(call, tmp_path, *[run.path for run in runs], *TRIALS, *EFFORT)
    assert (pairs["first"][0], pairs["second"][0]) == ("cc_s-bptt-1", "cc_s-bptt-2")


def test_algorithms_are_groups_of_their_own(call, make_run, tmp_path):
    runs = [make_run("cc_s", seeds=2), make_run("cc_s", "ppo", seed=5), make_run("cc_s", "ppo", seed=6)]
    *_, pairs = compared(call, tmp_path, *[run.path for run in runs], *TRIALS, *EFFORT)
    assert (pairs["first"][0], pairs["second"][0]) == ("cc_s (bptt)", "cc_s (ppo)")


def test_runs_of_one_name_in_two_folders_are_told_apart(call, make_run, tmp_path):
    runs = [make_run("cc_s", seeds=2, out=out) for out in ("a", "b")]
    *_, pairs = compared(call, tmp_path, *[run.path for run in runs], *TRIALS, *EFFORT)
    assert (pairs["first"][0], pairs["second"][0]) == tuple(str(run.path) for run in runs)


def test_few_seeds_are_said(call, make_run, tmp_path):
    runs = {n: make_run(model, seeds=n) for n, model in ((1, "uni_b"), (3, "bi_s"), (5, "cc_s"))}
    text, *_ = compared(call, tmp_path, runs[1].path, runs[3].path, *TRIALS, *EFFORT)
    assert "Note: uni_b: 1 seed: no test." in text
    assert "Note: bi_s: only 3 seeds." in text
    assert "hardly a chance" in text
    assert "one-way ANOVA: no test (1 of 2 groups" in text
    assert "nan" not in text
    text, *_ = compared(call, tmp_path, f"{runs[5].path}:0", runs[1].path, *TRIALS, *EFFORT)
    assert "Note: every group: 1 seed: no test." in text
    assert "hardly a chance" not in text


def test_trials_that_differ_are_said_and_each_run_is_tested_in_its_own(call, make_run, tmp_path):
    runs = [make_run("uni_b", seeds=2), make_run("cc_s", seeds=2, trial={"trial_length": 15})]
    text, _, pairs = compared(call, tmp_path, *[run.path for run in runs], *TRIALS, *EFFORT)
    assert "Note: these runs' trials differ" in text
    assert pairs["difference"].tolist() == pytest.approx([np.mean(values(runs[0])) - np.mean(values(runs[1]))])
    runs = [runs[0], make_run("bi_s", seeds=2, trial={"threshold": 0.02})]
    text, *_ = compared(call, tmp_path, *[run.path for run in runs], *TRIALS, *EFFORT)
    assert "trials differ" not in text


# Lesions of one run


STATES = {
    "intact": [30.2, 35.1, 28.7, 33.3, 31.9, 29.4],
    "deep_dominant": [10.2, 12.0, 11.2, 9.9, 12.4, 10.7],
    "deep_non_dominant": [11.0, 12.9, 11.5, 10.4, 13.3, 11.1],
}


@pytest.fixture
def lesioned(make_run):
    """A run of six seeds, and results of its lesions: 0.5 times the seed's number more when retrained."""
    run = make_run("bi_s", task="hold_position", seeds=6)
    rows = [
        ("bi_s", "hold_position", "bptt", seed, lesion, *treated(protocol), metric, scale * (value + share * seed))
        for metric, scale in (("time_in_goal_5cm", 1.0), ("effort", 0.01))
        for lesion, of_seeds in STATES.items()
        for protocol, share in (("none", 0.0), ("output", 0.5))
        for seed, value in enumerate(of_seeds)
    ]
    place = run.path.with_name("bi_s-bptt-1-lesions")
    place.mkdir()
    pd.DataFrame(rows, columns=list(COLUMNS)).to_csv(place / "lesions.csv", index=False)
    return run


def test_one_run_compares_its_lesions_paired_by_seed(call, lesioned, tmp_path):
    text, out, pairs = compared(call, tmp_path, lesioned.path)
    table = read_results(lesioned.path.with_name("bi_s-bptt-1-lesions") / "lesions.csv")
    expected = [
        compare_lesions(table, "time_in_goal_5cm", State("hold_position", "bi_s", protocol=again)).pairs.assign(
            metric="time_in_goal_5cm", protocol=again
        )
        for again in ("none", "output")
    ]
    assert_same_pairs(pairs, pd.concat(expected))
    for words in ("without retraining", "output layer retrained"):
        assert f"hold_position, bi_s, {words}: Time within 5 cm (steps)" in text
    assert groups(out) == {"intact": ("31.4", "2.5", 6), "deep dominant": ("11.1", "1.0", 6),
                           "deep non-dominant": ("11.7", "1.1", 6)}  # fmt: skip
    assert "paired by seed, adjusted by Holm" in text
    assert "ANOVA" not in text


def test_the_protocols_compared_can_be_chosen(call, lesioned, tmp_path):
    every = compared(call, tmp_path, lesioned.path, *EFFORT)[2]
    text, _, pairs = compared(call, tmp_path, lesioned.path, *EFFORT, "--retrain", "output", "--retrain", "output")
    assert_same_pairs(pairs, every[every["protocol"] == "output"].assign(note=""))
    assert "without retraining" not in text
    assert "fresh" not in text


def test_the_means_of_fresh_networks_stand_beside_those_of_the_trained(call, lesioned, tmp_path):
    path = lesioned.path.with_name("bi_s-bptt-1-lesions") / "lesions.csv"
    table = pd.read_csv(path)
    control = table.assign(network="fresh", value=table["seed"] + 10.0 * (table["protocol"] == "output"))
    pd.concat([table, control]).to_csv(path, index=False)
    text, out, _ = compared(call, tmp_path, lesioned.path, "--retrain", "output")
    assert [line.split("│")[-2].strip() for line in out.split("└")[0].splitlines() if line[0] == "│"] == ["12.5"] * 3
    assert "fresh: mean of freshly initialized networks, treated alike" in text


def test_lesions_of_version_0_1_0_are_compared_too(call, lesioned, tmp_path):
    path = lesioned.path.with_name("bi_s-bptt-1-lesions") / "lesions.csv"
    new = compared(call, tmp_path, lesioned.path)
    table = pd.read_csv(path)
    old = ["model", "task", "algo", "seed", "lesion", "retrained", "metric", "value"]
    table.assign(retrained=table["protocol"] == "output")[old].to_csv(path, index=False)
    assert compared(call, tmp_path, lesioned.path)[:2] == new[:2]
    assert compared(call, tmp_path, lesioned.path, "--retrain", "none")[0]


def test_results_without_retraining_have_one_table(call, lesioned, tmp_path):
    path = lesioned.path.with_name("bi_s-bptt-1-lesions") / "lesions.csv"
    table = pd.read_csv(path)
    table[table["protocol"] == "none"].to_csv(path, index=False)
    text, _, pairs = compared(call, tmp_path, lesioned.path, *EFFORT)
    assert len(pairs) == 3
    assert "retrained:" not in text


def test_the_lesions_of_one_seed_are_its_own(call, lesioned, undrawn, tmp_path):
    code, _, err = call("compare", f"{lesioned.path}:2")
    assert code == 2
    assert f"`bilateral-rl lesion {lesioned.path}:2` first" in " ".join(err.split())
    assert call("lesion", f"{lesioned.path}:2", "--no-retrain", "--trials", 2, "--lesion", "deep_dominant")[0] == 0
    text, out, pairs = compared(call, tmp_path, f"{lesioned.path}:2")
    assert {n for *_, n in groups(out).values()} == {1}
    assert "Note: every group: 1 seed: no test." in text
    assert pairs["p_holm"].isna().all()


def test_eight_states_fit_into_80_columns(call, trained, tmp_path):
    place = trained.path.with_name("cc_s-bptt-1-lesions")
    place.mkdir()
    states = ["intact", "shallow_dominant", "callosum_deep_dominant", "callosum_deep_non_dominant"]
    rng = np.random.default_rng(0)
    rows = [
        ("cc_s", "random_reach", "bptt", seed, state, *RETRAINED, "effort", 0.1 * number + 0.01 * rng.normal())
        for number, state in enumerate(states)
        for seed in range(3)
    ]
    pd.DataFrame(rows, columns=list(COLUMNS)).to_csv(place / "lesions.csv", index=False)
    _, out, _ = compared(call, tmp_path, trained.path, *EFFORT)
    assert "…" not in out
    assert all(len(line) <= 80 for line in out.splitlines() if line[:1] in "┏┃│├")
    assert out.count("│ callosum, deep non-dominant │") == 1 + 3
    assert "\n│ callosum, deep dominant −   │" in out


# What is refused


def refused(call, *arguments):
    code, out, err = call("compare", *arguments)
    assert (code, out) == (2, "")
    assert err.startswith("Error: ")
    assert len(err.strip().splitlines()) == 1
    return err


def test_different_tasks_are_refused(call, make_run):
    runs = [make_run("cc_s", task=task).path for task in ("random_reach", "hold_position")]
    assert "different tasks cannot be compared: hold_position, random_reach" in refused(call, *runs)


def test_metrics_that_are_unknown_or_mean_nothing_in_the_task_are_refused(call, make_run, lesioned):
    runs = [make_run(model, task="hold_position").path for model in ("uni_b", "cc_s")]
    for chosen in (runs, [lesioned.path]):
        assert "Unknown metric 'speed'; choose from final_error" in refused(call, *chosen, "--metric", "speed")
        says = "sparc means nothing in hold_position; leave it out of --metric"
        assert says in refused(call, *chosen, *EFFORT, "--metric", "sparc")
    says = "no time_in_goal_2cm; choose --metric from time_in_goal_5cm, effort."
    assert says in refused(call, lesioned.path, "--metric", "time_in_goal_2cm")


def test_protocols_that_were_not_tested_and_those_of_several_runs_are_refused(call, make_run, lesioned):
    says = "has no --retrain everything; choose from none, output."
    assert says in refused(call, lesioned.path, "--retrain", "everything")
    runs = [make_run(model).path for model in ("uni_b", "cc_s")]
    assert "--retrain chooses among the lesions of one run" in refused(call, *runs, "--retrain", "output")


def test_seeds_of_one_model_alone_are_refused(call, make_run):
    runs = [make_run("cc_s", "ppo", seed=seed).path for seed in (0, 1)]
    assert "seeds of one model" in refused(call, *runs)


def test_a_network_is_not_compared_with_itself(call, make_run):
    run, other = make_run("cc_s", seeds=3), make_run("uni_b")
    for twice in ((run.path, run.path), (run.path, f"{run.path}:1"), (f"{run.path}:1", f"{run.path}/:1")):
        err = refused(call, *twice, other.path)
        assert "is there 2 times" in err
        assert str(run.path) in err


def test_a_mistake_is_one_clear_sentence(call, make_run):
    runs = [make_run(model).path for model in ("uni_b", "cc_s")]
    assert "no run runs/none" in refused(call, *runs, "runs/none")
    assert "--trials must be at least 1" in refused(call, *runs, "--trials", "0")
    assert "--seed must be at least 0" in refused(call, *runs, "--seed", "-1")
    assert "has no seed 1; it has seed 0" in refused(call, f"{runs[0]}:1", runs[1])


def test_a_run_without_lesions_says_how_to_get_them(call, make_run):
    run = make_run("bi_s")
    assert f"`bilateral-rl lesion {run.path}` first" in refused(call, run.path)


def test_a_damaged_table_of_lesions_is_refused(call, lesioned):
    (lesioned.path.with_name("bi_s-bptt-1-lesions") / "lesions.csv").write_text("")
    assert "lesions.csv is damaged" in refused(call, lesioned.path)


def test_the_file_can_be_the_terminal_and_must_be_writable(call, make_run, tmp_path):
    runs = [make_run(model).path for model in ("uni_b", "cc_s")]
    _, out, err = call("compare", *runs, *TRIALS, *EFFORT, "--csv", "-")
    assert list(pd.read_csv(io.StringIO(out))["first"]) == ["uni_b"], "nothing but the table"
    assert "Games–Howell" in err
    code, _, err = call("compare", *runs, *TRIALS, *EFFORT, "--csv", tmp_path / "none" / "x.csv")
    assert code == 2
    assert "Cannot write" in err
