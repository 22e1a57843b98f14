"""Which loss moves which parameters: the one routing rule of every training mode (paper section 5).

Both losses' gradients are computed in full, through both hemispheres, the callosum and whatever lies behind them, and
only then selected: dominant ← dominant loss, non-dominant ← non-dominant loss, shared ← half of each.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

Loss = Literal["combined", "dominant", "non_dominant", "specialized"]
LOSSES: tuple[Loss, ...] = ("combined", "dominant", "non_dominant", "specialized")
"""What trains a model; "specialized" is the routed one."""

Groups = Mapping[str, Sequence[nn.Parameter]]
Shares = Mapping[str, Sequence[float]]
"""Per parameter group, how much of each stream's gradient it gets."""

_MIX: dict[Loss, list[list[float]]] = {
    "combined": [[0.5, 0.5]],
    "dominant": [[1.0, 0.0]],
    "non_dominant": [[0.0, 1.0]],
    "specialized": [[1.0, 0.0], [0.0, 1.0]],
}

DOMINANT_PENALTY, NON_DOMINANT_PENALTY = 0.0, 2.0
"""Weight of the weight penalty in each loss (paper section 4)."""


def stream_mix(loss: Loss) -> NDArray[np.float32]:
    """(n_streams, 2): each stream's weights of the dominant and the non-dominant reward."""
    if loss not in _MIX:
        raise ValueError(f"unknown loss {loss!r}; choose from {', '.join(LOSSES)}.")
    return np.array(_MIX[loss], dtype=np.float32)


def stream_penalties(loss: Loss) -> list[float]:
    """Weight of the weight penalty in each stream's loss."""
    return [float(d * DOMINANT_PENALTY + n * NON_DOMINANT_PENALTY) for d, n in stream_mix(loss)]


def stream_names(loss: Loss) -> tuple[str, ...]:
    """What each stream is called in logs."""
    return ("dominant", "non_dominant") if loss == "specialized" else (loss,)


def shares(loss: Loss) -> dict[str, list[float]]:
    """How much of each stream's gradient every group of an actor-critic policy gets."""
    if loss != "specialized":
        return {"dominant": [1.0], "non_dominant": [1.0], "shared": [1.0], "critic_0": [1.0]}
    return {
        "dominant": [1.0, 0.0],
        "non_dominant": [0.0, 1.0],
        "shared": [0.5, 0.5],
        "critic_0": [1.0, 0.0],
        "critic_1": [0.0, 1.0],
    }


def penalty_weights(loss: Loss) -> dict[str, float]:
    """Weight of the weight penalty on each group of the network, routed like the rest of the loss."""
    streams = stream_penalties(loss)
    return {
        group: sum(share * weight for share, weight in zip(shares(loss)[group], streams, strict=True))
        for group in ("dominant", "non_dominant", "shared")
    }


def assign_routed_gradients(losses: Sequence[Tensor], groups: Groups, group_shares: Shares) -> None:
    """Set every parameter's ``.grad`` to its share of the losses' gradients.

    Args:
        losses: one scalar per stream, of one graph.
        groups: the parameters of each group.
        group_shares: per group, one share per stream. A parameter that no stream reaches gets ``grad = None``, so
            that no optimizer moves it.
    """
    for group in groups.values():
        for parameter in group:
            parameter.grad = None
    for stream, loss in enumerate(losses):
        owned = [
            (parameter, group_shares[name][stream])
            for name, group in groups.items()
            if group_shares[name][stream]
            for parameter in group
        ]
        if not owned:
            continue
        gradients = torch.autograd.grad(
            loss, [p for p, _ in owned], retain_graph=stream + 1 < len(losses), allow_unused=True
        )
        for (parameter, share), gradient in zip(owned, gradients, strict=True):
            if gradient is None:
                continue
            routed = share * gradient  # a tensor of its own: autograd may give one to several parameters
            parameter.grad = routed if parameter.grad is None else parameter.grad + routed


def add_weight_penalty(groups: Groups, weights: Mapping[str, float], coefficient: float) -> None:
    """Add the gradient of coefficient · weight · ½ Σ w² over each group's parameters to their ``.grad``."""
    for name, weight in weights.items():
        if not weight * coefficient:
            continue
        for parameter in groups[name]:
            penalty = weight * coefficient * parameter.detach()
            parameter.grad = penalty if parameter.grad is None else parameter.grad + penalty


def clip_group_gradients(groups: Groups, max_norm: float | None) -> dict[str, tuple[Tensor, Tensor]]:
    """Clip the gradient norm of each group by itself, so that a loud stream cannot shrink a quiet one.

    Returns:
        For each group that has gradients, its norm before and after.
    """
    norms = {}
    for name, group in groups.items():
        gradients = [parameter.grad for parameter in group if parameter.grad is not None]
        if not gradients:
            continue
        before = torch.linalg.vector_norm(torch.stack(torch._foreach_norm(gradients)))
        after = before
        if max_norm is not None:
            factor = (max_norm / (before + 1e-6)).clamp(max=1.0)
            torch._foreach_mul_(gradients, factor)
            after = before * factor
        norms[name] = (before, after)
    return norms
