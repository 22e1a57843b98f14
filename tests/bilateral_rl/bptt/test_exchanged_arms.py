"""Trained on trials whose arms are exchanged, a network whose sides are exchanged stays the mirror image of the other.

So nothing in a training of one loss favors a side, and a difference between the hands of such networks is chance.
"""

import dataclasses

import pytest
import torch

from bilateral_rl.config.resolve import resolve


def exchanged_sides(state):
    names = {
        key: key.replace("non_dominant", "@").replace("dominant", "non_dominant").replace("@", "dominant")
        for key in state
    }
    return {names[key]: value.flip(0) if key.startswith("combination") else value for key, value in state.items()}


def exchanged_arms(trials):
    """Trials (seeds, n) whose arms have changed places: their hands stand in pairs."""
    hands = {
        name: tensor.unflatten(1, (-1, 2)).flip(2).flatten(1, 2).contiguous()
        for name, tensor in trials.tensors().items()
        if name not in ("stiffness", "damping")
    }
    return dataclasses.replace(trials, **hands)


@pytest.mark.parametrize("model", ["bi_ns", "cc_ns"])
def test_sides_and_arms_may_be_exchanged_throughout_a_training(make_trainer, model):
    small = {"trials": 32, "batch_size": 8, "validation_trials": 8}
    network = {"units": 8, "trained_combination": True}
    config = resolve("bptt", "reach_and_hold", [{"epochs": 2, "bptt": small, "network": network, "threads": 1}], model)
    one, other = make_trainer(config), make_trainer(config)
    layout = one.layout

    def states(trainer):
        return {key: value[0] for key, value in layout.unpack(trainer.state.weights).items()}

    began = states(one)
    other.state.weights.copy_(layout.pack([exchanged_sides(states(other))]))
    other._training = exchanged_arms(other._training)
    other._validation = exchanged_arms(other._validation)
    for _ in range(2):
        assert one.run_epoch()
        assert other.run_epoch()
    learned, mirrored = states(one), exchanged_sides(states(other))
    assert all((learned[key] - began[key]).abs().max() > 1e-3 for key in learned)
    for key, value in learned.items():
        torch.testing.assert_close(mirrored[key], value, rtol=0, atol=1e-6)
