"""The state of a training as tensors: it comes back as it was, and what is none is refused."""

import pytest
import torch

from bilateral_rl.bptt.state import SeedState, TrainingState

S, WIDTH, COLUMNS = 3, 16, 5


@pytest.fixture
def tensors():
    """Of a state after two epochs of three seeds, one of which failed and one converged."""
    state = TrainingState.start(torch.randn(S, WIDTH), COLUMNS)
    state.first, state.second, state.best_weights = (torch.randn(S, WIDTH) for _ in range(3))
    state.best_loss = torch.rand(S, dtype=torch.float64)
    state.waited = torch.tensor([0, 3, 1])
    state.seed_state = torch.tensor([SeedState.TRAINING, SeedState.CONVERGED, SeedState.FAILED])
    state.failed_batch = torch.tensor([0, 0, 7])
    state.history = torch.rand(S, 2, COLUMNS, dtype=torch.float64)
    state.history[2, 1] = torch.nan
    state.epochs = torch.tensor([2, 2, 1])
    state.updates = torch.tensor(14)
    return state.tensors()


def test_a_state_comes_back_from_its_tensors_as_it_was(tensors, same_bits):
    state = TrainingState.from_tensors(tensors, S, WIDTH, COLUMNS)
    assert same_bits(state.tensors(), tensors)
    assert state.epoch == 2
    assert state.training() == [0]


def test_a_state_does_not_share_its_tensors_with_what_it_was_made_of(tensors, same_bits):
    before = {name: tensor.clone() for name, tensor in tensors.items()}
    state = TrainingState.from_tensors(tensors, S, WIDTH, COLUMNS)
    for tensor in state.tensors().values():
        tensor.zero_()
    assert same_bits(tensors, before)


def test_a_start_has_nothing_done_and_weights_of_its_own_and_comes_back(same_bits):
    weights = torch.randn(S, WIDTH)
    state = TrainingState.start(weights, COLUMNS)
    assert torch.equal(state.weights, weights)
    assert torch.equal(state.best_weights, weights)
    assert state.best_loss.isinf().all()
    assert (state.epoch, int(state.updates), state.training()) == (0, 0, [0, 1, 2])
    before = weights.clone()
    weights += 1
    state.weights += 2
    assert torch.equal(state.best_weights, before)
    assert torch.equal(state.weights, before + 2)
    assert same_bits(TrainingState.from_tensors(state.tensors(), S, WIDTH, COLUMNS).tensors(), state.tensors())


def test_a_tensor_that_is_missing_or_of_another_type_or_shape_is_refused(tensors):
    for name, tensor in tensors.items():
        other = torch.int64 if tensor.is_floating_point() else torch.float64
        missing = {key: tensor for key, tensor in tensors.items() if key != name}
        for changed in (
            missing,
            tensors | {name: tensor.nan_to_num().to(other)},
            tensors | {name: tensor[..., None]},
        ):
            with pytest.raises(ValueError, match=name):
                TrainingState.from_tensors(changed, S, WIDTH, COLUMNS)


def test_an_unknown_tensor_is_refused(tensors):
    with pytest.raises(ValueError, match="must hold"):
        TrainingState.from_tensors(tensors | {"other": torch.zeros(1)}, S, WIDTH, COLUMNS)


def test_the_state_of_another_training_is_refused(tensors):
    for sizes in ((S + 1, WIDTH, COLUMNS), (S, WIDTH + 16, COLUMNS), (S, WIDTH, COLUMNS + 1)):
        with pytest.raises(ValueError, match="shape"):
            TrainingState.from_tensors(tensors, *sizes)


def test_numbers_out_of_range_are_refused(tensors):
    for name, value in (
        ("epochs", 99), ("epochs", -1), ("updates", -1), ("waited", -1), ("failed_batch", -1), ("seed_state", -1),
        ("seed_state", 3), ("weights", torch.nan), ("weights", torch.inf), ("first", torch.nan),
        ("best_loss", torch.nan),
    ):  # fmt: skip
        changed = tensors[name].clone()
        changed.view(-1)[0] = value
        with pytest.raises(ValueError, match="out of range"):
            TrainingState.from_tensors(tensors | {name: changed}, S, WIDTH, COLUMNS)
