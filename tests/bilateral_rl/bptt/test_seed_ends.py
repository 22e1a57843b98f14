"""How a seed's training ends, while others go on: early, by its epochs, by numbers out of range, or stopped."""

import math
from types import SimpleNamespace

import pytest
import torch
from trainers import finish, of_seed

from bilateral_rl.bptt.rollout import Rollout
from bilateral_rl.bptt.state import SeedState, TrainingState
from bilateral_rl.bptt.trials import epoch_order


def copy_of(state):
    return {name: tensor.clone() for name, tensor in state.tensors().items()}


@pytest.fixture
def forwards(monkeypatch):
    """A record of every forward pass: whether it was for training, and the weights then."""
    seen = []
    forward = Rollout.forward

    def watch(rollout):
        seen.append(SimpleNamespace(trains=rollout.size.n_streams > 0, weights=rollout.weights.clone()))
        forward(rollout)

    monkeypatch.setattr(Rollout, "forward", watch)
    return seen


# How a seed ends


@pytest.mark.parametrize(("model", "patience"), [("cc_s", 1), ("uni_b", 2), ("cc_s", 3)])
def test_a_seed_stops_after_so_many_epochs_without_a_better_validation_loss(make_trainer, small_bptt, model, patience):
    config = small_bptt(model=model, seeds=5, epochs=14, bptt={"learning_rate": 0.2, "patience": patience})
    trainer = make_trainer(config)
    state = finish(trainer)
    stopped = 0
    for index in range(5):
        losses = state.history[index, :, trainer.columns.index("validation_loss")].tolist()
        best, waited, epochs, converged = math.inf, 0, 0, False
        while epochs < 14 and not converged:
            waited = 0 if losses[epochs] < best else waited + 1
            best = min(best, losses[epochs])
            converged = waited == patience
            epochs += 1
        assert int(state.epochs[index]) == epochs
        assert int(state.seed_state[index]) == (SeedState.CONVERGED if converged else SeedState.TRAINING)
        assert float(state.best_loss[index]) == best
        assert int(state.waited[index]) == waited
        assert state.history[index, epochs:].isnan().all()
        assert state.history[index, :epochs].isfinite().all()
        stopped += converged
    assert stopped > 1


def test_a_loss_that_stays_the_same_is_not_a_better_one(make_trainer, small_bptt):
    trainer = make_trainer(small_bptt(model="uni_b", seeds=3, epochs=9, bptt={"learning_rate": 1e-12, "patience": 2}))
    state = finish(trainer)
    losses = state.history[:, :, trainer.columns.index("validation_loss")]
    assert (losses == losses[:, :1]).all()
    assert state.epochs.tolist() == [3, 3, 3]
    assert state.seed_state.tolist() == [SeedState.CONVERGED] * 3


def test_the_last_weights_are_kept_and_the_best_beside_them(make_trainer, small_bptt):
    trainer = make_trainer(small_bptt(seeds=4, epochs=12, bptt={"learning_rate": 0.2, "patience": 2}))
    state, after = trainer.state, []
    while not trainer.finished:
        trainer.run_epoch()
        after.append(state.weights.clone())
    losses = state.history[:, :, trainer.columns.index("validation_loss")].nan_to_num(torch.inf)
    for index in range(4):
        best, last = int(losses[index].argmin()), int(state.epochs[index]) - 1
        assert best == last - 2
        assert torch.equal(state.best_weights[index], after[best][index])
        assert torch.equal(state.weights[index], after[last][index])
        assert not torch.equal(state.weights[index], state.best_weights[index])


def test_a_seed_that_has_stopped_changes_no_more_and_costs_nothing(make_trainer, small_bptt, same_bits, forwards):
    trainer = make_trainer(small_bptt(seeds=4, epochs=12, bptt={"learning_rate": 0.2, "patience": 2}))
    state, ended = trainer.state, {}
    while not trainer.finished:
        training = state.training()
        forwards.clear()
        trainer.run_epoch()
        assert [len(f.weights) for f in forwards] == [len(training)] * 3  # two batches and the validation
        for index, end in ended.items():
            assert same_bits(of_seed(state, index), end)
        stopped = {index for index in range(4) if index not in state.training()}
        ended |= {index: copy_of_seed(state, index) for index in stopped - ended.keys()}
    assert len(ended) == 4
    assert len(set(state.epochs.tolist())) > 2


def copy_of_seed(state, index):
    return {name: tensor.clone() for name, tensor in of_seed(state, index).items()}


def test_a_training_ends_with_its_epochs(make_trainer, small_bptt):
    trainer = make_trainer(small_bptt())
    assert trainer.updates_per_epoch == 2
    for epoch in range(3):
        assert not trainer.finished
        assert trainer.state.epoch == epoch
        trainer.run_epoch()
    assert trainer.finished
    assert trainer.state.training() == [0, 1]
    assert (trainer.state.epochs.tolist(), int(trainer.state.updates)) == ([3, 3], 6)


# Losses that are no number


@pytest.mark.parametrize(
    ("model", "part", "poisoned", "value"),
    [
        ("cc_s", "target", slice(0, 1), float("nan")),
        ("cc_s", "target", slice(32, None), float("nan")),
        ("uni_b", "target", slice(32, 33), float("nan")),
        ("cc_s", "target", slice(47, 48), float("inf")),
        ("cc_s", "target", slice(63, 64), float("nan")),
        ("cc_s", "start", slice(32, 33), float("nan")),
        ("cc_s", "load", slice(32, 33), float("nan")),
    ],
    ids=["in the first batch", "from then on", "once", "infinite once", "in the last batch", "start once", "load once"],
)
def test_a_loss_that_is_no_number_ends_its_seed_before_the_update(
    make_trainer, small_bptt, same_bits, forwards, model, part, poisoned, value
):
    config = small_bptt(model=model, seeds=3, bptt={"trials": 64, "learning_rate": 0.02})
    sound = finish(make_trainer(config))
    trainer = make_trainer(config)
    state = trainer.state
    trainer.run_epoch()
    trials = epoch_order(1, 1, 64)[poisoned]
    getattr(trainer._training, part)[1, trials] = value
    batch = 1 + poisoned.start // 16
    forwards.clear()
    trainer.run_epoch()
    assert state.seed_state.tolist() == [SeedState.TRAINING, SeedState.FAILED, SeedState.TRAINING]
    assert state.failed_batch.tolist() == [0, batch, 0]
    assert state.epochs.tolist() == [2, 1, 2]
    used = [f.weights[1] for f in forwards if f.trains]
    before_it = used[max(batch - 2, 0)]  # the last ones whose loss was a number
    assert same_bits(state.weights[1], before_it)
    assert state.history[1, 1].isnan().all()
    forwards.clear()
    finish(trainer)
    assert [len(f.weights) for f in forwards] == [2] * 5
    for index in (0, 2):
        assert same_bits(of_seed(state, index), of_seed(sound, index))
    assert same_bits(state.weights[1], before_it)
    assert state.weights.isfinite().all()
    TrainingState.from_tensors(state.tensors(), 3, trainer.layout.width, len(trainer.columns))


@pytest.mark.parametrize(
    ("settings", "batch"),
    [
        ({"learning_rate": 1e39}, 1),
        ({"learning_rate": 1e30}, 2),
        ({"learning_rate": 1e20}, 2),
        ({"penalty_coefficient": 1e20}, 1),
    ],
    ids=["weights overflow", "both overflow", "the loss overflows", "the gradient overflows"],
)
def test_numbers_beyond_all_range_end_every_seed_with_finite_weights(
    make_trainer, small_bptt, same_bits, forwards, settings, batch
):
    trainer = make_trainer(small_bptt(bptt={"trials": 64, **settings}))
    trainer.run_epoch()
    state = trainer.state
    assert trainer.finished
    assert state.seed_state.tolist() == [SeedState.FAILED] * 2
    assert state.failed_batch.tolist() == [batch] * 2
    assert state.epochs.tolist() == [0, 0]
    assert same_bits(state.weights, forwards[0].weights)  # the last ones whose loss was a number
    assert state.weights.isfinite().all()
    assert same_bits(state.best_weights, forwards[0].weights)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_validation_loss_that_is_no_number_ends_its_seed(make_trainer, small_bptt, same_bits, forwards, value):
    config = small_bptt(seeds=3, bptt={"trials": 64, "learning_rate": 0.02})
    sound = finish(make_trainer(config))
    trainer = make_trainer(config)
    state = trainer.state
    trainer.run_epoch()
    best = state.best_weights[1].clone()
    trainer._validation.target[1, 2] = value
    forwards.clear()
    finish(trainer)
    assert state.seed_state.tolist() == [SeedState.TRAINING, SeedState.FAILED, SeedState.TRAINING]
    assert state.failed_batch.tolist() == [0, 4, 0]
    assert state.epochs.tolist() == [3, 1, 3]
    assert same_bits(state.weights[1], forwards[3].weights[1])  # the last ones whose loss was a number
    assert same_bits(state.best_weights[1], best)
    assert state.history[1, 1:].isnan().all()
    for index in (0, 2):
        assert same_bits(of_seed(state, index), of_seed(sound, index))


# Interruption


@pytest.mark.parametrize("after", [1, 4])
def test_an_epoch_that_is_not_to_go_on_leaves_the_state_and_can_be_done_again(
    make_trainer, small_bptt, same_bits, after
):
    config = small_bptt(seeds=3, bptt={"trials": 64, "learning_rate": 0.02})
    expected = finish(make_trainer(config))
    trainer = make_trainer(config)
    trainer.run_epoch()
    before = copy_of(trainer.state)
    asked = []

    def goes_on(done):
        asked.append(done)
        assert same_bits(trainer.state.tensors(), before)
        return done < after

    assert not trainer.run_epoch(goes_on)
    assert asked == list(range(1, after + 1))
    assert same_bits(trainer.state.tensors(), before)
    assert same_bits(finish(trainer).tensors(), expected.tensors())


@pytest.mark.parametrize("epochs", [1, 4])
def test_a_state_goes_on_in_another_trainer_as_it_would_have(make_trainer, small_bptt, same_bits, epochs):
    config = small_bptt(seeds=4, epochs=9, bptt={"learning_rate": 0.2, "patience": 2})
    expected = finish(make_trainer(config))
    first = make_trainer(config)
    for _ in range(epochs):
        first.run_epoch()
    tensors = copy_of(first.state)
    state = TrainingState.from_tensors(tensors, 4, first.layout.width, len(first.columns))
    assert same_bits(finish(make_trainer(config, state)).tensors(), expected.tensors())
