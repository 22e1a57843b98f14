"""One update of every stacked network, each by itself: routed gradients, clipped by variable, then Adam.

The paper's optimizer (section 5) is Keras's, which is why torch's will not do: every kernel, bias and scalar is clipped
by its own norm, and ε is added before the bias correction. A thread does one variable of one network from start to end,
so that networks of a stack cannot influence each other, not even by the rounding of a sum.
"""

import functools
import math
from collections.abc import Collection, Sequence
from typing import Any, NamedTuple

import torch
import warp as wp
from torch import Tensor

from bilateral_rl.bptt.losses import StreamLosses
from bilateral_rl.bptt.rollout import Rollout
from bilateral_rl.envs.arm.warp_start import launch_on
from bilateral_rl.vocabulary import Loss, group_shares

BETA_1, BETA_2 = 0.9, 0.999


class OptimizerKernels(NamedTuple):
    """The two kernels of an update, for (networks, variables) threads."""

    route: wp.Kernel
    adam: wp.Kernel


class StackedAdam:
    """The optimizer of a rollout's networks.

    Args:
        rollout: the rollout whose weights it moves.
        losses: the losses that give the gradients.
        loss: what trains the model, which decides how much of each stream's gradient a variable gets.
        learning_rate: Adam's learning rate.
        epsilon: Adam's ε, added where Keras adds it.
        clip_norm: largest norm of a variable's gradient.
        step: number of updates done before, of all networks or of each.
        trained: names of the variables that it moves; None for all.
        still: (S, width) bool, single numbers that it leaves as they are, and whose gradients it ignores, those of a
            penalty too; None for none.

    Attributes:
        steps: number of updates of each network.
        first: (S, width), Adam's first moments.
        second: (S, width), Adam's second moments.
        routed: (S, width), the last gradient, before its clipping.
        norms: (S, variables), the norm of that gradient in each variable.
    """

    def __init__(
        self,
        rollout: Rollout,
        losses: StreamLosses,
        loss: Loss,
        learning_rate: float,
        epsilon: float,
        clip_norm: float,
        step: int | Sequence[int] = 0,
        trained: Collection[str] | None = None,
        still: Tensor | None = None,
    ) -> None:
        self._rollout, self._losses = rollout, losses
        self.learning_rate, self.epsilon, self.clip_norm = learning_rate, epsilon, clip_norm
        self.steps = [step] * rollout.size.n_networks if isinstance(step, int) else list(step)
        if len(self.steps) != rollout.size.n_networks:
            raise ValueError(
                f"{rollout.size.n_networks} networks need as many numbers of steps, got {len(self.steps)}."
            )
        self.first, self.second, self.routed = (torch.zeros_like(rollout.weights) for _ in range(3))
        variables = rollout.layout.variables
        self.norms = rollout.weights.new_zeros(rollout.size.n_networks, len(variables))
        shares = group_shares(loss)
        self._shares = rollout.weights.new_tensor(
            [[0.0 if v.fixed else shares[v.group][stream] for v in variables] for stream in range(losses.n_streams)]
        )
        self._decay = rollout.weights.new_tensor(losses.weight_decay)
        self._offsets = self._integers([0, *(v.offset + v.size for v in variables)])
        self._non_negative = self._integers([v.non_negative for v in variables])
        self._trained = self._integers([not v.fixed and (trained is None or v.name in trained) for v in variables])
        self._moves = self._trained.repeat(len(self.norms), 1)
        self._still = torch.zeros(rollout.weights.shape, dtype=torch.int32, device=rollout.device)
        if still is not None:
            self._still.copy_(still)
        self._kernels = optimizer_kernels(rollout.real)

    def gradient(self) -> Tensor:
        """Compute the routed gradients of the rollout's last forward pass; return (S,) bool, whether each is finite."""
        gradient = self._losses.gradient(self._rollout)
        if gradient.shape != (len(self._shares), *self.routed.shape):
            raise ValueError(f"the losses are {len(self._shares)}, and the rollout gave {len(gradient)} gradients.")
        inputs = [gradient, self._rollout.weights, self._decay, self._shares, self._offsets, self._still]
        self._launch(self._kernels.route, [*inputs, self.routed, self.norms])
        return self.norms.isfinite().all(1)

    def step(self, moving: Tensor | None = None) -> None:
        """Move the networks by the last :meth:`gradient`, all of them or those where ``moving`` (S,) bool is True."""
        self.steps = [step + 1 for step in self.steps]
        self._moves[:] = self._trained if moving is None else moving.to(self._moves)[:, None] * self._trained
        # Keras corrects the bias of both moments in the learning rate, so that ε is added to the uncorrected √v.
        corrections = [math.sqrt(1.0 - BETA_2**step) / (1.0 - BETA_1**step) for step in self.steps]
        rates = self._rollout.weights.new_tensor([self.learning_rate * correction for correction in corrections])
        self._launch(
            self._kernels.adam,
            [
                *(self.routed, self.norms, self._offsets, self._non_negative, self._moves, self._still),
                *(self.clip_norm, rates, self.epsilon),
                *(self.first, self.second, self._rollout.weights),
            ],
        )

    def _launch(self, kernel: wp.Kernel, inputs: list[Any]) -> None:
        arrays = [wp.from_torch(x, requires_grad=False) if isinstance(x, Tensor) else x for x in inputs]
        wp.launch(kernel, dim=tuple(self.norms.shape), inputs=arrays, **launch_on(self._rollout.device))

    def _integers(self, values: list[Any]) -> Tensor:
        return torch.tensor([int(value) for value in values], dtype=torch.int32, device=self._rollout.device)


@functools.cache
def optimizer_kernels(real: Any) -> OptimizerKernels:
    """Return the kernels in precision ``real`` (``wp.float32`` or ``wp.float64``); they index rows by variable."""
    # Made here: inside a kernel a plain number would be rounded to single precision.
    new_1, new_2 = real(1.0 - BETA_1), real(1.0 - BETA_2)

    @wp.kernel(module="unique", enable_backward=False)
    def route(
        gradient: wp.array3d(dtype=real),  # (streams, S, width)
        weights: wp.array2d(dtype=real),  # (S, width)
        decay: wp.array(dtype=real),  # (streams,)
        shares: wp.array2d(dtype=real),  # (streams, variables)
        offsets: wp.array(dtype=int),  # (variables + 1,)
        still: wp.array2d(dtype=int),  # (S, width)
        routed: wp.array2d(dtype=real),  # (S, width), written
        norms: wp.array2d(dtype=real),  # (S, variables), written
    ) -> None:
        """Write a variable's gradient, its shares of the streams' gradients and weight decays, and its norm."""
        s, v = wp.tid()
        total = real(0.0)
        for i in range(offsets[v], offsets[v + 1]):
            combined = real(0.0)
            for stream in range(gradient.shape[0]):
                # A stream without a share is left out: 0 times an infinite gradient would be NaN.
                if shares[stream, v] != real(0.0) and still[s, i] == 0:
                    of_stream = gradient[stream, s, i] + decay[stream] * weights[s, i]
                    combined += shares[stream, v] * of_stream
            routed[s, i] = combined
            total += combined * combined
        norms[s, v] = wp.sqrt(total)

    @wp.kernel(module="unique", enable_backward=False)
    def adam(
        routed: wp.array2d(dtype=real),  # (S, width)
        norms: wp.array2d(dtype=real),  # (S, variables)
        offsets: wp.array(dtype=int),  # (variables + 1,)
        non_negative: wp.array(dtype=int),  # (variables,)
        moves: wp.array2d(dtype=int),  # (S, variables)
        still: wp.array2d(dtype=int),  # (S, width)
        clip_norm: real,
        rates: wp.array(dtype=real),  # (S,)
        epsilon: real,
        first: wp.array2d(dtype=real),  # (S, width), updated, like all that follow
        second: wp.array2d(dtype=real),
        weights: wp.array2d(dtype=real),
    ) -> None:
        """Clip a variable's gradient to ``clip_norm`` and take one step of Adam."""
        s, v = wp.tid()
        if moves[s, v] == 0:
            return
        norm = wp.max(norms[s, v], clip_norm)  # a gradient within the bound is divided by the bound: left as it is
        for i in range(offsets[v], offsets[v + 1]):
            if still[s, i] == 0:
                clipped = routed[s, i] * clip_norm / norm
                first[s, i] = first[s, i] + (clipped - first[s, i]) * new_1
                second[s, i] = second[s, i] + (clipped * clipped - second[s, i]) * new_2
                moved = weights[s, i] - rates[s] * first[s, i] / (wp.sqrt(second[s, i]) + epsilon)
                if non_negative[v] != 0:
                    moved = wp.max(moved, real(0.0))
                weights[s, i] = moved

    return OptimizerKernels(route, adam)
