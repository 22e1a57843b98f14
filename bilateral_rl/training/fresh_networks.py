"""Networks that have learned nothing: where supervised training begins, and the control of lesion studies."""

from __future__ import annotations

from collections.abc import Callable

import torch

from bilateral_rl.bptt.trials import initial_weights_seed
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.io.tensors import Tensors
from bilateral_rl.policies.motor_network import MotorNetwork
from bilateral_rl.policies.networks import make_network
from bilateral_rl.runs.policies import build_network


def fresh_copy(network: MotorNetwork, seed: int) -> Tensors:
    """Return the ``state_dict()`` of a freshly initialized network of the same architecture and sizes."""
    return _made(lambda: make_network(**network.arguments), seed)


def fresh_network(config: TrainConfig, seed: int) -> Tensors:
    """Return the ``state_dict()`` of a freshly initialized network of the run's model; each seed has one of its own."""
    return _made(lambda: build_network(config), seed)


def _made(make: Callable[[], MotorNetwork], seed: int) -> Tensors:
    """Return what ``make`` makes from the seed's random stream, which leaves torch's own as it was."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(initial_weights_seed(seed))
        return dict(make().state_dict())
