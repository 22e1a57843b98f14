"""The memory of a rollout: torch tensors, and the kernels' structs of Warp arrays over the same memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
import warp as wp
from torch import Tensor

from bilateral_rl.bptt.conditions import Conditions
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.network_kernels import N_GATES
from bilateral_rl.bptt.rollout_kernels import RolloutKernels
from bilateral_rl.bptt.rollout_structs import N_NOISE, N_SENSED, n_terms
from bilateral_rl.bptt.trial_tensors import TrialTensors
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import N_MUSCLE_ROWS


@dataclass(frozen=True)
class RolloutSize:
    """How much a rollout holds."""

    n_networks: int
    """S, number of networks."""
    n_trials: int
    """B, number of trials of each network."""
    n_steps: int
    """T, steps of a trial."""
    n_streams: int = 0
    """Number of losses whose gradients are wanted."""
    watches_state: bool = False
    """Whether a loss looks at joints, muscles or the hand, but for the hand's distance to the target."""
    watches_activity: bool = False
    """Whether a loss looks at hidden activity."""


class RolloutArrays:
    """Everything that the kernels of a rollout read and write.

    Below, S, B, T are the rollout's size, H = B · arms its hands, K its streams and L = layers · sides the network's
    hidden layers.

    Args:
        layout: layout of the networks' parameters.
        size: how much there is of everything.
        conditions: what trials, losses and senses ask for.
        kernels: the kernels whose structs are filled.
        dtype: torch's precision, that of the kernels.
        device: ``"cpu"`` or a CUDA device.

    Attributes:
        forward_structs: what the forward kernel takes: weights, trials, senses, activity and trajectories.
        adjoint_structs: what the adjoint kernel takes besides: upstream gradients, deltas and carried gradients.
    """

    def __init__(
        self,
        layout: Layout,
        size: RolloutSize,
        conditions: Conditions,
        kernels: RolloutKernels,
        dtype: torch.dtype,
        device: str,
    ) -> None:
        self._dtype, self._device, self._conditions = dtype, device, conditions
        self._delays = tuple(min(delay, size.n_steps) for delay in conditions.delays)  # longer: the start is sensed
        self._n_terms = n_terms(conditions.features.further_losses)
        self._n_hands = size.n_trials * conditions.n_arms
        self._allocate_forward(layout, size)
        self._allocate_backward(layout, size)
        self.forward_structs = self._forward_structs(layout, kernels)
        self.adjoint_structs = self._adjoint_structs(kernels)

    def _allocate_forward(self, layout: Layout, size: RolloutSize) -> None:
        shape = layout.shape
        s, b, h, t = size.n_networks, size.n_trials, self._n_hands, size.n_steps
        self.weights = self._zeros(s, layout.width)
        self.gates = self._zeros(s, N_GATES) + 1.0
        n_hidden = shape.layers * shape.sides
        features = self._conditions.features
        self.trials = TrialTensors.zeros((s, b), features, self._dtype, self._device)
        self.noise = self._zeros(s, h if features.senses else 0, t, N_NOISE)
        self.hidden_noise = self._zeros(s, b if features.hidden_noise else 0, t, n_hidden, shape.width)
        self.joint = self._zeros(s, h, t, 4)
        self.muscle = self._zeros(s, h, t, N_MUSCLE_ROWS, N_MUSCLES)
        self.hand = self._zeros(s, h, t, 2)
        self.excitation = self._zeros(s, h, t, N_MUSCLES)
        self.terms = self._zeros(s, h, t, self._n_terms)
        self.hidden = self._zeros(s, b, t, n_hidden, shape.width)
        # What layers receive, each with a one behind it, by which the bias is a row of the weights like any other.
        self.observation = self._zeros(s, b * t, shape.n_inputs + 1)
        self.received = self._zeros(s, b * t, (shape.layers - 1) * shape.sides, shape.width + 1)
        self.combined = self._zeros(s, b * t, shape.arms, shape.width + 1)

    def _allocate_backward(self, layout: Layout, size: RolloutSize) -> None:
        shape = layout.shape
        s, b, h, t, k = size.n_networks, size.n_trials, self._n_hands, size.n_steps, size.n_streams
        n_hidden = shape.layers * shape.sides
        n_state = s * h * t if size.watches_state else 0
        n_activity = s * b * t if size.watches_activity else 0
        self.upstream_terms = self._zeros(k, self._n_terms)
        self.upstream_joint = self._zeros(k, n_state, 4)
        self.upstream_muscle = self._zeros(k, n_state, N_MUSCLE_ROWS, N_MUSCLES)
        self.upstream_hand = self._zeros(k, n_state, 2)
        self.upstream_hidden = self._zeros(k, n_activity, n_hidden, shape.width)
        self.delta_hidden = self._zeros(s, b * t, k, n_hidden, shape.width)
        self.delta_output = self._zeros(s, b * t, k, shape.arms, shape.n_muscles)
        self.combination_gradient = self._zeros(k, s, b, 2, self._conditions.n_arms)
        self.gradient = self._zeros(k, s, layout.width)
        features = self._conditions.features
        felt, seen = ((delay + 1 if features.senses else 0) for delay in self._delays)
        self._carried = {
            "joint": self._zeros(k, s * h, 4),
            "muscle": self._zeros(k, s * h, N_MUSCLE_ROWS, N_MUSCLES),
            "hand": self._zeros(k, s * h, 4),
            "excitation": self._zeros(k, s * h if features.further_losses else 0, N_MUSCLES),
            "command": self._zeros(k, s * h, N_MUSCLES),
            "pull": self._zeros(k, s * h if features.arms > 1 else 0, 4),
            "felt": self._zeros(k, s * h, felt, 2 * N_MUSCLES),
            "seen": self._zeros(k, s * h, seen, 2),
        }

    def _forward_structs(self, layout: Layout, kernels: RolloutKernels) -> list[Any]:
        regions = {name: layout.region(self.weights, name) for name in layout.regions}
        return [
            _fill(kernels.network.Weights, **regions, gates=self.gates),
            self._trials(kernels),
            self._senses(kernels),
            _fill(
                kernels.network.Activity,
                observation=self.observation.flatten(0, 1),
                received=self.received.flatten(0, 1),
                hidden=self.hidden.flatten(0, 2),
                combined=self.combined.flatten(0, 1),
                noise=self.hidden_noise.flatten(0, 2),
            ),
            _fill(
                kernels.structs.Trajectories,
                joint=self.joint.flatten(0, 2),
                muscle=self.muscle.flatten(0, 2),
                hand=self.hand.flatten(0, 2),
                excitation=self.excitation.flatten(0, 2),
                terms=self.terms.flatten(0, 2),
            ),
        ]

    def _adjoint_structs(self, kernels: RolloutKernels) -> list[Any]:
        return [
            _fill(
                kernels.structs.UpstreamGradients,
                terms=self.upstream_terms,
                joint=self.upstream_joint,
                muscle=self.upstream_muscle,
                hand=self.upstream_hand,
            ),
            _fill(
                kernels.network.Deltas,
                hidden=self.delta_hidden.flatten(0, 1),
                output=self.delta_output.flatten(0, 1),
                combination=self.combination_gradient.flatten(1, 2),
                activity=self.upstream_hidden,
            ),
            _fill(kernels.structs.CarriedGradients, **self._carried),
        ]

    def _trials(self, kernels: RolloutKernels) -> Any:
        tensors = {name: tensor.flatten(0, 1) for name, tensor in self.trials.tensors().items()}
        trials = _fill(kernels.structs.Trials, **tensors)
        trials.shoulder_distance = self._conditions.settings.two_arms.shoulder_distance
        return trials

    def _senses(self, kernels: RolloutKernels) -> Any:
        senses = _fill(kernels.structs.Senses, noise=self.noise.flatten(0, 2))
        senses.felt_delay, senses.seen_delay = self._delays
        low, high = self._conditions.observation_bounds
        senses.low, senses.high = (kernels.structs.vec_sensed(*bound[:N_SENSED]) for bound in (low, high))
        return senses

    def _zeros(self, *shape: int) -> Tensor:
        return torch.zeros(shape, dtype=self._dtype, device=self._device)


def _fill(struct: Any, **tensors: Tensor) -> Any:
    """Return a ``struct`` with Warp arrays over ``tensors``, each of the element type that the struct declares."""
    instance = struct()
    for name, tensor in tensors.items():
        element = struct.vars[name].type.dtype
        setattr(instance, name, wp.from_torch(tensor, dtype=element, requires_grad=False))
    return instance
