"""Where each parameter of a network lies in the flat row that stacked training keeps of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from bilateral_rl.bptt.network_kernels import NetworkShape
from bilateral_rl.policies.networks import MotorNetwork
from bilateral_rl.vocabulary import SIDES

_ALIGNMENT = 16
"""Numbers a row is a multiple of, so that all rows lie alike in memory and are summed alike."""


@dataclass(frozen=True)
class Variable:
    """A parameter: ``size`` numbers of the row from ``offset`` on."""

    name: str
    """In the network's ``state_dict()``."""
    group: str
    """Of ``GROUPS``."""
    offset: int
    shape: tuple[int, ...]
    """In the row; a kernel is (inputs, units), the transpose of torch's."""

    @property
    def size(self) -> int:
        """How many numbers."""
        return math.prod(self.shape)

    @property
    def non_negative(self) -> bool:
        """Whether ``MotorNetwork.constrain`` keeps it at 0 or more."""
        return self.name.startswith("combination")


class Region(NamedTuple):
    """Variables that lie side by side and are used as one array of ``shape``, in the row from ``offset`` on."""

    offset: int
    shape: tuple[int, ...]


class Layout:
    """The flat row of a network: layer by layer, side by side, each kernel followed by its bias.

    Args:
        network: any network of the shape that is stacked.

    Attributes:
        variables: in the order of the row; each is clipped by itself.
        regions: the row as kernels and gradients see it: ``first`` (sides, n_inputs + 1, width), ``hidden``
            ((layers - 1) · sides, width + 1, width), ``combination`` (2,) or (0,), ``output`` (width + 1, n_outputs);
            a layer's last row is its bias.
        width: numbers in a row, the last few unused.
    """

    def __init__(self, network: MotorNetwork) -> None:
        self.shape = NetworkShape.of(network)
        prefixes = ("hidden",) if self.shape.sides == 1 else SIDES
        sizes = {name: tuple(reversed(parameter.shape)) for name, parameter in network.named_parameters()}
        names = [f"{p}.{k}.{part}" for k in range(self.shape.layers) for p in prefixes for part in ("weight", "bias")]
        if self.shape.sides == 2:
            names += [f"combination_{side}" for side in SIDES]
        names += ["output.weight", "output.bias"]
        self.variables: list[Variable] = []
        offset = 0
        for name in names:
            variable = Variable(name, network.group_of(name), offset, sizes.pop(name))
            self.variables.append(variable)
            offset += variable.size
        if sizes:
            raise ValueError(f"parameters without a place: {', '.join(sizes)}.")
        self.width = math.ceil(offset / _ALIGNMENT) * _ALIGNMENT
        self.regions = self._regions()

    def region(self, rows: Tensor, name: str) -> Tensor:
        """A view (…, *shape) of one of ``regions`` in every row of ``rows`` (…, width)."""
        offset, shape = self.regions[name]
        return rows[..., offset : offset + math.prod(shape)].view(*rows.shape[:-1], *shape)

    def pack(self, states: Sequence[Mapping[str, Tensor]]) -> Tensor:
        """(S, width): the rows of networks with these ``state_dict()``."""
        rows = torch.zeros(len(states), self.width)
        for row, state in zip(rows, states, strict=True):
            for v in self.variables:
                row[v.offset : v.offset + v.size] = state[v.name].detach().t().reshape(-1)
        return rows

    def unpack(self, rows: Tensor) -> dict[str, Tensor]:
        """The stacked parameters (S, …) by name, as the network's ``state_dict()`` shapes each."""
        return {
            v.name: rows[:, v.offset : v.offset + v.size].reshape(-1, *v.shape).transpose(1, -1).contiguous()
            if len(v.shape) > 1
            else rows[:, v.offset : v.offset + v.size].reshape(-1, *v.shape).clone()
            for v in self.variables
        }

    def _regions(self) -> dict[str, Region]:
        n_inputs, n_outputs, width, layers, sides, _ = self.shape
        shapes: dict[str, tuple[int, ...]] = {
            "first": (sides, n_inputs + 1, width),
            "hidden": ((layers - 1) * sides, width + 1, width),
            "combination": (2 if sides == 2 else 0,),
            "output": (width + 1, n_outputs),
        }
        regions, offset = {}, 0
        for name, shape in shapes.items():
            regions[name] = Region(offset, shape)
            offset += math.prod(shape)
        return regions
