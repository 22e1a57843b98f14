import pandas as pd
import pytest

from bilateral_rl.analysis.results import COLUMNS
from bilateral_rl.io.errors import UserError
from bilateral_rl.study.outcome import learning_history, results_of, runs_of
from bilateral_rl.study.plan import Study, results_file

CONFIGS = Study(algo="ppo", seeds=2).configs()


def write(folder, config, value):
    path = folder / results_file(config)
    path.parent.mkdir(parents=True, exist_ok=True)
    row = (config.model, config.task, config.algo, config.seed, "intact", False, "effort", value)
    pd.DataFrame([row], columns=list(COLUMNS)).to_csv(path, index=False)
    return path


def test_results_are_those_of_the_trainings_that_are_done(tmp_path):
    for i in (3, 0, 20):
        write(tmp_path, CONFIGS[i], i)
    (tmp_path / "results" / "random_reach" / "other.csv").write_text("not of this study")
    results = results_of(tmp_path, CONFIGS)
    assert list(results["value"]) == [0, 3, 20]
    assert list(results["seed"]) == [CONFIGS[i].seed for i in (0, 3, 20)]
    assert results["retrained"].dtype == bool


def test_where_nothing_is_done_there_are_no_results_and_no_runs(tmp_path):
    results = results_of(tmp_path, CONFIGS)
    assert list(results) == list(COLUMNS)
    assert results.empty
    assert runs_of(tmp_path, CONFIGS) == {}
    assert learning_history({}).empty


@pytest.mark.parametrize("text", ["", "model,task\ncc_s,random_reach\n", '"'])
def test_a_damaged_file_of_results_is_refused_with_what_to_do(tmp_path, text):
    path = write(tmp_path, CONFIGS[0], 1.0)
    path.write_text(text)
    with pytest.raises(UserError, match=r"; remove it and call the command again\.$") as error:
        results_of(tmp_path, CONFIGS)
    assert str(path) in str(error.value)


def test_runs_are_those_whose_results_are_there(tmp_path, bptt_run):
    config = bptt_run.config()
    folder = tmp_path  # bptt_run lies in runs/ below it
    assert runs_of(folder, [config]) == {}
    write(folder, config, 1.0)
    assert runs_of(folder, [config]) == {"cc_s": [bptt_run]}


def test_the_history_of_supervised_runs_has_a_row_a_seed_and_epoch(bptt_run):
    history = learning_history({"cc_s": [bptt_run]})
    assert set(history["model"]) == {"cc_s"}
    assert sorted(set(zip(history["seed"], history["epoch"], strict=True))) == [
        (seed, epoch) for seed in range(3) for epoch in range(1, 7)
    ]
    assert history["validation_loss"].notna().all()


def test_the_history_of_other_runs_has_a_row_a_seed_and_evaluation(run):
    history = learning_history({"cc_s": [run], "bi_s": [run]})
    assert list(history["model"].unique()) == ["cc_s", "bi_s"]
    assert set(history["seed"]) == {0}
    assert history["timesteps"].max() == 4000
