"""Network and critics apart in their optimizers: a learning rate of the critics' own, and an ε of the network's own.

Adam divides a gradient by its root mean square, so that a small one that keeps its direction moves a parameter as fast
as a large one. Two hemispheres that want a little more and a little less of the same command then pull against each
other at the full learning rate. A larger ε beside that root mean square gives small gradients small steps.
"""

from __future__ import annotations

from collections.abc import Container
from typing import Any

import torch

_USUAL = "usual_eps"
"""Under this name a group keeps the ε of its optimizer, while the network has one of its own."""


def separate(optimizer: torch.optim.Optimizer, critics: Container[int]) -> None:
    """Give critics' parameters, known by their ids, a group of their own where one holds others too."""
    for group in list(optimizer.param_groups):
        own = [parameter for parameter in group["params"] if id(parameter) in critics]
        others = [parameter for parameter in group["params"] if id(parameter) not in critics]
        if own and others:
            group["params"] = others
            optimizer.param_groups.append({**group, "params": own})


def load_separated(optimizer: torch.optim.Optimizer, critics: Container[int]) -> None:
    """Let an optimizer load states also of a model whose critics had no group of their own, or alone had one.

    A hook of the optimizer, as torch refuses a state with another number of groups. It leaves states alone in which the
    critics' parameters are not the last ones.
    """

    def fit(optimizer: torch.optim.Optimizer, state: dict[str, Any]) -> dict[str, Any] | None:
        saved = state["param_groups"]
        if len(saved) == 2 and len(optimizer.param_groups) == 1:
            separate(optimizer, critics)
        sizes = [len(group["params"]) for group in optimizer.param_groups]
        if len(saved) != 1 or len(sizes) != 2 or len(saved[0]["params"]) != sum(sizes):
            return None
        order = saved[0]["params"]
        parts = [order[: sizes[0]], order[sizes[0] :]]
        return {**state, "param_groups": [{**saved[0], "params": part} for part in parts]}

    optimizer.register_load_state_dict_pre_hook(fit)


def set_rates(
    optimizer: torch.optim.Optimizer, critics: Container[int], critics_rate: float, epsilon: float | None
) -> None:
    """Give groups of critics alone their learning rate, and all others the ε ``epsilon``; None for the optimizer's.

    Raises:
        ValueError: an ε for an optimizer that has none.
    """
    for group in optimizer.param_groups:
        if all(id(parameter) in critics for parameter in group["params"]):
            group["lr"] = critics_rate
        else:
            _set_epsilon(group, epsilon)


def _set_epsilon(group: dict[str, Any], epsilon: float | None) -> None:
    if epsilon is not None:
        if not isinstance(group.get("eps"), float):
            raise ValueError("network_epsilon has no effect on an optimizer without an ε (eps): leave it out.")
        group.setdefault(_USUAL, group["eps"])
        group["eps"] = epsilon
    elif _USUAL in group:
        group["eps"] = group.pop(_USUAL)
