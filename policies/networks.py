"""The paper's three controllers as plain torch modules (paper section 1)."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import torch
from torch import Tensor, nn

from bilateral_rl.policies.lesions import LESIONS, NO_LESION, Lesion, find_lesion
from bilateral_rl.vocabulary import GROUPS, SIDES, Architecture, Side


class MotorNetwork(nn.Module):
    """A controller from observation to muscle excitation: what the three architectures have in common.

    ``forward`` gives the output layer's values before the sigmoid, :meth:`excitation` the sigmoid of them.

    Args:
        n_inputs: size of the observation.
        n_outputs: number of muscles.
        units: units per hidden layer, over both sides (U).
        layers: hidden layers (L).

    Attributes:
        lesion: what is taken away at present; set it with :meth:`set_lesion` or :meth:`lesioned`.

    Raises:
        ValueError: sizes that the architecture cannot have.
    """

    architecture: Architecture

    def __init__(self, n_inputs: int, n_outputs: int, units: int = 10, layers: int = 2) -> None:
        super().__init__()
        for name, value in (("n_inputs", n_inputs), ("n_outputs", n_outputs), ("units", units), ("layers", layers)):
            if value < 1:
                raise ValueError(f"{name} must be at least 1, got {value}.")
        self.n_inputs, self.n_outputs, self.units, self.layers = n_inputs, n_outputs, units, layers
        self.lesion = NO_LESION

    def forward(self, observation: Tensor) -> Tensor:
        """(…, n_inputs) to (…, n_outputs), before the sigmoid."""
        raise NotImplementedError

    def excitation(self, observation: Tensor) -> Tensor:
        """(…, n_inputs) to muscle excitations (…, n_outputs) in [0, 1]."""
        return torch.sigmoid(self(observation))

    def group_of(self, name: str) -> str:
        """The group, of ``GROUPS``, of the parameter called ``name`` in ``named_parameters()``."""
        raise NotImplementedError

    def parameter_groups(self) -> dict[str, list[nn.Parameter]]:
        """The parameters of each group; a group may be empty."""
        groups: dict[str, list[nn.Parameter]] = {group: [] for group in GROUPS}
        for name, parameter in self.named_parameters():
            groups[self.group_of(name)].append(parameter)
        return groups

    def constrain(self) -> None:
        """Project the parameters back onto their allowed set; call it after every update."""

    def available_lesions(self) -> tuple[str, ...]:
        """Names of the lesions that the architecture can have."""
        return ()

    def set_lesion(self, lesion: str | Lesion) -> None:
        """Lesion the network, or restore it with ``"intact"``; weights are untouched.

        Raises:
            ValueError: a lesion that is unknown or that this architecture cannot have.
        """
        found = find_lesion(lesion) if isinstance(lesion, str) else lesion
        self._check_lesion(found, str(lesion))
        self.lesion = found

    @contextlib.contextmanager
    def lesioned(self, lesion: str | Lesion) -> Iterator[None]:
        """A context in which the network has ``lesion``; afterwards it has whatever it had before."""
        before = self.lesion
        self.set_lesion(lesion)
        try:
            yield
        finally:
            self.lesion = before

    def _check_lesion(self, lesion: Lesion, name: str) -> None:
        if lesion != NO_LESION:
            raise ValueError(f"a {self.architecture} network has no hemispheres to lesion ({name}).")


class UnilateralNetwork(MotorNetwork):
    """Dense layers n_inputs → U → … → U → n_outputs, tanh in between; every parameter is shared."""

    architecture: Architecture = "unilateral"

    def __init__(self, n_inputs: int, n_outputs: int, units: int = 10, layers: int = 2) -> None:
        super().__init__(n_inputs, n_outputs, units, layers)
        self.hidden = _stack(n_inputs, units, layers)
        self.output = _dense(units, n_outputs)

    def forward(self, observation: Tensor) -> Tensor:
        h = observation
        for layer in self.hidden:
            h = torch.tanh(layer(h))
        output: Tensor = self.output(h)
        return output

    def group_of(self, name: str) -> str:
        return "shared"


class BilateralNetwork(MotorNetwork):
    """Two stacks n_inputs → U/2 → … → U/2 that see the same input, combined by two weights that stay ≥ 0.

    The last hidden layers enter the output layer as w_dominant · h_dominant + w_non_dominant · h_non_dominant.
    """

    architecture: Architecture = "bilateral"

    def __init__(self, n_inputs: int, n_outputs: int, units: int = 10, layers: int = 2) -> None:
        super().__init__(n_inputs, n_outputs, units, layers)
        if units % 2:
            raise ValueError(f"a {self.architecture} network splits its units over two sides: {units} is odd.")
        half = units // 2
        self.dominant = _stack(n_inputs, half, layers)
        self.non_dominant = _stack(n_inputs, half, layers)
        self.combination_dominant = nn.Parameter(torch.tensor(0.5))
        self.combination_non_dominant = nn.Parameter(torch.tensor(0.5))
        self.output = _dense(half, n_outputs)

    def forward(self, observation: Tensor) -> Tensor:
        d, n = self.hemispheres(observation)
        combined = torch.zeros_like(d)
        if self.lesion.output_of != "dominant":
            combined = combined + self.combination_dominant * d
        if self.lesion.output_of != "non_dominant":
            combined = combined + self.combination_non_dominant * n
        output: Tensor = self.output(combined)
        return output

    def hemispheres(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        """(…, n_inputs) to the last hidden layers of the dominant and the non-dominant side, (…, units / 2) each."""
        lesion = self.lesion
        d = torch.zeros_like(observation) if lesion.input_of == "dominant" else observation
        n = torch.zeros_like(observation) if lesion.input_of == "non_dominant" else observation
        for k, (dominant, non_dominant) in enumerate(zip(self.dominant, self.non_dominant, strict=True)):
            if k > 0:
                d, n = self._exchange(d, n)
            d, n = torch.tanh(dominant(d)), torch.tanh(non_dominant(n))
        return d, n

    def group_of(self, name: str) -> str:
        side = name.split(".")[0]
        return side if side in SIDES else "shared"

    def constrain(self) -> None:
        with torch.no_grad():
            self.combination_dominant.clamp_(min=0.0)
            self.combination_non_dominant.clamp_(min=0.0)

    def available_lesions(self) -> tuple[str, ...]:
        return tuple(name for name, lesion in LESIONS.items() if not lesion.callosum)

    def combination_weights(self) -> dict[Side, float]:
        """The two combination weights."""
        return {
            "dominant": float(self.combination_dominant.detach()),
            "non_dominant": float(self.combination_non_dominant.detach()),
        }

    def _exchange(self, dominant: Tensor, non_dominant: Tensor) -> tuple[Tensor, Tensor]:
        """What the sides tell each other before hidden layer k ≥ 1: nothing, without a callosum."""
        return dominant, non_dominant

    def _check_lesion(self, lesion: Lesion, name: str) -> None:
        if lesion.callosum:
            raise ValueError(f"a {self.architecture} network has no callosum to lesion ({name}).")


class CallosalNetwork(BilateralNetwork):
    """A bilateral network whose sides exchange pooled activity before every hidden layer but the first.

    Each side receives the other's previous layer, max-pooled by two (an odd last unit dropped), added to its own last
    units. Both directions use the values from before the exchange. There are no parameters more.
    """

    architecture: Architecture = "callosal"

    def __init__(self, n_inputs: int, n_outputs: int, units: int = 10, layers: int = 2) -> None:
        super().__init__(n_inputs, n_outputs, units, layers)
        if units < 4:
            raise ValueError(f"a callosal network needs at least 4 units, two a side to pool, got {units}.")
        if layers < 2:
            raise ValueError(f"a callosal network needs at least 2 hidden layers to exchange between, got {layers}.")

    def available_lesions(self) -> tuple[str, ...]:
        return tuple(LESIONS)

    def _exchange(self, dominant: Tensor, non_dominant: Tensor) -> tuple[Tensor, Tensor]:
        if self.lesion.callosum:
            return dominant, non_dominant
        return _receive(dominant, non_dominant), _receive(non_dominant, dominant)

    def _check_lesion(self, lesion: Lesion, name: str) -> None:
        """A callosal network can have every lesion."""


def _receive(own: Tensor, other: Tensor) -> Tensor:
    """``own`` (…, n) plus, on its last ⌊n/2⌋ units, the max-pooled ``other``."""
    n_pooled = own.shape[-1] // 2
    pooled = torch.maximum(other[..., 0 : 2 * n_pooled : 2], other[..., 1 : 2 * n_pooled : 2])
    n_kept = own.shape[-1] - n_pooled
    return torch.cat([own[..., :n_kept], own[..., n_kept:] + pooled], dim=-1)


def _stack(n_inputs: int, width: int, layers: int) -> nn.ModuleList:
    return nn.ModuleList(_dense(n_inputs if k == 0 else width, width) for k in range(layers))


def _dense(n_inputs: int, n_outputs: int) -> nn.Linear:
    """Glorot-uniform kernel, zero bias."""
    layer = nn.Linear(n_inputs, n_outputs)
    nn.init.xavier_uniform_(layer.weight)
    nn.init.zeros_(layer.bias)
    return layer


ARCHITECTURES: dict[Architecture, type[MotorNetwork]] = {
    "unilateral": UnilateralNetwork,
    "bilateral": BilateralNetwork,
    "callosal": CallosalNetwork,
}


def make_network(
    architecture: Architecture, n_inputs: int, n_outputs: int, units: int = 10, layers: int = 2
) -> MotorNetwork:
    """Build a network. Raises ValueError for an unknown architecture or sizes it cannot have."""
    if architecture not in ARCHITECTURES:
        raise ValueError(f"unknown architecture {architecture!r}; choose from {', '.join(ARCHITECTURES)}.")
    return ARCHITECTURES[architecture](n_inputs, n_outputs, units, layers)
