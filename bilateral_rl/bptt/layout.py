"""Where each parameter of a network lies in the flat row that stacked training keeps of it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from bilateral_rl.bptt.network_kernels import NetworkShape
from bilateral_rl.policies.motor_network import MotorNetwork
from bilateral_rl.vocabulary import SIDES

_ALIGNMENT = 16
"""A row's width is a multiple of this, so that all rows lie alike in memory and are summed alike."""


@dataclass(frozen=True)
class Variable:
    """A parameter of a network: the ``size`` numbers of its row from ``offset`` on."""

    name: str
    """Its name in the network's ``state_dict()``."""
    group: str
    """The parameter group that it belongs to, one of ``GROUPS``."""
    offset: int
    """Index of its first number in the row."""
    shape: tuple[int, ...]
    """Its shape in the row; a kernel is (inputs, units), the transpose of torch's."""
    fixed: bool = False
    """Whether it stays as it is: no loss moves it, and no penalty is taken of it."""

    @property
    def size(self) -> int:
        """Number of its numbers."""
        return math.prod(self.shape)

    @property
    def non_negative(self) -> bool:
        """Whether ``MotorNetwork.constrain`` keeps it at 0 or more."""
        return self.name.startswith("combination")


class Layout:
    """The flat row of a network: layer by layer, side by side or arm by arm, each kernel followed by its bias.

    That order makes every kernel with its bias one matrix, and all of a kind one array: what the Warp kernels read as
    ``Weights``, and where ``Rollout.backward`` writes gradients, are views of rows.

    Args:
        network: any network of the shape that is stacked.

    Attributes:
        shape: the network's shape.
        variables: in the order of the row; each is clipped by itself.
        regions: offset and shape of each part of a row that is used as one array: ``first`` (sides, n_seen + 1,
            width), ``hidden`` ((layers - 1) · sides, width + 1, width), ``combination`` (2, arms) or (0, arms),
            ``output`` (arms, width + 1, n_muscles), with ``shape.width`` units; a layer's last row is its bias.
        width: numbers in a row, the last few unused.
        free: (width,) bool, which of them are of variables that are not fixed.

    Raises:
        ValueError: the network has a parameter that the row has no place for.
    """

    def __init__(self, network: MotorNetwork) -> None:
        self.shape = NetworkShape.of(network)
        parameters = dict(network.named_parameters())
        self.variables: list[Variable] = []
        offset = 0
        for name in self._names():
            parameter = parameters.pop(name)
            shape, fixed = tuple(reversed(parameter.shape)), not parameter.requires_grad
            variable = Variable(name, network.group_of(name), offset, shape, fixed)
            self.variables.append(variable)
            offset += variable.size
        if parameters:
            raise ValueError(f"parameters without a place: {', '.join(parameters)}.")
        self.width = math.ceil(offset / _ALIGNMENT) * _ALIGNMENT
        self.regions = self._regions()
        self.free = torch.zeros(self.width, dtype=torch.bool)
        for v in self.variables:
            self.free[v.offset : v.offset + v.size] = not v.fixed

    def region(self, rows: Tensor, name: str) -> Tensor:
        """Return a view (…, *shape) of one of ``regions`` in every row of ``rows`` (…, width)."""
        offset, shape = self.regions[name]
        return rows[..., offset : offset + math.prod(shape)].view(*rows.shape[:-1], *shape)

    def pack(self, states: Sequence[Mapping[str, Tensor]]) -> Tensor:
        """Return the rows (S, width) of networks with these ``state_dict()``."""
        rows = torch.zeros(len(states), self.width)
        for row, state in zip(rows, states, strict=True):
            for v in self.variables:
                row[v.offset : v.offset + v.size] = state[v.name].detach().t().reshape(-1)
        return rows

    def unpack(self, rows: Tensor) -> dict[str, Tensor]:
        """Return the stacked parameters (S, …) of ``rows`` (S, width) by name, as a ``state_dict()`` shapes each."""
        parameters = {}
        for v in self.variables:
            values = rows[:, v.offset : v.offset + v.size].reshape(-1, *v.shape)
            parameters[v.name] = values.transpose(1, -1).contiguous() if len(v.shape) > 1 else values.clone()
        return parameters

    def _names(self) -> list[str]:
        """Return the names of all parameters in the order of the row."""
        stacks = ("hidden",) if self.shape.sides == 1 else SIDES
        hidden = [f"{s}.{k}.{part}" for k in range(self.shape.layers) for s in stacks for part in ("weight", "bias")]
        combination = [f"combination_{side}" for side in SIDES] if self.shape.sides == 2 else []
        layers = ("output",) if self.shape.arms == 1 else [f"output.{arm}" for arm in SIDES]
        return [*hidden, *combination, *(f"{layer}.{part}" for layer in layers for part in ("weight", "bias"))]

    def _regions(self) -> dict[str, tuple[int, tuple[int, ...]]]:
        _, _, width, layers, sides, _, arms = self.shape
        shapes: dict[str, tuple[int, ...]] = {
            "first": (sides, self.shape.n_seen + 1, width),
            "hidden": ((layers - 1) * sides, width + 1, width),
            "combination": (2 if sides == 2 else 0, arms),
            "output": (arms, width + 1, self.shape.n_muscles),
        }
        ends = itertools.accumulate(math.prod(shape) for shape in shapes.values())
        return {name: (end - math.prod(shape), shape) for (name, shape), end in zip(shapes.items(), ends, strict=True)}
