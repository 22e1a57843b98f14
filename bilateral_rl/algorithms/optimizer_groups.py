"""Network and critics apart in their optimizers: a learning rate of the critics' own, and an ε of the network's own.

Adam divides a gradient by its root mean square, so that a small one that keeps its direction moves a parameter as fast
as a large one. Two hemispheres that want a little more and a little less of the same command then pull against each
other at the full learning rate. A larger ε beside that root mean square gives small gradients small steps.
"""

from __future__ import annotations

from typing import Any

import torch

_USUAL = "usual_eps"
"""Under this name a group keeps the ε of its optimizer, while the network has one of its own."""


def separate(optimizer: torch.optim.Optimizer, n_critics: int) -> None:
    """Give the critics' parameters, the last ``n_critics`` of an optimizer with one group, a group of their own."""
    (group,) = optimizer.param_groups
    of_critics = {**group, "params": group["params"][-n_critics:]}
    group["params"] = group["params"][:-n_critics]
    optimizer.param_groups.append(of_critics)


def separated_state(state: dict[str, Any], optimizer: torch.optim.Optimizer) -> dict[str, Any]:
    """Return what ``state_dict`` saved of one group as a state of an optimizer that has the same parameters in two.

    Models that were saved before critics had a group of their own hold such a state.
    """
    groups, sizes = state["param_groups"], [len(group["params"]) for group in optimizer.param_groups]
    if len(groups) != 1 or len(sizes) != 2 or len(groups[0]["params"]) != sum(sizes):
        return state
    order = groups[0]["params"]
    parts = [order[: sizes[0]], order[sizes[0] :]]
    return {**state, "param_groups": [{**groups[0], "params": part} for part in parts]}


def set_epsilon(group: dict[str, Any], epsilon: float | None) -> None:
    """Let a group of an optimizer have this ε; None for that of the optimizer.

    Raises:
        ValueError: the optimizer has none.
    """
    if epsilon is not None:
        if "eps" not in group:
            raise ValueError("network_epsilon has no effect on an optimizer without an ε (eps): leave it out.")
        group.setdefault(_USUAL, group["eps"])
        group["eps"] = epsilon
    elif _USUAL in group:
        group["eps"] = group.pop(_USUAL)
