"""The memory of a rollout: torch tensors, and structs of Warp arrays over them for the kernels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import torch
import warp as wp
from torch import Tensor

from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.network_kernels import N_GATES
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import N_MUSCLE_ROWS


class TrialTensors(NamedTuple):
    """What sets trials apart; leading axes are any, such as (networks, trials)."""

    start: Tensor
    """(…, 2): angles (rad); the arm is at rest."""
    target: Tensor
    """(…, 2): of the hand (m)."""
    load: Tensor
    """(…, 2): on the hand (N)."""


@dataclass(frozen=True)
class RolloutSize:
    """How much a rollout holds."""

    n_networks: int
    """S."""
    n_trials: int
    """B, of each network."""
    n_steps: int
    """T."""
    n_streams: int = 0
    """Losses whose gradients are wanted."""
    watches_state: bool = False
    """Whether a loss looks at states: joints, muscles or the hand, but for its distance to the target."""
    watches_activity: bool = False
    """Whether a loss looks at hidden activity."""


class RolloutArrays:
    """Everything that the kernels of a rollout read and write.

    Args:
        layout: of the networks.
        size: how much there is of everything.
        kernels: whose structs are filled.
        real: Warp's precision.
        dtype: torch's.
        device: ``"cpu"`` or a CUDA device.

    Attributes:
        for_adjoint: the structs of gradients, deltas and carried gradients.
    """

    def __init__(
        self, layout: Layout, size: RolloutSize, kernels: Any, real: Any, dtype: torch.dtype, device: str
    ) -> None:
        self._layout, self._size, self._kernels, self._real = layout, size, kernels, real
        self._dtype, self._device = dtype, device
        self._allocate_forward()
        self.weights_struct, self.trials_struct = self._weights(), self._trials()
        self.activity_struct, self.trajectories_struct = self._activity(), self._trajectories()
        self._allocate_backward()
        self.for_adjoint = [self._gradients(), self._deltas(), self._carried()]

    def _allocate_forward(self) -> None:
        shape, size = self._layout.shape, self._size
        s, b, t = size.n_networks, size.n_trials, size.n_steps
        self.weights = self._zeros(s, self._layout.width)
        self.gates = self._zeros(s, N_GATES) + 1.0
        self.trials = TrialTensors(*(self._zeros(s, b, 2) for _ in range(3)))
        self.joint = self._zeros(s, b, t, 4)
        self.muscle = self._zeros(s, b, t, N_MUSCLE_ROWS, N_MUSCLES)
        self.hand = self._zeros(s, b, t, 2)
        self.excitation = self._zeros(s, b, t, shape.n_outputs)
        self.terms = self._zeros(s, b, t, 3)
        self.hidden = self._zeros(s, b, t, shape.layers * shape.sides, shape.width)
        self.seen = self._zeros(s, b * t, shape.n_inputs + 1)
        self.received = self._zeros(s, b * t, (shape.layers - 1) * shape.sides, shape.width + 1)
        self.combined = self._zeros(s, b * t, shape.width + 1)

    def _allocate_backward(self) -> None:
        shape, size = self._layout.shape, self._size
        s, b, t, k = size.n_networks, size.n_trials, size.n_steps, size.n_streams
        n_hidden = shape.layers * shape.sides
        of_state = s * b * t if size.watches_state else 0
        of_activity = s * b * t if size.watches_activity else 0
        self.of_terms = self._zeros(k, 3)
        self.of_joint = self._zeros(k, of_state, 4)
        self.of_muscle = self._zeros(k, of_state, N_MUSCLE_ROWS, N_MUSCLES)
        self.of_hand = self._zeros(k, of_state, 2)
        self.of_hidden = self._zeros(k, of_activity, n_hidden, shape.width)
        self.delta_hidden = self._zeros(s, b * t, k, n_hidden, shape.width)
        self.delta_output = self._zeros(s, b * t, k, shape.n_outputs)
        self.of_combination = self._zeros(k, s, b, 2)
        self.gradient = self._zeros(k, s, self._layout.width)
        self._carried_joint = self._zeros(k, s * b, 4)
        self._carried_muscle = self._zeros(k, s * b, N_MUSCLE_ROWS, N_MUSCLES)
        self._carried_hand = self._zeros(k, s * b, 4)

    def _weights(self) -> Any:
        network, region = self._kernels.network, self._layout.region
        return _fill(
            network.Weights(),
            first=(region(self.weights, "first"), network.vec_side),
            hidden=(region(self.weights, "hidden"), network.vec_side),
            combination=(region(self.weights, "combination"), self._real),
            output=(region(self.weights, "output"), network.vec_out),
            gates=(self.gates, self._real),
        )

    def _trials(self) -> Any:
        vec2 = self._kernels.physics.vec2
        return _fill(self._kernels.Trials(), **{k: (v.flatten(0, 1), vec2) for k, v in self.trials._asdict().items()})

    def _activity(self) -> Any:
        network = self._kernels.network
        return _fill(
            network.Activity(),
            observation=(self.seen.flatten(0, 1), network.vec_in_one),
            received=(self.received.flatten(0, 1), network.vec_side_one),
            hidden=(self.hidden.flatten(0, 2), network.vec_side),
            combined=(self.combined.flatten(0, 1), network.vec_side_one),
        )

    def _trajectories(self) -> Any:
        kernels, physics = self._kernels, self._kernels.physics
        return _fill(
            kernels.Trajectories(),
            joint=(self.joint.flatten(0, 2), physics.vec4),
            muscle=(self.muscle.flatten(0, 2), kernels.rows),
            hand=(self.hand.flatten(0, 2), physics.vec2),
            excitation=(self.excitation.flatten(0, 2), physics.vec6),
            terms=(self.terms.flatten(0, 2), kernels.vec_terms),
        )

    def _gradients(self) -> Any:
        kernels, physics = self._kernels, self._kernels.physics
        return _fill(
            kernels.Gradients(),
            terms=(self.of_terms, kernels.vec_terms),
            joint=(self.of_joint, physics.vec4),
            muscle=(self.of_muscle, kernels.rows),
            hand=(self.of_hand, physics.vec2),
        )

    def _deltas(self) -> Any:
        network = self._kernels.network
        return _fill(
            network.Deltas(),
            hidden=(self.delta_hidden.flatten(0, 1), network.vec_side),
            output=(self.delta_output.flatten(0, 1), network.vec_out),
            combination=(self.of_combination.flatten(1, 2), self._real),
            activity=(self.of_hidden, network.vec_side),
        )

    def _carried(self) -> Any:
        kernels, physics = self._kernels, self._kernels.physics
        return _fill(
            kernels.Carried(),
            joint=(self._carried_joint, physics.vec4),
            muscle=(self._carried_muscle, kernels.rows),
            hand=(self._carried_hand, physics.vec4),
        )

    def _zeros(self, *shape: int) -> Tensor:
        return torch.zeros(shape, dtype=self._dtype, device=self._device)


def _fill(struct: Any, **fields: tuple[Tensor, Any]) -> Any:
    """``struct`` with Warp arrays of the given element type over the given tensors."""
    for name, (tensor, dtype) in fields.items():
        setattr(struct, name, wp.from_torch(tensor, dtype=dtype, requires_grad=False))
    return struct
