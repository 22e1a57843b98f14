"""What a training leaves to a retraining with the same optimizer."""

import pytest
import torch

from bilateral_rl.bptt.layout import Layout
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.policies import build_network
from bilateral_rl.training.moments import trained_moments
from bilateral_rl.training.supervised import SupervisedLearner


def test_the_moments_of_a_seed_are_those_of_its_training_state(bptt_run):
    state, config = bptt_run.load_resume(), bptt_run.config()
    moments = trained_moments(bptt_run, [2, 0])
    assert torch.equal(moments.first, state["first"][[2, 0]])
    assert torch.equal(moments.second, state["second"][[2, 0]])
    assert moments.first.abs().max() > 0
    assert moments.steps == [int(state["epochs"][i]) * config.updates_per_epoch for i in (2, 0)]


def test_a_seed_that_stopped_early_has_fewer_updates(bptt_run):
    learner = SupervisedLearner(bptt_run.config(), bptt_run)
    learner.load(bptt_run.load_resume())
    state = learner.state()
    state["epochs"][1] -= 1
    bptt_run.save_resume(state)
    first, second, third = trained_moments(bptt_run, [0, 1, 2]).steps
    assert first == third == second + bptt_run.config().updates_per_epoch


def test_what_has_no_optimizer_to_continue_is_refused(bptt_run, run):
    with pytest.raises(UserError, match=r"not trained by BPTT .* --retrain-optimizer fresh"):
        trained_moments(run, [0])
    tensors = bptt_run.load_weights("final")
    bptt_run.save_weights("best", {name: t if name == "seeds" else t + 1 for name, t in tensors.items()})
    with pytest.raises(UserError, match="not of its weights 'best'"):
        trained_moments(bptt_run, [0], "best")
    state = bptt_run.load_resume()
    bptt_run.save_resume({name: t for name, t in state.items() if name != "first"})
    with pytest.raises(UserError, match=r"is damaged: it must hold .* --retrain-optimizer fresh"):
        trained_moments(bptt_run, [0])
    (bptt_run.path / "resume.safetensors").unlink()
    with pytest.raises(UserError, match="no training state, and so no optimizer to continue"):
        trained_moments(bptt_run, [0])


def test_rows_lie_as_the_weights_do(bptt_run):
    layout = Layout(build_network(bptt_run.config()))
    assert trained_moments(bptt_run, [1]).first.shape == (1, layout.width)
