"""Networks with random weights, and an independent implementation of what they compute."""

from collections.abc import Callable

import numpy as np
import pytest
import torch

from bilateral_rl.policies import MotorNetwork, make_network
from bilateral_rl.policies.lesions import NO_LESION, Lesion

MakeNetwork = Callable[..., MotorNetwork]


def _random_network(architecture, n_inputs=16, n_outputs=6, units=10, layers=2, seed=0, **arms):
    """A network whose every parameter, biases too, is random, so that no lesion is without effect."""
    network = make_network(architecture, n_inputs, n_outputs, units, layers, **arms)
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in network.parameters():
            if parameter.requires_grad:  # not the weights of a combination that is fixed
                parameter.copy_(0.6 * torch.randn(parameter.shape, generator=generator))
    network.constrain()
    if architecture != "unilateral" and not arms:
        with torch.no_grad():
            network.combination_dominant.fill_(0.7)
            network.combination_non_dominant.fill_(0.4)
    return network


def _reference_forward(
    network: MotorNetwork, observation: np.ndarray, lesion: Lesion = NO_LESION, noise: np.ndarray | None = None
) -> np.ndarray:
    """The output before the sigmoid, from paper section 1 and 6, unit by unit in NumPy; noise is (n, L, 2, U)."""
    if noise is None:
        noise = np.zeros((len(observation), network.layers, 2, network.units))
    weights = {name: value.detach().double().numpy() for name, value in network.named_parameters()}

    def dense(name, x):
        return x @ weights[f"{name}.weight"].T + weights[f"{name}.bias"]

    if network.architecture == "unilateral":
        x = observation
        for k in range(network.layers):
            x = np.tanh(dense(f"hidden.{k}", x)) + noise[:, k, 0]
        return dense("output", x)
    half = observation.shape[1] // 2
    views = [observation] * 2 if network.n_arms == 1 else [observation[:, :half], observation[:, half:]]
    activity = {
        side: np.zeros_like(view) if lesion.input_of == side else view
        for side, view in zip(("dominant", "non_dominant"), views, strict=True)
    }
    for k in range(network.layers):
        if k > 0 and network.architecture == "callosal" and not lesion.callosum:
            before = {side: x.copy() for side, x in activity.items()}
            for side, other in (("dominant", "non_dominant"), ("non_dominant", "dominant")):
                width = before[side].shape[1]
                for pair in range(width // 2):
                    sent = np.maximum(before[other][:, 2 * pair], before[other][:, 2 * pair + 1])
                    activity[side][:, width - width // 2 + pair] += sent
        activity = {side: np.tanh(dense(f"{side}.{k}", x)) for side, x in activity.items()}
        for i, side in enumerate(("dominant", "non_dominant")):
            activity[side] += noise[:, k, i, : network.units // 2]
    sent = {side: x for side, x in activity.items() if lesion.output_of != side}
    if network.n_arms == 1:
        return dense("output", sum(weights[f"combination_{side}"] * x for side, x in sent.items()))
    commands = [
        dense(f"output.{arm}", sum(weights[f"combination_{side}"][a] * x for side, x in sent.items()))
        for a, arm in enumerate(("dominant", "non_dominant"))
    ]
    return np.concatenate(commands, axis=1)


@pytest.fixture
def random_network() -> MakeNetwork:
    """Builder of a network with random parameters throughout."""
    return _random_network


@pytest.fixture
def reference_forward() -> Callable[..., np.ndarray]:
    """An implementation of the networks that shares no code with the product."""
    return _reference_forward
