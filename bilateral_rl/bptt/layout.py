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

    @property
    def size(self) -> int:
        """Number of its numbers."""
        return math.prod(self.shape)

    @property
    def non_negative(self) -> bool:
        """Whether ``MotorNetwork.constrain`` keeps it at 0 or more."""
        return self.name.startswith("combination")


class Layout:
    """The flat row of a network: layer by layer, side by side, each kernel followed by its bias.

    That order makes every kernel with its bias one matrix, and all of a kind one array: what the Warp kernels read as
    ``Weights``, and where ``Rollout.backward`` writes gradients, are views of rows.

    Args:
        network: any network of the shape that is stacked.

    Attributes:
        shape: the network's shape.
        variables: in the order of the row; each is clipped by itself.
        regions: offset and shape of each part of a row that is used as one array: ``first`` (sides, n_inputs + 1,
            width), ``hidden`` ((layers - 1) · sides, width + 1, width), ``combination`` (2,) or (0,), ``output``
            (width + 1, n_outputs), with ``shape.width`` units; a layer's last row is its bias.
        width: numbers in a row, the last few unused.

    Raises:
        ValueError: the network has a parameter that the row has no place for.
    """

    def __init__(self, network: MotorNetwork) -> None:
        self.shape = NetworkShape.of(network)
        shapes = {name: tuple(reversed(parameter.shape)) for name, parameter in network.named_parameters()}
        self.variables: list[Variable] = []
        offset = 0
        for name in self._names():
            variable = Variable(name, network.group_of(name), offset, shapes.pop(name))
            self.variables.append(variable)
            offset += variable.size
        if shapes:
            raise ValueError(f"parameters without a place: {', '.join(shapes)}.")
        self.width = math.ceil(offset / _ALIGNMENT) * _ALIGNMENT
        self.regions = self._regions()

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
        return [*hidden, *combination, "output.weight", "output.bias"]

    def _regions(self) -> dict[str, tuple[int, tuple[int, ...]]]:
        n_inputs, n_outputs, width, layers, sides, _ = self.shape
        shapes: dict[str, tuple[int, ...]] = {
            "first": (sides, n_inputs + 1, width),
            "hidden": ((layers - 1) * sides, width + 1, width),
            "combination": (2 if sides == 2 else 0,),
            "output": (width + 1, n_outputs),
        }
        ends = itertools.accumulate(math.prod(shape) for shape in shapes.values())
        return {name: (end - math.prod(shape), shape) for (name, shape), end in zip(shapes.items(), ends, strict=True)}
