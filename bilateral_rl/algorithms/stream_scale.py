"""The running size of each stream's action gradients, by which they can be brought to one scale."""

from __future__ import annotations

import torch
from torch import Tensor, nn

_KEPT = 0.999
"""Share of the running mean that stays at an update."""
_SMALLEST = 1e-8
"""Added to what is divided by: a stream of no reward has no gradient."""

_MOST = 100.0
"""How many times as large the weight penalty of one stream may be made as that of another."""


def penalty_scales(scales: Tensor) -> list[float]:
    """Return how the weight penalty of each stream is scaled, where its loss is scaled by ``scales`` (n_streams,).

    A stream whose reward is always zero, or not found yet, is as large as the errors of its critic. Brought to the size
    of the other's, its penalty would be the largest by far, and shrink whatever the streams share.
    """
    bounded: list[float] = scales.clamp(max=_MOST * scales.min()).tolist()
    return bounded


class StreamScale(nn.Module):
    """Running root mean square of ‖∂Q/∂a‖ of each stream, over the batch and about a thousand updates.

    A module for its ``state_dict()``: it is saved and resumed with the model.

    Args:
        n_streams: number of reward streams.
    """

    mean_square: Tensor
    weight: Tensor

    def __init__(self, n_streams: int) -> None:
        super().__init__()
        self.register_buffer("mean_square", torch.zeros(n_streams))
        self.register_buffer("weight", torch.zeros(()))

    @torch.no_grad()
    def update(self, gradients: Tensor) -> None:
        """Take in the gradients (n_streams, b, n_actions) of an update."""
        self.mean_square.lerp_(gradients.square().sum(dim=2).mean(dim=1), 1 - _KEPT)
        self.weight.lerp_(torch.ones_like(self.weight), 1 - _KEPT)

    def root_mean_square(self) -> Tensor:
        """Return the running root mean squares (n_streams,), after at least one update."""
        # As in Adam, divided by what the average has weighed so far: it began at zero.
        return (self.mean_square / self.weight).sqrt() + _SMALLEST
