"""Which loss moves which parameters, for networks that autograd differentiates (paper section 5).

Both losses' gradients are computed in full, through both hemispheres, the callosum and whatever lies behind them, and
only then selected: dominant ← dominant loss, non-dominant ← non-dominant loss, shared ← half of each.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor, nn

from bilateral_rl.vocabulary import Loss, group_shares, stream_mix

Groups = Mapping[str, Sequence[nn.Parameter]]
"""The parameters of each group."""
Shares = Mapping[str, Sequence[float]]
"""How much of each stream's gradient every parameter group gets."""


def policy_shares(loss: Loss) -> dict[str, tuple[float, ...]]:
    """Return how much of each stream's gradient every group of a policy gets: the network's groups, then the critics.

    ``critic_0`` predicts the first stream, ``critic_1`` the second, and each learns from its own stream alone.
    """
    n_streams = len(stream_mix(loss))
    critics = {f"critic_{i}": tuple(float(i == stream) for stream in range(n_streams)) for i in range(n_streams)}
    return {**group_shares(loss), **critics}


def assign_routed_gradients(losses: Sequence[Tensor], groups: Groups, group_shares: Shares) -> None:
    """Set every parameter's ``.grad`` to its share of the losses' gradients.

    Args:
        losses: one scalar per stream, of one graph.
        groups: the parameters of each group.
        group_shares: per group, one share per stream. A parameter that no stream reaches gets ``grad = None``, so
            that no optimizer moves it, and so does a frozen one, which does not require any.
    """
    # For a parameter θ of group G: grad = Σ_s share(G, s) · ∂L_s/∂θ, one backward pass for each stream s. A pass asks
    # only for the parameters that have a share of it, but goes through the whole graph to reach them.
    for group in groups.values():
        for parameter in group:
            parameter.grad = None
    for stream, loss in enumerate(losses):
        owned = [
            (parameter, group_shares[name][stream])
            for name, group in groups.items()
            if group_shares[name][stream]
            for parameter in group
            if parameter.requires_grad
        ]
        if not owned:  # autograd refuses to differentiate by nothing
            continue
        gradients = torch.autograd.grad(
            loss, [p for p, _ in owned], retain_graph=stream + 1 < len(losses), allow_unused=True
        )
        for (parameter, share), gradient in zip(owned, gradients, strict=True):
            if gradient is None:  # the loss does not depend on it
                continue
            routed = share * gradient  # a tensor of its own: autograd may give one to several parameters
            parameter.grad = routed if parameter.grad is None else parameter.grad + routed


def add_weight_penalty(groups: Groups, weights: Mapping[str, float], coefficient: float) -> None:
    """Add the gradient of coefficient · weight · ½ Σ w² over each group's parameters to their ``.grad``."""
    for name, weight in weights.items():
        if not weight * coefficient:
            continue
        for parameter in groups[name]:
            if not parameter.requires_grad:  # frozen
                continue
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
