"""Which weights a loss on what the arm does can reach: those that some path leads from to the network's output."""

from __future__ import annotations

import functools
from typing import Any

import torch
from torch import Tensor

from bilateral_rl.policies.lesions import Lesion
from bilateral_rl.policies.motor_network import MotorNetwork
from bilateral_rl.policies.networks import make_network

_DRAWS, _INPUTS = 64, 4
"""Networks that are drawn, and inputs of each. Where the callosum pools two units, each of them is the larger one in
half of the draws, so that 2^-64 is the chance to miss one."""


def reached_weights(network: MotorNetwork, lesion: Lesion) -> dict[str, Tensor]:
    """Return, by the parameter's name, which of its numbers have any effect on the output under ``lesion``.

    This is a matter of structure: neither the network's present weights nor its present lesion count.
    """
    return _reached(tuple(network.arguments.items()), lesion)


@functools.lru_cache(maxsize=64)
def _reached(arguments: tuple[tuple[str, Any], ...], lesion: Lesion) -> dict[str, Tensor]:
    """Back-propagate through random networks, in double precision, and see where a gradient is not 0."""
    with torch.random.fork_rng(devices=[]):
        network = make_network(**dict(arguments)).double()
    network.set_lesion(lesion)
    generator = torch.Generator().manual_seed(0)
    reached = {name: torch.zeros(p.shape, dtype=torch.bool) for name, p in network.named_parameters()}
    for _ in range(_DRAWS):
        network.zero_grad()
        with torch.no_grad():
            for parameter in network.parameters():
                fan_in = parameter.shape[-1] if parameter.ndim > 1 else 1
                drawn = torch.randn(parameter.shape, generator=generator, dtype=torch.float64)
                parameter.copy_(drawn / fan_in**0.5)  # far from saturation, where gradients vanish
        inputs = torch.randn(_INPUTS, network.n_inputs, generator=generator, dtype=torch.float64)
        network(inputs).square().sum().backward()
        for name, parameter in network.named_parameters():
            if parameter.grad is not None:
                reached[name] |= parameter.grad != 0
    return reached
