"""Supervised runs that are stopped, killed or damaged: they go on as if nothing had been, or are refused."""

import contextlib
import signal

import pytest
import torch
from supervised_runs import Watch, contents, scalars, with_values

from bilateral_rl.bptt.rollout import Rollout
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs import folder as run_folder
from bilateral_rl.runs.folder import RunFolder, find_runs
from bilateral_rl.training.run import resume, train

pytestmark = pytest.mark.usefixtures("no_pictures")


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


# The configuration, versions and the first status; then what a save writes.
N_WRITES_BEFORE, N_WRITES_A_SAVE = 3, 5


@pytest.mark.parametrize(
    ("save", "write"), [(0, 4), *((save, write) for save in (1, 3) for write in range(N_WRITES_A_SAVE))]
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
    assert (
        writes[-1]
        == ("final.safetensors", "best.safetensors", "epochs.csv", "resume.safetensors", "status.json")[write]
    )
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


DAMAGES = [
    truncate,  # truncated
    lambda folder: (folder.path / "resume.safetensors").write_bytes(b""),  # empty
    lambda folder: (folder.path / "resume.safetensors").unlink(),  # missing
    lambda folder: folder.save_resume({"optimizer.0.exp_avg": torch.zeros(1)}),  # another algorithm's
    change(second=lambda _: None),  # a tensor missing
    change(weights=lambda t: t[:2]),  # a seed missing
    change(first=lambda t: t[:, :-16]),  # another network
    change(history=lambda t: t[:, :, :-1]),  # another model's history
    change(weights=lambda t: t.double()),  # another type
    change(weights=lambda t: t + torch.nan),  # not a number
    change(seed_state=lambda t: t + 7),  # an unknown state
]


def test_a_damaged_resume_file_is_refused_and_the_folder_left_as_it_was(bptt_run):
    sound = (bptt_run.path / "resume.safetensors").read_bytes()
    for damage in DAMAGES:
        (bptt_run.path / "resume.safetensors").write_bytes(sound)
        damage(bptt_run)
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
