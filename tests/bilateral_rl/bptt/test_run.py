"""Supervised runs in their folders: what is written, how they stop, fail and go on, and where they begin."""

import contextlib
import csv
import dataclasses
import math
import shutil
import signal

import numpy as np
import pytest
import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from torch.utils.tensorboard import SummaryWriter

from bilateral_rl import run_folder
from bilateral_rl.bptt import training as bptt_training
from bilateral_rl.bptt.rollout import Rollout
from bilateral_rl.bptt.trainer import Trainer
from bilateral_rl.bptt.trials import epoch_order
from bilateral_rl.controllers import build_network, build_policy, load_policies, network_states
from bilateral_rl.errors import UserError
from bilateral_rl.progress import Progress
from bilateral_rl.resolve import resolve
from bilateral_rl.run_folder import RunFolder, find_runs
from bilateral_rl.settings import merge
from bilateral_rl.training import resume, train


class Watch(Progress):
    """Remembers what it is told, and presses Ctrl-C, for real, once ``stop_at`` updates are done."""

    def __init__(self, stop_at=math.inf):
        self.started, self.steps, self.evaluations = [], [], []
        self._stop_at = stop_at

    def on_start(self, done):
        self.started.append(done)

    def on_step(self, done):
        self.steps.append(done)
        if done >= self._stop_at:
            self._stop_at = math.inf
            signal.raise_signal(signal.SIGINT)

    def on_evaluation(self, done, measures):
        self.evaluations.append((done, measures))


def with_values(config, **values):
    return resolve(None, None, [merge(config.to_values(), values)])


def table(folder):
    """The rows of ``epochs.csv`` as numbers, by seed."""
    with (folder.path / "epochs.csv").open(newline="") as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    return {seed: [row for row in rows if row["seed"] == seed] for seed in sorted({int(row["seed"]) for row in rows})}


def scalars(folder, seed):
    """What tensorboard shows of a seed: by tag, (epoch, value)."""
    events = EventAccumulator(str(folder.path / f"seed_{seed}"))
    events.Reload()
    return {tag: [(e.step, e.value) for e in events.Scalars(tag)] for tag in events.Tags()["scalars"]}


def contents(folder):
    return {str(path): path.read_bytes() for path in sorted(folder.path.rglob("*")) if path.is_file()}


@pytest.fixture
def assert_same_end(same_bits):
    """Asserts that two runs ended with the same bits, in everything that training reads and people see."""

    def check(first, second):
        for name in ("final", "best"):
            assert same_bits(first.load_weights(name), second.load_weights(name)), name
        assert same_bits(first.load_resume(), second.load_resume())
        assert (first.path / "epochs.csv").read_bytes() == (second.path / "epochs.csv").read_bytes()
        assert first.status() == second.status()

    return check


@pytest.fixture(scope="module")
def longer(small_bptt):
    """Three epochs of four updates of two seeds."""
    return small_bptt(bptt={"trials": 64, "learning_rate": 0.02})


@pytest.fixture(scope="module")
def whole(longer, tmp_path_factory):
    """That training in one go."""
    return train(longer, tmp_path_factory.mktemp("whole")).folder


@pytest.fixture(autouse=True)
def no_pictures(monkeypatch):
    """Pictures take longer than these trainings; those of ``bptt_run`` are drawn before this."""
    monkeypatch.setattr(bptt_training, "hand_paths", lambda *_: None)
    monkeypatch.setattr(SummaryWriter, "add_figure", lambda *_, **__: None)


# The folder


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


# Stopping and going on


@pytest.mark.parametrize("stop_at", [1, 4, 6, 9, 12])
def test_ctrl_c_and_resume_end_with_the_same_bits_as_a_training_in_one_go(
    tmp_path, longer, whole, assert_same_end, stop_at
):
    outcome = train(longer, tmp_path, Watch(stop_at))
    folder = outcome.folder
    assert outcome.interrupted
    epochs = (stop_at - 1) // 4
    assert folder.status()["state"] == "interrupted"
    assert (folder.status()["epochs"], outcome.done) == (epochs, 4 * epochs)
    watch = Watch()
    resumed = resume(folder, folder.config(), watch)
    assert not resumed.interrupted
    assert watch.started == [4 * epochs]
    assert watch.steps == list(range(4 * epochs + 1, 13))
    assert_same_end(folder, whole)


def test_a_training_may_be_stopped_again_and_again(tmp_path, longer, assert_same_end):
    config = with_values(longer, seeds=4, epochs=9, bptt={"learning_rate": 0.2, "patience": 2})
    whole = train(config, tmp_path).folder
    folder = train(config, tmp_path, Watch(6)).folder
    for stop_at in (7, 11, 18, 22):
        resume(folder, config, Watch(stop_at))
        assert folder.status()["state"] == "interrupted"
    resume(folder, config)
    assert len({seed["epochs"] for seed in whole.status()["seeds"]}) > 1
    assert_same_end(folder, whole)


def press_ctrl_c(presses):
    for _ in range(presses):
        signal.raise_signal(signal.SIGINT)


def stopped_by_ctrl_c(config, out, presses):
    """The folder of a training that was asked to stop, or told to by a second press."""
    if presses == 1:
        assert train(config, out).interrupted
    else:
        with pytest.raises(KeyboardInterrupt):
            train(config, out)
    (folder,) = find_runs(out)
    assert folder.status()["state"] != "finished"
    return folder


@pytest.mark.parametrize("presses", [1, 2])
def test_ctrl_c_during_validation_loses_or_repeats_nothing(
    tmp_path, longer, whole, monkeypatch, assert_same_end, presses
):
    forward, validations = Rollout.forward, []

    def interrupted(rollout):
        if not rollout.size.n_streams:
            validations.append(1)
            if len(validations) == 2:
                press_ctrl_c(presses)
        forward(rollout)

    with monkeypatch.context() as patch:
        patch.setattr(Rollout, "forward", interrupted)
        folder = stopped_by_ctrl_c(longer, tmp_path, presses)
    resume(folder, folder.config())
    assert_same_end(folder, whole)


@pytest.mark.parametrize("presses", [1, 2])
@pytest.mark.parametrize("save", [3, 4, 6])
def test_ctrl_c_during_a_save_loses_or_repeats_nothing(
    tmp_path, longer, whole, monkeypatch, assert_same_end, save, presses
):
    save_weights, saves = RunFolder.save_weights, []

    def interrupted(folder, name, tensors):
        saves.append(name)
        if len(saves) == save:
            press_ctrl_c(presses)
        save_weights(folder, name, tensors)

    with monkeypatch.context() as patch:
        patch.setattr(RunFolder, "save_weights", interrupted)
        folder = stopped_by_ctrl_c(longer, tmp_path, presses)
    resume(folder, folder.config())
    assert_same_end(folder, whole)


class PowerCut(BaseException):
    """Nothing of the program runs after it."""


N_WRITES_BEFORE, N_WRITES_A_SAVE = 2, 5


@pytest.mark.parametrize(
    ("save", "write"), [(0, 1), *((save, write) for save in (1, 3) for write in range(N_WRITES_A_SAVE))]
)
def test_a_run_cut_off_between_any_two_files_of_a_save_goes_on_with_the_same_bits(
    tmp_path, longer, whole, monkeypatch, assert_same_end, save, write
):
    replacing, writes = run_folder.replacing, []

    @contextlib.contextmanager
    def cut(path):
        writes.append(path.name)
        if len(writes) == N_WRITES_BEFORE + save * N_WRITES_A_SAVE + write + 1:
            raise PowerCut
        with replacing(path) as temporary:
            yield temporary

    with monkeypatch.context() as patch:
        patch.setattr(run_folder, "replacing", cut)
        with pytest.raises(PowerCut):
            train(longer, tmp_path)
    assert writes[-1 - write] == "resume.safetensors"
    folder = find_runs(tmp_path)[-1]
    assert folder.status().get("state", "running") == "running"
    resume(folder, folder.config())
    assert_same_end(folder, whole)


def test_tensorboard_shows_every_epoch_once_after_a_resume(tmp_path, longer):
    folder = train(longer, tmp_path, Watch(6)).folder
    resume(folder, longer)
    for seed in (0, 1):
        for values in scalars(folder, seed).values():
            assert [epoch for epoch, _ in values] == [1, 2, 3]


def test_more_epochs_go_on_and_equal_a_training_that_long_from_the_start(tmp_path, longer, assert_same_end):
    folder = train(longer, tmp_path).folder
    more = with_values(longer, epochs=5)
    outcome = resume(folder, more)
    assert outcome.done == 20
    assert folder.config().epochs == 5
    assert_same_end(folder, train(more, tmp_path).folder)


def test_more_epochs_do_not_wake_seeds_that_stopped_by_themselves(tmp_path, small_bptt, assert_same_end):
    config = small_bptt(seeds=4, epochs=6, bptt={"learning_rate": 0.2, "patience": 2})
    folder = train(config, tmp_path).folder
    assert {seed["state"] for seed in folder.status()["seeds"]} == {"all epochs done", "converged"}
    more = with_values(config, epochs=8)
    resume(folder, more)
    assert_same_end(folder, train(more, tmp_path).folder)


def test_a_complete_run_is_not_resumed(tmp_path, bptt_run, small_bptt):
    before = contents(bptt_run)
    with pytest.raises(UserError, match=r"done its 6 epochs.*--epochs"):
        resume(bptt_run, bptt_run.config())
    with pytest.raises(UserError, match=r"done its 6 epochs.*--epochs"):
        resume(bptt_run, with_values(bptt_run.config(), epochs=2))
    assert contents(bptt_run) == before
    stopped = train(small_bptt(epochs=9, bptt={"learning_rate": 1e-12, "patience": 1}), tmp_path).folder
    before = contents(stopped)
    with pytest.raises(UserError, match=r"complete.*stopped"):
        resume(stopped, with_values(stopped.config(), epochs=20))
    assert contents(stopped) == before


def truncate(folder):
    path = folder.path / "resume.safetensors"
    path.write_bytes(path.read_bytes()[:-100])


def change(**changes):
    def apply(folder):
        tensors = folder.load_resume()
        for name, function in changes.items():
            tensors[name] = function(tensors[name])
        folder.save_resume({name: tensor for name, tensor in tensors.items() if tensor is not None})

    return apply


DAMAGES = {
    "truncated": truncate,
    "empty": lambda folder: (folder.path / "resume.safetensors").write_bytes(b""),
    "missing": lambda folder: (folder.path / "resume.safetensors").unlink(),
    "another algorithm's": lambda folder: folder.save_resume({"optimizer.0.exp_avg": torch.zeros(1)}),
    "a tensor missing": change(second=lambda _: None),
    "a seed missing": change(weights=lambda t: t[:2]),
    "another network": change(first=lambda t: t[:, :-16]),
    "another model's history": change(history=lambda t: t[:, :, :-1]),
    "another type": change(weights=lambda t: t.double()),
    "not a number": change(weights=lambda t: t + torch.nan),
    "an unknown state": change(seed_state=lambda t: t + 7),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_resume_file_is_refused_and_the_folder_left_as_it_was(bptt_run, damage):
    DAMAGES[damage](bptt_run)
    before = contents(bptt_run)
    with pytest.raises(UserError, match=r"resume\.safetensors"):
        resume(bptt_run, with_values(bptt_run.config(), epochs=9))
    assert contents(bptt_run) == before


def test_a_run_whose_network_was_changed_is_not_resumed(bptt_run):
    bptt_run.write_config(with_values(bptt_run.config(), network={"units": 12}, epochs=9))
    before = contents(bptt_run)
    with pytest.raises(UserError, match="damaged"):
        resume(bptt_run, bptt_run.config())
    assert contents(bptt_run) == before


# Losses that are no number


def test_a_seed_that_fails_is_noted_and_the_others_end_as_without_it(tmp_path, longer, monkeypatch, same_bits):
    class Poisoned(Trainer):
        """A trial of the third batch of seed 1's second epoch is unusable."""

        def run_epoch(self, goes_on=lambda _: True):
            if self.state.epoch == 1:
                self._training.target[1, epoch_order(1, 1, 64)[40]] = torch.nan
            return super().run_epoch(goes_on)

    config = with_values(longer, seeds=3)
    sound = train(config, tmp_path).folder
    monkeypatch.setattr(bptt_training, "Trainer", Poisoned)
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


# Where a training begins


def beginning(config, out):
    """The networks by seed before any update."""
    outcome = train(config, out, Watch(stop_at=1))
    assert outcome.interrupted
    return network_states(outcome.folder)


@pytest.fixture
def before_learning(monkeypatch, tmp_path):
    """The policy of a PPO training before any update."""

    def look(config):
        def stop(*_args, **_kwargs):
            raise KeyboardInterrupt

        with monkeypatch.context() as patch:
            patch.setattr("bilateral_rl.algorithms.HemisphericPPO.learn", stop)
            return train(config, tmp_path / "before").policies[config.seed]

    return look


@pytest.mark.parametrize("named", ["{}", "{}:0"])
def test_every_seed_can_begin_with_a_reinforced_network(tmp_path, run, small_bptt, same_bits, named):
    source = network_states(run)[0]
    states = beginning(small_bptt(seed=5, init_from=named.format(run.path)), tmp_path)
    assert list(states) == [5, 6]
    assert all(same_bits(state, source) for state in states.values())


def test_seeds_begin_with_the_seeds_of_their_number_or_with_the_one_named(tmp_path, bptt_run, small_bptt, same_bits):
    source = network_states(bptt_run)
    states = beginning(small_bptt(seed=1, init_from=str(bptt_run.path)), tmp_path)
    assert all(same_bits(states[seed], source[seed]) for seed in (1, 2))
    states = beginning(small_bptt(seed=1, init_from=f"{bptt_run.path}:2"), tmp_path)
    assert all(same_bits(states[seed], source[2]) for seed in (1, 2))


def test_another_model_of_the_same_architecture_may_be_begun_with(tmp_path, bptt_run, small_bptt, same_bits):
    states = beginning(small_bptt(model="cc_ns", task="hold_position", init_from=str(bptt_run.path)), tmp_path)
    assert same_bits(states[1], network_states(bptt_run)[1])


@pytest.mark.parametrize(("seed", "named", "expected"), [(1, "{}", 1), (1, "{}:2", 2), (9, "{}:0", 0)])
def test_reinforcement_begins_with_the_action_of_the_supervised_network(
    bptt_run, small, before_learning, seed, named, expected
):
    policy = before_learning(with_values(small, seed=seed, init_from=named.format(bptt_run.path)))
    network = build_network(bptt_run.config())
    network.load_state_dict(network_states(bptt_run)[expected])
    observation = torch.randn(64, 16)
    with torch.no_grad():
        excitation = network.excitation(observation)
    action, _ = policy.predict(observation.numpy(), deterministic=True)
    np.testing.assert_allclose((action + 1) / 2, excitation, atol=1e-6)


def test_reinforcement_goes_on_from_a_supervised_network(tmp_path, bptt_run, small):
    config = with_values(small, timesteps=1_000, init_from=str(bptt_run.path))
    with pytest.raises(UserError, match=r"no run"):
        train(dataclasses.replace(config, init_from=f"{bptt_run.path}x"), tmp_path)
    outcome = train(config, tmp_path)
    assert outcome.folder.config().init_from == str(bptt_run.path)
    assert network_states(outcome.folder).keys() == {0}


def test_the_run_begun_with_is_not_needed_to_resume(tmp_path, bptt_run, small_bptt, assert_same_end):
    config = small_bptt(seeds=3, init_from=str(bptt_run.path))
    whole = train(config, tmp_path).folder
    folder = train(config, tmp_path, Watch(3)).folder
    shutil.rmtree(bptt_run.path)
    resume(folder, folder.config())
    assert_same_end(folder, whole)


UNFIT = [
    ({"seed": 7}, "{}", r"has seeds 0 to 2, not 7: name one, as .*cc_s-bptt-1:0"),
    ({}, "{}:3", r"has no seed 3; it has seeds 0 to 2"),
    ({"model": "bi_s"}, "{}", r"callosal.*bilateral"),
    ({"model": "uni_b"}, "{}:0", r"callosal.*unilateral"),
    ({"network": {"units": 12}}, "{}", r"10 units in 2 layers.*12 units in 2 layers"),
    ({"network": {"layers": 3}}, "{}", r"10 units in 2 layers.*10 units in 3 layers"),
    ({}, "{}-no", r"no run"),
    ({}, "{}/weights", r"config\.yaml"),
]
SEEDS_UNFIT = ({"seed": 1, "seeds": 3}, "{}", r"has seeds 0 to 2, not 3: name one, as .*cc_s-bptt-1:0")


@pytest.mark.parametrize(
    ("algo", "values", "named", "says"),
    [*(("ppo", *case) for case in UNFIT), *(("bptt", *case) for case in (*UNFIT, SEEDS_UNFIT))],
)
def test_what_cannot_be_begun_with_is_refused_and_leaves_nothing(
    tmp_path, bptt_run, small, small_bptt, algo, values, named, says
):
    values = {**values, "init_from": named.format(bptt_run.path)}
    config = with_values(small, **values) if algo == "ppo" else small_bptt(**values)
    with pytest.raises(UserError, match=says):
        train(config, tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_a_damaged_network_is_not_begun_with(tmp_path, bptt_run, small_bptt):
    weights = bptt_run.load_weights("final")
    weights["output.bias"][2, 0] = torch.nan
    bptt_run.save_weights("final", weights)
    with pytest.raises(UserError, match=r"output\.bias"):
        train(small_bptt(init_from=f"{bptt_run.path}:0"), tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_a_policy_of_another_start_has_fresh_critics_only(bptt_run, small, before_learning, same_bits):
    config = with_values(small, init_from=f"{bptt_run.path}:1")
    own, fresh = (before_learning(c).state_dict() for c in (config, with_values(small)))
    differing = {name for name in own if not same_bits(own[name], fresh[name])}
    assert differing == {name for name in own if name.startswith("mlp_extractor.actor.")}
    assert set(build_policy(config).state_dict()) == set(own)
