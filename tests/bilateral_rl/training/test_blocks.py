"""Blocks of an adaptation: tests without learning under each condition, which change nothing and resume exactly."""

import csv

import pytest
import torch
from rl_runs import ALGORITHMS, differences, small_rl
from supervised_runs import Watch, with_values

from bilateral_rl.analysis.block_table import BLOCKS, COLUMNS, MEASURES, read_blocks
from bilateral_rl.analysis.metrics import find_metric, metric_name
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.api.run import Run
from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import EvaluationConfig
from bilateral_rl.envs.experiments.task import ExperimentTask
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import load_policies
from bilateral_rl.training import evaluation, run
from bilateral_rl.training.adaptation_figure import draw_adaptation
from bilateral_rl.training.moments import trained_moments
from bilateral_rl.training.run import resume, train
from bilateral_rl.training.side_by_side import SideBySideLearner
from bilateral_rl.vocabulary import SIDES

pytestmark = pytest.mark.usefixtures("no_pictures")

FIELD = {"task": "curl_field", "trial": {"trial_length": 12}}
EVERY = {"ppo": 160, "a2c": 160, "sac": 160, "td3": 160}


@pytest.fixture(autouse=True)
def no_rl_pictures(monkeypatch):
    monkeypatch.setattr(evaluation, "hand_paths", lambda *_: None)
    monkeypatch.setattr(run, "draw_adaptation", lambda *_: None)


@pytest.fixture
def adapting(small_bptt):
    """Two seeds, three epochs of four updates; a test after every three of them."""

    def make(**values):
        chosen = {"blocks": {"every": 3, "trials": 8}, "bptt": {"trials": 64, "learning_rate": 0.02}}
        return small_bptt(**{"task": "curl_field", "trial": FIELD["trial"]} | chosen | values)

    return make


def adapting_rl(algo, **values):
    small = {"timesteps": 640, "evaluation": {"every": 10**6, "checkpoint_every": 10**6, "trials": 2}}
    return small_rl(algo, **FIELD, **small, **{"blocks": {"every": EVERY[algo], "trials": 4}} | values)


def table(folder):
    with (folder.path / BLOCKS).open(newline="") as file:
        return list(csv.DictReader(file))


def measures(config, policy):
    """What a policy does in each condition, with the trials of the tests."""
    found = {}
    for condition, name in (("field", "field"), ("null", "null_field"), ("channel", "channel")):
        task = ExperimentTask(config.experiment.with_condition(condition))
        record = Evaluator(task, config.trial, config.blocks.trials, EvaluationConfig.seed).run(policy)
        metrics = [metric_name(measure, config.trial.threshold) for measure in MEASURES]
        values = [find_metric(metric).value(record) for metric in metrics]
        found[name] = dict(zip(MEASURES, values, strict=True))
    return found


def test_a_supervised_adaptation_is_tested_before_within_and_after_its_epochs(adapting, tmp_path):
    config = adapting()
    folder = train(config, tmp_path).folder
    rows = table(folder)
    assert list(rows[0]) == list(COLUMNS)
    blocks = {(row["seed"], row["block"], row["done"]) for row in rows}
    assert blocks == {(seed, str(k), str(3 * k)) for seed in "01" for k in range(5)}
    assert len(rows) == len(blocks) * 3
    last = [row for row in rows if row["block"] == "4"]
    for seed, policy in load_policies(folder).items():
        expected = measures(config, policy)
        for row in (row for row in last if row["seed"] == str(seed)):
            found = {name: float(row[name]) for name in MEASURES}
            assert found == pytest.approx(expected[row["condition"]], rel=1e-4, nan_ok=True)
    errors = [row["final_error"] for row in rows if row["condition"] == "field"]
    assert len(set(errors)) == len(errors), "networks learn between tests"
    forces = [row["channel_peak_force"] for row in rows]
    assert [force == "nan" for force in forces] == [row["condition"] != "channel" for row in rows]


@pytest.mark.parametrize("algo", ["ppo", "td3"])
def test_a_reinforced_adaptation_is_tested_at_its_end_too(algo, tmp_path):
    config = adapting_rl(algo, blocks={"every": 400, "trials": 4})
    folder = train(config, tmp_path).folder
    rows = table(folder)
    done = sorted({int(row["done"]) for row in rows})
    assert done[0] == 0
    assert 400 <= done[1] < 640
    assert done[2] == 640
    (policy,) = load_policies(folder).values()
    expected = measures(config, policy)
    for row in rows[-3:]:
        found = {name: float(row[name]) for name in MEASURES}
        assert found == pytest.approx(expected[row["condition"]], rel=1e-4, nan_ok=True)


def test_an_epoch_that_no_block_ends_with_is_tested_at_the_end(adapting, tmp_path):
    folder = train(adapting(blocks={"every": 5, "trials": 2}), tmp_path).folder
    assert sorted({int(row["done"]) for row in table(folder)}) == [0, 5, 10, 12]


@pytest.mark.parametrize("algo", ["bptt", "td3"])
def test_tests_do_not_change_what_is_learned(algo, adapting, tmp_path, same_bits):
    ends = []
    for every in (160, 0):
        config = adapting_rl(algo, blocks={"every": every}) if algo != "bptt" else adapting(blocks={"every": every})
        folder = train(config, tmp_path).folder
        assert (folder.path / BLOCKS).exists() == bool(every)
        ends.append(folder.load_weights("final"))
    assert same_bits(*ends)


@pytest.mark.parametrize("stop_at", [1, 6])
def test_a_stopped_supervised_adaptation_ends_with_the_same_table(stop_at, adapting, assert_same_end, tmp_path):
    config = adapting()
    whole = train(config, tmp_path / "whole").folder
    stopped = train(config, tmp_path / "stopped", Watch(stop_at=stop_at))
    assert stopped.interrupted
    again = resume(stopped.folder, config).folder
    assert_same_end(whole, again)
    assert (whole.path / BLOCKS).read_bytes() == (again.path / BLOCKS).read_bytes()


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_a_stopped_reinforced_adaptation_ends_with_the_same_table(algo, tmp_path):
    config = adapting_rl(algo)
    whole = train(config, tmp_path / "whole").folder
    stopped = train(config, tmp_path / "stopped", Watch(stop_at=330))
    assert stopped.interrupted
    again = resume(stopped.folder, config).folder
    assert not differences(whole, again)
    assert (whole.path / BLOCKS).read_bytes() == (again.path / BLOCKS).read_bytes()


def test_an_optimizer_is_continued_from_a_run_with_blocks(adapting, tmp_path):
    config = adapting()
    assert trained_moments(train(config, tmp_path).folder, [1]).steps == [config.total]


def test_seeds_side_by_side_have_one_table(adapting, tmp_path):
    config = with_values(adapting_rl("ppo"), seeds=2)
    folder = RunFolder.create(tmp_path / "side_by_side", config)
    text = (train(adapting(), tmp_path).folder.path / BLOCKS).read_text()
    header, *rows = text.splitlines(keepends=True)
    for seed in "01":
        child = folder.path / f"seed_{seed}"
        child.mkdir()
        (child / BLOCKS).write_text(header + "".join(row for row in rows if row.startswith(seed)))
    SideBySideLearner(config, folder).write_tables(folder)
    frame = Run(folder).blocks()
    assert list(frame) == ["model", "task", "algo", *COLUMNS]
    assert len(frame) == len(rows)
    assert set(frame["condition"]) == {"field", "null", "channel"}
    assert set(Run(folder, only=1).blocks()["seed"]) == {1}


def test_fields_have_blocks_by_default_and_others_cannot():
    for algo in ("bptt", *ALGORITHMS):
        assert resolve(algo, "curl_field").blocks.every > 0
        assert resolve(algo, "center_out").blocks.every == 0
        assert resolve(algo, "curl_field", [{"blocks": {"every": 0}}]).blocks.every == 0
        run = resolve(algo, "curl_field").to_values()
        assert resolve(algo, "random_reach", [run]).blocks.every == 0
        with pytest.raises(
            UserError, match=r"blocks\.every tests an adaptation to a field, which random_reach has not"
        ):
            resolve(algo, None, [{"blocks": {"every": 5}}])
    with pytest.raises(UserError, match=r"blocks\.trials are of tests along an adaptation, of which there are none"):
        resolve("bptt", None, [{"blocks": {"trials": 5}}])


def test_an_adaptation_is_a_shorter_training_with_defaults_of_its_own():
    for algo in ("bptt", *ALGORITHMS):
        fresh, adapts = (resolve(algo, "curl_field", layers) for layers in ([], [{"init_from": "runs/a/b"}]))
        assert adapts.total < fresh.total
        assert adapts.blocks == fresh.blocks
        assert resolve(algo, "center_out", [{"init_from": "runs/a/b"}]).total == resolve(algo, "center_out").total


def test_a_hold_in_a_field_has_no_channel(small_bptt, tmp_path):
    hold = {"name": "held", "start": {"hand": [0.0, 0.4]}, "target": "start", "forces": {"curl": 10}}
    values = {"experiment": hold, "task": "held", "trial": {"trial_length": 5}, "epochs": 1}
    config = resolve("bptt", None, [{"bptt": {"trials": 8, "batch_size": 4, "validation_trials": 2}} | values])
    folder = train(config, tmp_path).folder
    assert {row["condition"] for row in table(folder)} == {"field", "null_field"}


def test_blocks_are_drawn_into_the_folder_of_the_run_or_a_warning_says_why_not(adapting, tmp_path):
    folder = train(adapting(epochs=1), tmp_path).folder
    draw_adaptation(folder)
    assert {path.suffix for path in folder.path.glob("adaptation.*")} == {".png", ".pdf"}
    (folder.path / BLOCKS).write_text("damaged")
    with pytest.warns(UserWarning, match="damaged|no such table"):
        draw_adaptation(folder)
    for path in (folder.path / BLOCKS, *folder.path.glob("adaptation.*")):
        path.unlink()
    draw_adaptation(folder)
    assert not [*folder.path.glob("adaptation.*")]


def test_catch_and_channel_trials_are_learned_from_and_not_tested(adapting, tmp_path):
    tables = []
    for shares in ({}, {"field_off_share": 0.3, "channel": {"share": 0.3}}):
        values = {"experiment": {"forces": shares}} if shares else {}
        folder = train(adapting(**values), tmp_path).folder
        tables.append([row for row in table(folder) if row["block"] in ("0", "2")])
    plain, mixed = tables
    first = [row for row in plain if row["block"] == "0"]
    assert first == [row for row in mixed if row["block"] == "0"], "the tests are the same"
    assert plain != mixed, "and what is learned is not"


def test_damaged_tables_are_refused(adapting, tmp_path):
    folder = train(adapting(epochs=1), tmp_path).folder
    text = (folder.path / BLOCKS).read_text()
    path = tmp_path / BLOCKS
    for damaged in (
        text.replace("null_field", "nothing"),
        text.replace("null_field", "field"),
        text.replace("block", "b"),
    ):
        path.write_text(damaged)
        with pytest.raises(UserError, match=r"damaged|no such table"):
            read_blocks(path)
    (folder.path / BLOCKS).unlink()
    with pytest.raises(UserError, match="has no blocks"):
        Run(folder).blocks()


def test_the_states_count_of_blocks_is_checked(adapting, tmp_path):
    folder = train(adapting(), tmp_path, Watch(stop_at=6)).folder
    state = folder.load_resume()
    for wrong in ({"blocks.tested": torch.tensor(1.0)}, {"blocks.more": torch.tensor(1)}):
        folder.save_resume(state | wrong)
        with pytest.raises(UserError, match=r"is damaged: .*blocks"):
            resume(folder, adapting())


def test_blocks_of_two_arms_tell_of_each_hand(tmp_path):
    few = {"timesteps": 160, "evaluation": {"trials": 2}, "blocks": {"every": 160, "trials": 2}}
    folder = train(small_rl("ppo", "bimanual_curl_field", trial=FIELD["trial"], **few), tmp_path).folder
    blocks = read_blocks(folder.path / BLOCKS)
    for name in ("final_error", "signed_deviation"):
        by_hand = blocks[[f"{name}_of_{hand}" for hand in SIDES]]
        assert by_hand.mean(axis=1).tolist() == pytest.approx(blocks[name].tolist(), rel=1e-4)
    assert set(blocks["condition"]) == {"field", "null", "channel"}
