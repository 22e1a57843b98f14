"""What every network is: from an observation to muscle commands, with noise, lesions and groups of parameters."""

from __future__ import annotations

import contextlib
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any

import torch
from torch import Tensor, nn

from bilateral_rl.policies.arms import UNITS_PER_ARM, checked_arms, checked_paths, each_arms
from bilateral_rl.policies.hidden_noise import HiddenNoise
from bilateral_rl.policies.lesions import NO_LESION, Lesion, find_lesion
from bilateral_rl.policies.quantities import finite, whole
from bilateral_rl.vocabulary import GROUPS, Architecture


class MotorNetwork(nn.Module, ABC):
    """A controller from observation to muscle excitation; base class of the three architectures.

    ``forward`` gives the output layer's values before the sigmoid, :meth:`excitation` the sigmoid of them. Both are
    without noise unless they are given what ``noise.draw`` draws, as the policies do for every action.

    Args:
        n_inputs: size of the observation; of two arms, half of it is the view of each, the dominant one's first.
        n_outputs: number of muscles; of two arms, half of them are of each, the dominant one's first.
        units: units per hidden layer, over both sides (U); None for 10 an arm.
        layers: hidden layers (L).
        hidden_noise: standard deviation of the noise on each hidden unit's activity.
        n_arms: arms that it commands, 1 or 2.
        ipsilateral_share: weight of each hemisphere in the commands to the arm of its own side, where the arm of the
            other side gets the rest; 0 for none at all. With two arms and hemispheres only; None is 0.15.
        trained_combination: whether these weights only begin so, and are trained and kept at 0 or more, as those of
            one arm always are. With two arms and hemispheres only; None is False.

    Attributes:
        lesion: the present lesion; set it with :meth:`set_lesion` or :meth:`lesioned`.
        noise: what the noise of the hidden units is drawn from.

    Raises:
        ValueError: sizes that the architecture cannot have, or an argument that could not have its effect.
    """

    architecture: Architecture
    sides: int = 1
    """Stacks of hidden layers beside each other."""

    def __init__(
        self,
        n_inputs: int,
        n_outputs: int,
        units: int | None = None,
        layers: int = 2,
        hidden_noise: float = 0.0,
        n_arms: int = 1,
        ipsilateral_share: float | None = None,
        trained_combination: bool | None = None,
    ) -> None:
        super().__init__()
        self.n_arms = checked_arms(n_arms)
        self.n_inputs, self.n_outputs = whole("n_inputs", n_inputs), whole("n_outputs", n_outputs)
        self.n_inputs_per_arm = each_arms("n_inputs", self.n_inputs, self.n_arms)
        self.n_outputs_per_arm = each_arms("n_outputs", self.n_outputs, self.n_arms)
        self.units = whole("units", UNITS_PER_ARM * self.n_arms if units is None else units)
        self.layers = whole("layers", layers)
        self.ipsilateral_share, self.trained_combination = checked_paths(
            self.architecture, self.sides, self.n_arms, ipsilateral_share, trained_combination
        )
        self.lesion = NO_LESION
        self.noise = HiddenNoise(finite("hidden_noise", hidden_noise, 0.0), self.hidden_shape, self.sides)
        self._build()

    def _build(self) -> None:
        """Make the layers, of the sizes that are set."""

    @property
    def arguments(self) -> dict[str, Any]:
        """What :func:`~bilateral_rl.policies.networks.make_network` makes another one of the same shape from."""
        return {
            "architecture": self.architecture,
            "n_inputs": self.n_inputs,
            "n_outputs": self.n_outputs,
            "units": self.units,
            "layers": self.layers,
            "hidden_noise": self.noise.std,
            "n_arms": self.n_arms,
            "ipsilateral_share": self.ipsilateral_share,
            "trained_combination": self.trained_combination,
        }

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

    def combination_weights(self) -> dict[str, float]:
        """Return the weight of each side in the combination; empty for a network without sides.

        With two arms, the names are ``"dominant_arm/non_dominant"`` and so on, first the arm's and then the side's.
        """
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
