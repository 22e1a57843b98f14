"""The paper's three controllers as plain torch modules (paper section 1), for one arm or for two."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from bilateral_rl.policies.arms import crossed, paths
from bilateral_rl.policies.lesions import LESIONS, Lesion
from bilateral_rl.policies.motor_network import MotorNetwork
from bilateral_rl.vocabulary import SIDES, Architecture, Side


class UnilateralNetwork(MotorNetwork):
    """Dense layers n_inputs → U → … → U → n_outputs, tanh in between; every parameter is shared.

    With two arms, all of it sees the views of both, and commands both.
    """

    architecture: Architecture = "unilateral"

    def _build(self) -> None:
        self.hidden = _stack(self.n_inputs, self.units, self.layers)
        self.output = _dense(self.units, self.n_outputs)

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

    With two arms, each stack sees the view of the arm opposite to it (n_inputs / 2), which for the dominant hemisphere
    is the dominant one, and each arm has such a combination and an output layer (n_outputs / 2) of its own. Its weights
    are 1 − i for the opposite hemisphere and i for that of its own side, ``ipsilateral_share``, and fixed unless
    ``trained_combination``.
    """

    architecture: Architecture = "bilateral"
    sides = len(SIDES)

    def _build(self) -> None:
        if self.units % 2:
            raise ValueError(f"a {self.architecture} network splits its units over two sides: {self.units} is odd.")
        half = self.units // 2
        self.dominant = _stack(self.n_inputs_per_arm, half, self.layers)
        self.non_dominant = _stack(self.n_inputs_per_arm, half, self.layers)
        self.combination_dominant = self._combination("dominant")
        self.combination_non_dominant = self._combination("non_dominant")
        self.output = self._output(half)
        self._paths = paths(self.n_arms, self.ipsilateral_share)

    def _combination(self, side: Side) -> nn.Parameter:
        """Return a side's weight in the commands (), or with two arms its weights in those to each (2,)."""
        if self.ipsilateral_share is None:
            return nn.Parameter(torch.tensor(0.5))
        weights = torch.tensor(crossed(side, self.ipsilateral_share))
        return nn.Parameter(weights, requires_grad=bool(self.trained_combination))

    def _output(self, width: int) -> nn.Module:
        """Build the output layer, or with two arms one for each."""
        if self.n_arms == 1:
            return _dense(width, self.n_outputs)
        return nn.ModuleDict({arm: _dense(width, self.n_outputs_per_arm) for arm in SIDES})

    @property
    def output_layers(self) -> tuple[nn.Linear, ...]:
        """The output layer of each arm, from U/2 units to n_outputs / n_arms muscles."""
        layers = [self.output] if self.n_arms == 1 else [self.output.get_submodule(arm) for arm in SIDES]
        return tuple(layers)  # type: ignore[arg-type] # torch: "modules"

    def forward(self, observation: Tensor, noise: Tensor | None = None) -> Tensor:
        """Map observations (…, n_inputs) to muscle commands before the sigmoid (…, n_outputs)."""
        d, n = self.hemispheres(observation, noise)
        if self.n_arms == 1:
            output: Tensor = self.output(self._combined(0, d, n))
            return output
        return torch.cat([layer(self._combined(arm, d, n)) for arm, layer in enumerate(self.output_layers)], dim=-1)

    def contributions(self, observation: Tensor, noise: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Return what each side adds to the muscle commands before the sigmoid (…, n_outputs), with the present lesion.

        That is its last hidden layer times its combination weight, through the output layer without its bias.
        """
        d, n = self.hemispheres(observation, noise)
        return self._contribution("dominant", d), self._contribution("non_dominant", n)

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
        d, n = self._views(observation)
        d = torch.zeros_like(d) if lesion.input_of == "dominant" else d
        n = torch.zeros_like(n) if lesion.input_of == "non_dominant" else n
        for k, (dominant, non_dominant) in enumerate(zip(self.dominant, self.non_dominant, strict=True)):
            if k > 0:  # before the first layer there is no activity yet to tell the other side
                d, n = self._exchange(d, n)
            d, n = torch.tanh(dominant(d)), torch.tanh(non_dominant(n))  # (…, U/2) each
            if noise is not None:
                d, n = d + noise[..., 2 * k, :], n + noise[..., 2 * k + 1, :]
            layers.append((d, n))
        return layers

    def group_of(self, name: str) -> str:
        """Return the side whose stack holds the parameter; combination and output layers are "shared".

        Without a path to the arm of its own side, a hemisphere owns the output layer that it alone commands.
        """
        prefix, _, rest = name.partition(".")
        if self.ipsilateral_share == 0:
            prefix = rest.partition(".")[0] if prefix == "output" else prefix.removeprefix("combination_")
        return prefix if prefix in SIDES else "shared"

    def constrain(self) -> None:
        """Set negative combination weights to zero, unless they are fixed or frozen and require no gradient."""
        with torch.no_grad():
            for weight in (self.combination_dominant, self.combination_non_dominant):
                if weight.requires_grad:
                    weight.clamp_(min=0.0)

    def combination_weights(self) -> dict[str, float]:
        """Return the weight of each side in the combination; with two arms in that of each arm to which it has a path.

        With two arms, the names are ``"dominant_arm/non_dominant"`` and so on, first the arm's and then the side's.
        """
        return {name: float(self._weight(side, arm).detach()) for name, (arm, side) in self._paths.items()}

    def available_lesions(self) -> tuple[str, ...]:
        """Return the names of the lesions that leave the callosum alone, for there is none."""
        return tuple(name for name, lesion in LESIONS.items() if not lesion.callosum)

    def _weight(self, side: Side, arm: int) -> Tensor:
        """Return the weight () of a side in the combination of an arm."""
        weight = self.combination_dominant if side == "dominant" else self.combination_non_dominant
        return weight if self.n_arms == 1 else weight[arm]

    def _sends(self, side: Side, arm: int) -> bool:
        """Whether a side has a path to an arm, and no lesion that cuts it."""
        return self.lesion.output_of != side and (arm, side) in self._paths.values()

    def _combined(self, arm: int, dominant: Tensor, non_dominant: Tensor) -> Tensor:
        """Return what enters an arm's output layer (…, U/2), from the last hidden layers."""
        # A side with a deep lesion is left out of the sum, but has sent its activity over the callosum.
        combined = torch.zeros_like(dominant)
        if self._sends("dominant", arm):
            combined = combined + self._weight("dominant", arm) * dominant
        if self._sends("non_dominant", arm):
            combined = combined + self._weight("non_dominant", arm) * non_dominant
        return combined

    def _contribution(self, side: Side, h: Tensor) -> Tensor:
        """Return what a side's last hidden layer (…, U/2) adds to the commands to all arms (…, n_outputs)."""
        parts = [
            self._weight(side, arm) * self._sends(side, arm) * h @ layer.weight.T
            for arm, layer in enumerate(self.output_layers)
        ]
        return parts[0] if self.n_arms == 1 else torch.cat(parts, dim=-1)

    def _views(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        """Return what each side sees: all (…, n_inputs), or with two arms the view of the opposite one."""
        if self.n_arms == 1:
            return observation, observation
        return observation[..., : self.n_inputs_per_arm], observation[..., self.n_inputs_per_arm :]

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

    def _build(self) -> None:
        if self.units < 4:
            raise ValueError(f"a callosal network needs at least 4 units, two a side to pool, got {self.units}.")
        if self.layers < 2:
            raise ValueError(
                f"a callosal network needs at least 2 hidden layers to exchange between, got {self.layers}."
            )
        super()._build()

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
    units: int | None = None,
    layers: int = 2,
    hidden_noise: float = 0.0,
    n_arms: int = 1,
    ipsilateral_share: float | None = None,
    trained_combination: bool | None = None,
) -> MotorNetwork:
    """Build a network with random weights; the arguments are those of :class:`MotorNetwork`.

    Raises:
        ValueError: an unknown architecture, sizes that it cannot have, or an argument that could not have its effect.
    """
    if architecture not in ARCHITECTURES:
        raise ValueError(f"unknown architecture {architecture!r}; choose from {', '.join(ARCHITECTURES)}.")
    make = ARCHITECTURES[architecture]
    return make(n_inputs, n_outputs, units, layers, hidden_noise, n_arms, ipsilateral_share, trained_combination)
