"""One update of every stacked network, each by itself: routed gradients, clipped by variable, then Adam."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any

import torch
import warp as wp
from torch import Tensor

from bilateral_rl.bptt.losses import StreamLosses
from bilateral_rl.bptt.optimizer_kernels import BETA_1, BETA_2, optimizer_kernels
from bilateral_rl.bptt.rollout import Rollout
from bilateral_rl.envs.arm.warp_start import launch_place
from bilateral_rl.vocabulary import Loss, group_shares


class StackedAdam:
    """The optimizer of a rollout's networks.

    Args:
        rollout: whose weights it moves.
        losses: that give the gradients.
        loss: what trains the model: who gets which gradient.
        learning_rate: of Adam.
        epsilon: of Adam, as Keras adds it.
        clip_norm: of each variable's gradient.
        step: updates done before.
        trained: names of the variables that it moves; None for all.

    Attributes:
        first, second: (S, width), Adam's moments.
        routed: (S, width), the last gradient, before its clipping.
        norms: (S, variables), the norm of it in each variable.
    """

    def __init__(
        self,
        rollout: Rollout,
        losses: StreamLosses,
        loss: Loss,
        learning_rate: float,
        epsilon: float,
        clip_norm: float,
        step: int = 0,
        trained: Collection[str] | None = None,
    ) -> None:
        self._rollout, self._losses, self._layout = rollout, losses, rollout.layout
        self.learning_rate, self.epsilon, self.clip_norm, self.step_count = learning_rate, epsilon, clip_norm, step
        self.first, self.second, self.routed = (torch.zeros_like(rollout.weights) for _ in range(3))
        variables = self._layout.variables
        self.norms = rollout.weights.new_zeros(rollout.size.n_networks, len(variables))
        shares = group_shares(loss)
        self._shares = rollout.weights.new_tensor(
            [[shares[v.group][stream] for v in variables] for stream in range(losses.n_streams)]
        )
        self._decay = rollout.weights.new_tensor(losses.weight_decay)
        ends = [v.offset + v.size for v in variables]
        self._offsets = self._integers([0, *ends])
        self._non_negative = self._integers([v.non_negative for v in variables])
        self._trained = self._integers([trained is None or v.name in trained for v in variables])
        self._trains = self._trained.repeat(len(self.norms), 1)
        self._kernels = optimizer_kernels(rollout.real)

    def gradient(self) -> Tensor:
        """(S,) bool: compute the routed gradients of what the rollout last did; whether each is finite."""
        gradient = self._losses.gradient(self._rollout)
        inputs = [gradient, self._rollout.weights, self._decay, self._shares, self._offsets, self.routed, self.norms]
        self._launch(self._kernels.route, inputs)
        return self.norms.isfinite().all(1)

    def step(self, moves: Tensor | None = None) -> None:
        """Move the networks by the last :meth:`gradient`; only those that ``moves`` (S,) bool names, if given."""
        self.step_count += 1
        self._trains[:] = self._trained if moves is None else moves.to(self._trains)[:, None] * self._trained
        correction = math.sqrt(1.0 - BETA_2**self.step_count) / (1.0 - BETA_1**self.step_count)
        self._launch(
            self._kernels.adam,
            [
                *(self.routed, self.norms, self._offsets, self._non_negative, self._trains),
                *(self.clip_norm, self.learning_rate * correction, self.epsilon),
                *(self.first, self.second, self._rollout.weights),
            ],
        )

    def _launch(self, kernel: Any, inputs: list[Any]) -> None:
        arrays = [wp.from_torch(x, requires_grad=False) if isinstance(x, Tensor) else x for x in inputs]
        wp.launch(kernel, dim=tuple(self.norms.shape), inputs=arrays, **launch_place(self._rollout.device))

    def _integers(self, values: list[Any]) -> Tensor:
        return torch.tensor([int(value) for value in values], dtype=torch.int32, device=self._rollout.device)
