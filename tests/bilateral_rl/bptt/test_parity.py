"""Rollouts, losses, gradients and updates are the released code's, for its seven models on both tasks.

``tests/data/train_*.npz`` holds its numbers: TensorFlow, float32, profile ``released``; its left is our dominant side.
"""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from released_names import released_name

from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.losses import StreamLosses
from bilateral_rl.bptt.optimizer import StackedAdam
from bilateral_rl.bptt.rollout import Rollout
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.envs import ArmParameters
from bilateral_rl.policies import make_network

DATA = Path(__file__).parents[2] / "data"
TASKS = ("reach", "hold")
BATCH, UPDATES = 64, 10
STREAMS = {1: ["loss"], 2: ["dominant", "nondominant"]}
# Relative. The penalties on feedback are a hundred-thousandth of the loss, and must be seen.
LOSS_BOUND = 3e-6
# Largest difference of a row of the muscle state: activation, length, velocity, the three curves, force (N).
MUSCLE_BOUNDS = [3e-6, 2e-6, 2e-5, 1e-5, 3e-5, 2e-5, 0.03]


def under(reference, prefix):
    """The reference's arrays under ``prefix`` by the rest of their names."""
    return {key.removeprefix(prefix): array for key, array in reference.items() if key.startswith(prefix)}


def variables(reference, prefix, layout):
    """The reference's arrays under ``prefix`` by our names; every one of them must find its place."""
    found = {key.removeprefix("RNN/network/"): array for key, array in under(reference, prefix).items()}
    arrays = {v.name: found.pop(released_name(v.name)) for v in layout.variables}
    assert not found
    for v in layout.variables:
        assert arrays[v.name].shape == v.shape
    return arrays


def by_name(layout, row):
    """The variables in ``row`` (width,)."""
    return {v.name: row[v.offset : v.offset + v.size].reshape(v.shape).numpy().copy() for v in layout.variables}


@pytest.fixture(scope="module", params=[f"{model}_{task}" for model in MODELS for task in TASKS])
def trained(request):
    """Ten updates of a model from the reference's first weights on its batches: what it did, and the reference."""
    with np.load(DATA / f"train_{request.param}.npz") as data:
        reference = dict(data)
    model, arm = MODELS[request.param.rsplit("_", 1)[0]], ArmParameters()
    layout = Layout(make_network(model.architecture, n_inputs=16, n_outputs=6))
    losses = StreamLosses(model.loss, "released", 0.01, layout, arm)
    rollout = Rollout(layout, arm, losses.rollout_size(1, BATCH, 50))
    optimizer = StackedAdam(rollout, losses, model.loss, learning_rate=1e-3, epsilon=1e-7, clip_norm=1.0)
    first = variables(reference, "weight0/", layout)
    rollout.weights.copy_(layout.pack([{name: torch.tensor(value.T) for name, value in first.items()}]))

    result = SimpleNamespace(reference=reference, layout=layout, weights={})
    for update in range(1, UPDATES + 1):
        batch = slice(BATCH * (update - 1), BATCH * update)
        for own, name in zip(rollout.trials, ("initial_joint", "target", "load"), strict=True):
            own[0] = torch.tensor(reference[name][batch, :2])
        rollout.forward()
        values = losses.values(rollout)
        optimizer.gradient()
        if update == 1:
            result.losses = dict(zip(STREAMS[losses.n_streams], values[:, 0].tolist(), strict=True))
            result.gradients = dict(zip(STREAMS[losses.n_streams], rollout.gradient[:, 0].clone(), strict=True))
            result.path = {
                name: getattr(rollout, name)[0].numpy().copy() for name in ("joint", "hand", "excitation", "muscle")
            }
        optimizer.step()
        result.weights[update] = by_name(layout, rollout.weights[0])
    return result


def test_every_file_of_the_reference_is_compared():
    names = {f"train_{model}_{task}.npz" for model in MODELS for task in TASKS}
    assert {path.name for path in DATA.glob("train_*.npz")} == names


def largest_difference(values, reference):
    assert values.shape == reference.shape
    return np.abs(values - reference).max()


def test_hand_joints_muscles_and_excitations_take_the_references_path(trained):
    path, reference = trained.path, under(trained.reference, "first_batch/")
    assert (trained.reference["initial_joint"][:, 2:] == 0).all()
    assert largest_difference(path["hand"], reference["cartesian"]) <= 1e-4
    assert largest_difference(path["joint"][..., :2], reference["joint"][..., :2]) <= 1e-4
    assert largest_difference(path["joint"][..., 2:], reference["joint"][..., 2:]) <= 1e-3
    assert largest_difference(path["excitation"], reference["excitation"]) <= 2e-5
    muscle = path["muscle"][: len(reference["muscle"])]
    differences = [largest_difference(muscle[..., row, :], reference["muscle"][..., row, :]) for row in range(7)]
    assert all(difference <= bound for difference, bound in zip(differences, MUSCLE_BOUNDS, strict=True)), differences


def test_losses_and_their_full_gradients_are_the_references(trained):
    losses = under(trained.reference, "first_batch/loss/")
    assert set(losses) == set(trained.losses)
    for stream, loss in trained.losses.items():
        assert loss == pytest.approx(float(losses[stream]), rel=LOSS_BOUND), stream
    assert {name.split("/")[0] for name in under(trained.reference, "first_batch/grad/")} == set(trained.gradients)
    for stream, row in trained.gradients.items():
        reference = variables(trained.reference, f"first_batch/grad/{stream}/", trained.layout)
        for name, gradient in by_name(trained.layout, row).items():
            difference = np.linalg.norm(gradient - reference[name])
            assert difference <= 1e-3 * np.linalg.norm(reference[name]), f"{stream}: {name}"


def test_weights_after_updates_are_the_references(trained):
    for update in (1, 5, 10):
        reference = variables(trained.reference, f"weight{update}/", trained.layout)
        for name, weights in trained.weights[update].items():
            assert largest_difference(weights, reference[name]) <= 1e-5, f"after {update}: {name}"
