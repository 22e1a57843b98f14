"""The paper's three controllers as plain torch modules (paper section 1)."""

from __future__ import annotations

import contextlib
from abc import ABC, abstractmethod
from collections.abc import Iterator

import torch
from torch import Tensor, nn

from bilateral_rl.policies.hidden_noise import HiddenNoise
from bilateral_rl.policies.lesions import LESIONS, NO_LESION, Lesion, find_lesion
from bilateral_rl.policies.quantities import finite, whole
from bilateral_rl.vocabulary import GROUPS, SIDES, Architecture, Side


class MotorNetwork(nn.Module, ABC):
    """A controller from observation to muscle excitation; base class of the three architectures.

    ``forward`` gives the output layer's values before the sigmoid, :meth:`excitation` the sigmoid of them. Both are
    without noise unless they are given what ``noise.draw`` draws, as the policies do for every action.

    Args:
        n_inputs: size of the observation.
        n_outputs: number of muscles.
        units: units per hidden layer, over both sides (U).
        layers: hidden layers (L).
        hidden_noise: standard deviation of the noise on each hidden unit's activity.

    Attributes:
        lesion: the present lesion; set it with :meth:`set_lesion` or :meth:`lesioned`.
        noise: what the noise of the hidden units is drawn from.

    Raises:
        ValueError: sizes that the architecture cannot have.
    """

    architecture: Architecture
    sides: int = 1
    """Stacks of hidden layers beside each other."""

    def __init__(
        self, n_inputs: int, n_outputs: int, units: int = 10, layers: int = 2, hidden_noise: float = 0.0
    ) -> None:
        super().__init__()
        self.n_inputs, self.n_outputs = whole("n_inputs", n_inputs), whole("n_outputs", n_outputs)
        self.units, self.layers = whole("units", units), whole("layers", layers)
        self.lesion = NO_LESION
        self.noise = HiddenNoise(finite("hidden_noise", hidden_noise, 0.0), self.hidden_shape)

    @property
    def hidden_shape(self) -> tuple[int, int]:
        """``(layers · sides, width)``: the hidden units, layer by layer, in each the dominant side first."""
        return self.layers * self.sides, self.units // self.sides

    @abstractmethod
    def forward(self, observation: Tensor, noise: Tensor | None = None) -> Tensor:
        """Map observations (…, n_inputs) to muscle commands before the sigmoid (…, n_outputs).

        Args:
            observation: (…, n_inputs).
            noise: (…, layers · sides, width), what is added to the activity of each hidden unit; None for nothing.
        """

    def hidden_layers(self, observation: Tensor, noise: Tensor | None = None) -> list[tuple[Tensor, ...]]:
        """Map observations (…, n_inputs) to the activity of each hidden layer, with the present lesion.

        Args:
            observation: (…, n_inputs).
            noise: (…, layers · sides, width), what is added to the activity of each hidden unit; None for nothing.

        Returns:
            For each layer, the activity of the dominant and the non-dominant side (…, U/2), or of the only one (…, U);
            nothing where an architecture of one's own does not tell.
        """
        return []

    def excitation(self, observation: Tensor, noise: Tensor | None = None) -> Tensor:
        """Map observations (…, n_inputs) to muscle excitations (…, n_outputs) in [0, 1].

        Args:
            observation: (…, n_inputs).
            noise: as in :meth:`forward`.
        """
        return torch.sigmoid(self(observation, noise))

    @abstractmethod
    def group_of(self, name: str) -> str:
        """Return which of ``GROUPS`` owns the parameter called ``name`` in ``named_parameters()``."""

    def parameter_groups(self) -> dict[str, list[nn.Parameter]]:
        """Return the parameters of each group; a group may be empty."""
        groups: dict[str, list[nn.Parameter]] = {group: [] for group in GROUPS}
        for name, parameter in self.named_parameters():
            groups[self.group_of(name)].append(parameter)
        return groups

    def constrain(self) -> None:
        """Project the parameters back onto their allowed set, after every update; here every value is allowed."""

    def combination_weights(self) -> dict[Side, float]:
        """Return the weight of each side in the combination; empty for a network without sides."""
        return {}

    def available_lesions(self) -> tuple[str, ...]:
        """Return the names of the lesions that the architecture can have; here none."""
        return ()

    def set_lesion(self, lesion: str | Lesion) -> None:
        """Lesion the network, or restore it with ``"intact"``; weights are untouched.

        Raises:
            ValueError: a lesion that is unknown or that this architecture cannot have.
        """
        new_lesion = find_lesion(lesion) if isinstance(lesion, str) else lesion
        self._check_lesion(new_lesion, str(lesion))
        self.lesion = new_lesion

    @contextlib.contextmanager
    def lesioned(self, lesion: str | Lesion) -> Iterator[None]:
        """Lesion the network within a ``with`` block; afterwards it is as it was before.

        Raises:
            ValueError: a lesion that is unknown or that this architecture cannot have.
        """
        before = self.lesion
        self.set_lesion(lesion)
        try:
            yield
        finally:
            self.lesion = before

    def extra_repr(self) -> str:
        """Return what torch shows besides the layers."""
        return f"hidden_noise={self.noise.std:g}" if self.noise.std else ""

    def _check_lesion(self, lesion: Lesion, name: str) -> None:
        """Raise a ValueError, in which the lesion is called ``name``, if the architecture cannot have it."""
        if lesion != NO_LESION:
            raise ValueError(f"a {self.architecture} network has no hemispheres to lesion ({name}).")


class UnilateralNetwork(MotorNetwork):
    """Dense layers n_inputs → U → … → U → n_outputs, tanh in between; every parameter is shared."""

    architecture: Architecture = "unilateral"

    def __init__(
        self, n_inputs: int, n_outputs: int, units: int = 10, layers: int = 2, hidden_noise: float = 0.0
    ) -> None:
        super().__init__(n_inputs, n_outputs, units, layers, hidden_noise)
        self.hidden = _stack(n_inputs, units, layers)
        self.output = _dense(units, n_outputs)

    def forward(self, observation: Tensor, noise: Tensor | None = None) -> Tensor:
        """Map observations (…, n_inputs) to muscle commands before the sigmoid (…, n_outputs)."""
        (h,) = self.hidden_layers(observation, noise)[-1]
        output: Tensor = self.output(h)
        return output

    def hidden_layers(self, observation: Tensor, noise: Tensor | None = None) -> list[tuple[Tensor, ...]]:
        """Map observations (…, n_inputs) to the activity (…, U) of each hidden layer, in tuples of one."""
        h = observation
        layers: list[tuple[Tensor, ...]] = []
        for k, layer in enumerate(self.hidden):
            h = torch.tanh(layer(h))  # (…, U)
            if noise is not None:
                h = h + noise[..., k, :]
            layers.append((h,))
        return layers

    def group_of(self, name: str) -> str:
        """Return "shared": there are no sides to own a parameter."""
        return "shared"


class BilateralNetwork(MotorNetwork):
    """Two stacks n_inputs → U/2 → … → U/2 that see the same input, combined by two weights that stay ≥ 0.

    The last hidden layers enter the output layer as w_dominant · h_dominant + w_non_dominant · h_non_dominant.
    """

    architecture: Architecture = "bilateral"
    sides = len(SIDES)

    def __init__(
        self, n_inputs: int, n_outputs: int, units: int = 10, layers: int = 2, hidden_noise: float = 0.0
    ) -> None:
        super().__init__(n_inputs, n_outputs, units, layers, hidden_noise)
        if units % 2:
            raise ValueError(f"a {self.architecture} network splits its units over two sides: {units} is odd.")
        half = units // 2
        self.dominant = _stack(n_inputs, half, layers)
        self.non_dominant = _stack(n_inputs, half, layers)
        self.combination_dominant = nn.Parameter(torch.tensor(0.5))
        self.combination_non_dominant = nn.Parameter(torch.tensor(0.5))
        self.output = _dense(half, n_outputs)

    def forward(self, observation: Tensor, noise: Tensor | None = None) -> Tensor:
        """Map observations (…, n_inputs) to muscle commands before the sigmoid (…, n_outputs)."""
        d, n = self.hemispheres(observation, noise)
        # A side with a deep lesion is left out of the sum, but has sent its activity over the callosum.
        combined = torch.zeros_like(d)  # (…, U/2)
        if self.lesion.output_of != "dominant":
            combined = combined + self.combination_dominant * d
        if self.lesion.output_of != "non_dominant":
            combined = combined + self.combination_non_dominant * n
        output: Tensor = self.output(combined)
        return output

    def hemispheres(self, observation: Tensor, noise: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Map observations (…, n_inputs) to the last hidden layers, dominant and non-dominant, (…, U/2) each."""
        d, n = self.hidden_layers(observation, noise)[-1]
        return d, n

    def hidden_layers(self, observation: Tensor, noise: Tensor | None = None) -> list[tuple[Tensor, ...]]:
        """Map observations (…, n_inputs) to the activity (…, U/2) of each hidden layer, dominant and non-dominant.

        It is what a side's own units do, before anything of the other side is added to it on the way to the next layer.
        """
        lesion = self.lesion
        layers: list[tuple[Tensor, ...]] = []
        # A side with a shallow lesion sees zeros; its biases still drive it.
        d = torch.zeros_like(observation) if lesion.input_of == "dominant" else observation
        n = torch.zeros_like(observation) if lesion.input_of == "non_dominant" else observation
        for k, (dominant, non_dominant) in enumerate(zip(self.dominant, self.non_dominant, strict=True)):
            if k > 0:  # before the first layer there is no activity yet to tell the other side
                d, n = self._exchange(d, n)
            d, n = torch.tanh(dominant(d)), torch.tanh(non_dominant(n))  # (…, U/2) each
            if noise is not None:
                d, n = d + noise[..., 2 * k, :], n + noise[..., 2 * k + 1, :]
            layers.append((d, n))
        return layers

    def group_of(self, name: str) -> str:
        """Return the side whose stack holds the parameter; combination and output layers are "shared"."""
        prefix = name.split(".")[0]
        return prefix if prefix in SIDES else "shared"

    def constrain(self) -> None:
        """Set negative combination weights to zero, unless they are frozen and require no gradient."""
        with torch.no_grad():
            for weight in (self.combination_dominant, self.combination_non_dominant):
                if weight.requires_grad:
                    weight.clamp_(min=0.0)

    def combination_weights(self) -> dict[Side, float]:
        """Return the weight of each side in the combination."""
        return {
            "dominant": float(self.combination_dominant.detach()),
            "non_dominant": float(self.combination_non_dominant.detach()),
        }

    def available_lesions(self) -> tuple[str, ...]:
        """Return the names of the lesions that leave the callosum alone, for there is none."""
        return tuple(name for name, lesion in LESIONS.items() if not lesion.callosum)

    def _exchange(self, dominant: Tensor, non_dominant: Tensor) -> tuple[Tensor, Tensor]:
        """Return the sides' activities (…, U/2) as they enter the next layer; without a callosum, unchanged."""
        return dominant, non_dominant

    def _check_lesion(self, lesion: Lesion, name: str) -> None:
        """Raise a ValueError for a lesion of the callosum, which there is none of."""
        if lesion.callosum:
            raise ValueError(f"a {self.architecture} network has no callosum to lesion ({name}).")


class CallosalNetwork(BilateralNetwork):
    """A bilateral network whose sides exchange pooled activity before every hidden layer but the first.

    Each side receives the other's previous layer, max-pooled by two (an odd last unit dropped), added to its own last
    units. Both directions use the values from before the exchange. The exchange has no parameters.
    """

    architecture: Architecture = "callosal"

    def __init__(
        self, n_inputs: int, n_outputs: int, units: int = 10, layers: int = 2, hidden_noise: float = 0.0
    ) -> None:
        super().__init__(n_inputs, n_outputs, units, layers, hidden_noise)
        if units < 4:
            raise ValueError(f"a callosal network needs at least 4 units, two a side to pool, got {units}.")
        if layers < 2:
            raise ValueError(f"a callosal network needs at least 2 hidden layers to exchange between, got {layers}.")

    def available_lesions(self) -> tuple[str, ...]:
        """Return the names of all lesions."""
        return tuple(LESIONS)

    def _exchange(self, dominant: Tensor, non_dominant: Tensor) -> tuple[Tensor, Tensor]:
        """Return the sides' activities (…, U/2), each with what it receives from the other over the callosum."""
        if self.lesion.callosum:
            return dominant, non_dominant
        return _receive(dominant, non_dominant), _receive(non_dominant, dominant)

    def _check_lesion(self, lesion: Lesion, name: str) -> None:
        """Accept every lesion."""


def _receive(receiver: Tensor, sender: Tensor) -> Tensor:
    """Add the pooled activity of ``sender`` (…, n) to the last ⌊n/2⌋ units of ``receiver`` (…, n).

    Pooled is the larger of each two neighboring units. With n = 5, a sender of [1, 5, 2, 3, 9] has two pairs, (1, 5)
    and (2, 3); its odd last unit is dropped, however active. The receiver's five units get [0, 0, 0, 5, 3]: the
    pooled values, [5, 3], join the last two.
    """
    n_pooled = receiver.shape[-1] // 2
    pooled = torch.maximum(sender[..., 0 : 2 * n_pooled : 2], sender[..., 1 : 2 * n_pooled : 2])  # (…, ⌊n/2⌋)
    n_alone = receiver.shape[-1] - n_pooled
    return torch.cat([receiver[..., :n_alone], receiver[..., n_alone:] + pooled], dim=-1)


def _stack(n_inputs: int, width: int, layers: int) -> nn.ModuleList:
    """Build dense layers n_inputs → width → … → width."""
    return nn.ModuleList(_dense(n_inputs if k == 0 else width, width) for k in range(layers))


def _dense(n_inputs: int, n_outputs: int) -> nn.Linear:
    """Build a dense layer with a Glorot-uniform kernel and zero bias, as in the paper's code."""
    layer = nn.Linear(n_inputs, n_outputs)
    nn.init.xavier_uniform_(layer.weight)
    nn.init.zeros_(layer.bias)
    return layer


ARCHITECTURES: dict[Architecture, type[MotorNetwork]] = {
    "unilateral": UnilateralNetwork,
    "bilateral": BilateralNetwork,
    "callosal": CallosalNetwork,
}
"""The class of each architecture."""


def make_network(
    architecture: Architecture,
    n_inputs: int,
    n_outputs: int,
    units: int = 10,
    layers: int = 2,
    hidden_noise: float = 0.0,
) -> MotorNetwork:
    """Build a network with random weights; the arguments are those of :class:`MotorNetwork`.

    Raises:
        ValueError: an unknown architecture, or sizes that it cannot have.
    """
    if architecture not in ARCHITECTURES:
        raise ValueError(f"unknown architecture {architecture!r}; choose from {', '.join(ARCHITECTURES)}.")
    return ARCHITECTURES[architecture](n_inputs, n_outputs, units, layers, hidden_noise)
