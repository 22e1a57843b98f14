"""Supervised runs in their folders: what is written, and what becomes of seeds that fail."""

import math

import numpy as np
import pytest
import torch
from supervised_runs import Watch, contents, scalars, table, with_values
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from bilateral_rl.analysis.modulation import TAGS_OF
from bilateral_rl.bptt.trainer import Trainer
from bilateral_rl.bptt.trials import epoch_order
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import find_runs
from bilateral_rl.runs.policies import load_policies, network_states
from bilateral_rl.training import supervised
from bilateral_rl.training.run import resume, train

pytestmark = pytest.mark.usefixtures("no_pictures")


def test_the_run_folder_holds_what_it_promises_and_nothing_else(bptt_run):
    assert {path.name for path in bptt_run.path.iterdir()} == {
        *("config.yaml", "versions.json", "status.json", "resume.safetensors", "epochs.csv", "weights"),
        *("seed_0", "seed_1", "seed_2"),
    }
    assert bptt_run.weight_names() == ["best", "final"]
    for seed in range(3):
        (events,) = (bptt_run.path / f"seed_{seed}").iterdir()
        assert events.name.startswith("events.out.tfevents")


def test_nothing_in_a_run_folder_is_a_pickle(bptt_run):
    for path in (p for p in bptt_run.path.rglob("*") if p.is_file() and "tfevents" not in p.name):
        assert path.suffix in {".yaml", ".json", ".csv", ".safetensors"}
        assert not path.read_bytes().startswith((b"\x80", b"PK"))


def test_the_status_says_how_far_every_seed_came(bptt_run):
    rows = table(bptt_run)
    status = bptt_run.status()
    assert {name: status[name] for name in ("state", "epochs", "updates", "weights")} == {
        "state": "finished",
        "epochs": 6,
        "updates": 12,
        "weights": "final",
    }
    assert [seed["seed"] for seed in status["seeds"]] == [0, 1, 2]
    for seed in status["seeds"]:
        assert seed["epochs"] == len(rows[seed["seed"]])
        best = min(row["validation_loss"] for row in rows[seed["seed"]])
        assert seed["best_validation_loss"] == pytest.approx(best, rel=1e-7)


def test_the_table_of_epochs_has_a_row_a_seed_and_epoch_of_finite_numbers(bptt_run):
    rows = table(bptt_run)
    assert list(rows) == [0, 1, 2]
    history = bptt_run.load_resume()["history"]
    for seed, of_seed in rows.items():
        assert [row["epoch"] for row in of_seed] == [1, 2, 3, 4, 5, 6]
        values = [[value for name, value in row.items() if name not in ("seed", "epoch")] for row in of_seed]
        assert np.isfinite(values).all()
        np.testing.assert_allclose(values, history[seed], rtol=1e-8)


def test_stored_weights_are_the_last_ones_and_those_of_the_best_epoch(bptt_run, tmp_path, same_bits):
    config = bptt_run.config()
    final, best = bptt_run.load_weights("final"), bptt_run.load_weights("best")
    assert final["seeds"].tolist() == best["seeds"].tolist() == [0, 1, 2]
    bests = []
    for seed, rows in table(bptt_run).items():
        bests.append(int(np.argmin([row["validation_loss"] for row in rows])) + 1)
        until_then = train(with_values(config, epochs=bests[-1]), tmp_path / str(seed)).folder.load_weights("final")
        for name, tensor in best.items():
            assert same_bits(tensor[seed], until_then[name][seed])
    assert all(epoch < 6 for epoch in bests)
    assert not same_bits(final, best)


def test_a_seed_trained_with_others_is_stored_as_if_alone(tmp_path, small_bptt, same_bits):
    both = train(small_bptt(seed=4), tmp_path).folder
    alone = train(small_bptt(seed=5, seeds=1), tmp_path).folder
    assert same_bits(network_states(both)[5], network_states(alone)[5])
    assert table(both)[5] == table(alone)[5]


def test_training_depends_on_no_other_random_numbers(tmp_path, small_bptt, assert_same_end):
    config, folders = small_bptt(), []
    for seed in (1, 2):
        torch.manual_seed(seed)
        np.random.seed(seed)  # noqa: NPY002 - what a caller may do
        folders.append(train(config, tmp_path).folder)
    assert_same_end(*folders)


@pytest.mark.parametrize("model", ["cc_s", "uni_dl"])
def test_tensorboard_shows_every_seed_as_a_run(tmp_path, small_bptt, model):
    folder = train(small_bptt(model=model), tmp_path).folder
    streams, groups = ("dominant", "non_dominant"), ("dominant", "non_dominant", "shared")
    if model == "uni_dl":
        streams, groups = ("dominant",), ("shared",)
    columns = {f"loss/{stream}": f"loss_{stream}" for stream in streams}
    columns |= {f"gradient_norm/{group}": f"gradient_norm_{group}" for group in groups}
    columns |= {
        f"evaluation/{name}": name for name in ("goal_completion_percent", "time_in_goal_steps", "final_error_cm")
    }
    columns["loss/validation_loss"] = "validation_loss"
    sides = ("combination/dominant", "combination/non_dominant") if model == "cc_s" else ()
    columns |= {tag: name for name, tag in TAGS_OF[1].items()} if model == "cc_s" else {}
    weights = folder.load_weights("final")
    for index, (seed, rows) in enumerate(table(folder).items()):
        shown = scalars(folder, seed)
        assert shown.keys() == {*columns, *sides}
        for tag, column in columns.items():
            assert [epoch for epoch, _ in shown[tag]] == [1, 2, 3]
            np.testing.assert_allclose([v for _, v in shown[tag]], [row[column] for row in rows], rtol=1e-6)
        for tag in sides:
            stored = weights[tag.replace("/", "_")][index]
            assert shown[tag][-1] == (3, pytest.approx(float(stored)))


def test_tensorboard_shows_the_hand_paths_of_every_seed_at_the_end(bptt_run):
    for seed in range(3):
        events = EventAccumulator(str(bptt_run.path / f"seed_{seed}"), size_guidance={"images": 0})
        events.Reload()
        assert [picture.step for picture in events.Images("figures/hand_paths")] == [6]


def test_a_seed_that_stopped_is_shown_no_further(tmp_path, small_bptt):
    config = small_bptt(seeds=4, epochs=12, bptt={"learning_rate": 0.2, "patience": 2})
    folder = train(config, tmp_path).folder
    lengths = {seed: len(rows) for seed, rows in table(folder).items()}
    assert len(set(lengths.values())) > 2
    for seed, length in lengths.items():
        assert [epoch for epoch, _ in scalars(folder, seed)["loss/validation_loss"]] == list(range(1, length + 1))


def test_the_outcome_has_the_policies_of_all_seeds(tmp_path, small_bptt):
    outcome = train(small_bptt(seed=3), tmp_path)
    assert (outcome.done, outcome.interrupted, outcome.notes) == (6, False, [])
    assert list(outcome.policies) == [3, 4]
    observation = np.random.default_rng(0).normal(size=(5, 16)).astype(np.float32)
    stored = load_policies(outcome.folder)
    actions = {}
    for seed, policy in outcome.policies.items():
        actions[seed] = policy.predict(observation, deterministic=True)[0]
        np.testing.assert_array_equal(actions[seed], stored[seed].predict(observation, deterministic=True)[0])
    assert not np.array_equal(actions[3], actions[4])


def test_progress_counts_updates_and_tells_of_every_epoch(tmp_path, small_bptt):
    watch = Watch()
    folder = train(small_bptt(), tmp_path, watch).folder
    assert watch.started == [0]
    assert watch.steps == [1, 2, 3, 4, 5, 6]
    assert [done for done, _ in watch.evaluations] == [2, 4, 6]
    of_seeds = table(folder).values()
    for epoch, (_, measures) in enumerate(watch.evaluations):
        assert measures["seeds_training"] == 2
        for name in ("validation_loss", "final_error_cm"):
            assert measures[name] == pytest.approx(np.mean([rows[epoch][name] for rows in of_seeds]))


def test_a_network_begins_as_the_paper_says_and_otherwise_in_every_seed(tmp_path, small_bptt):
    outcome = train(small_bptt(), tmp_path, Watch(stop_at=1))
    assert outcome.interrupted
    states = network_states(outcome.folder)
    for state in states.values():
        for name, tensor in state.items():
            if name.startswith("combination"):
                assert float(tensor) == 0.5
            elif name.endswith("bias"):
                assert not tensor.any()
            else:
                bound = math.sqrt(6 / sum(tensor.shape))
                assert tensor.abs().max() <= bound
                assert tensor.abs().max() > 0.7 * bound
    assert not torch.equal(states[0]["dominant.0.weight"], states[1]["dominant.0.weight"])


def test_a_seed_that_fails_is_noted_and_the_others_end_as_without_it(tmp_path, longer, monkeypatch, same_bits):
    class Poisoned(Trainer):
        """A trial of the third batch of seed 1's second epoch is unusable."""

        def run_epoch(self, goes_on=lambda _: True):
            if self.state.epoch == 1:
                self._training.target[1, epoch_order(1, 1, 64)[40]] = torch.nan
            return super().run_epoch(goes_on)

    config = with_values(longer, seeds=3)
    sound = train(config, tmp_path).folder
    monkeypatch.setattr(supervised, "Trainer", Poisoned)
    watch = Watch()
    outcome = train(config, tmp_path, watch)
    folder, status = outcome.folder, outcome.folder.status()
    note = "Seed 1 failed: its loss was no longer a number in epoch 2, batch 3; its weights from before are kept."
    assert outcome.notes == [note]
    assert status["state"] == "finished"
    assert [seed["state"] for seed in status["seeds"]] == ["all epochs done", "failed", "all epochs done"]
    assert [seed["epochs"] for seed in status["seeds"]] == [3, 1, 3]
    rows = table(sound)
    assert table(folder) == {0: rows[0], 1: rows[1][:1], 2: rows[2]}
    states, expected = network_states(folder), network_states(sound)
    for seed in (0, 2):
        assert same_bits(states[seed], expected[seed])
    assert all(tensor.isfinite().all() for tensor in states[1].values())
    assert [measures["seeds_training"] for _, measures in watch.evaluations] == [3, 2, 2]
    assert all(math.isfinite(measures["validation_loss"]) for _, measures in watch.evaluations)
    assert load_policies(folder, "best").keys() == {0, 1, 2}
    assert len(scalars(folder, 1)["loss/validation_loss"]) == 1


@pytest.mark.parametrize(("learning_rate", "batch"), [(1e39, 1), (1e30, 2)])
def test_a_training_that_fails_in_every_seed_is_one_error_that_names_them(tmp_path, longer, learning_rate, batch):
    with pytest.raises(UserError) as error:
        train(with_values(longer, bptt={"learning_rate": learning_rate}), tmp_path)
    for seed in (0, 1):
        assert f"Seed {seed} failed: its loss was no longer a number in epoch 1, batch {batch};" in str(error.value)
    assert "bptt.learning_rate" in str(error.value)
    (folder,) = find_runs(tmp_path)
    assert folder.status()["state"] == "failed"
    assert [seed["state"] for seed in folder.status()["seeds"]] == ["failed", "failed"]
    assert table(folder) == {}
    assert load_policies(folder).keys() == {0, 1}
    before = contents(folder)
    with pytest.raises(UserError):
        resume(folder, with_values(folder.config(), epochs=9))
    assert contents(folder) == before
