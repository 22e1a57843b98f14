"""Stacked networks on the arm, each with trials of its own: what happens, and the losses' gradients."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import torch
import warp as wp
from torch import Tensor

from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.network_kernels import (
    CALLOSUM,
    INPUT_DOMINANT,
    INPUT_NON_DOMINANT,
    N_GATES,
    OUTPUT_DOMINANT,
    OUTPUT_NON_DOMINANT,
)
from bilateral_rl.bptt.rollout_arrays import RolloutArrays, RolloutSize
from bilateral_rl.bptt.rollout_kernels import rollout_kernels
from bilateral_rl.bptt.workers import Workers
from bilateral_rl.envs.arm import ArmParameters
from bilateral_rl.envs.arm.physics import kernel_parameters
from bilateral_rl.envs.arm.warp_start import launch_place
from bilateral_rl.policies.lesions import Lesion

_REAL = {torch.float32: wp.float32, torch.float64: wp.float64}
_INPUT_GATE = {"dominant": INPUT_DOMINANT, "non_dominant": INPUT_NON_DOMINANT}
_OUTPUT_GATE = {"dominant": OUTPUT_DOMINANT, "non_dominant": OUTPUT_NON_DOMINANT}


class TrajectoryGradients(NamedTuple):
    """Gradients of each stream's loss with respect to trajectories, each (streams, S, B, T, …)."""

    joint: Tensor | None = None
    muscle: Tensor | None = None
    hand: Tensor | None = None
    hidden: Tensor | None = None


class Rollout:
    """``S`` networks, each moving ``B`` arms through a trial of ``T`` steps, and back-propagation through it.

    What belongs to one network depends on nothing of the others, to the last bit on a CPU, nor on how many threads
    share the work.

    Args:
        layout: of the networks' parameters.
        arm: physical constants.
        size: S, B, T, and what gradients are wanted.
        device: ``"cpu"`` or a CUDA device.
        dtype: ``torch.float32`` or ``torch.float64``.
        workers: threads that share the work; the calling one by default, whose torch should then use one thread too.

    Attributes:
        weights: (S, width), the networks' parameters; write into it.
        trials: what the next :meth:`forward` does; write into it. (S, B, 2) each.
        joint: (S, B, T, 4), after each step, as in :class:`~bilateral_rl.envs.arm.ArmState`.
        muscle: (S, B, T, 7, 6), likewise.
        hand: (S, B, T, 2) m.
        excitation: (S, B, T, 6).
        terms: (S, B, T, 3): Cartesian 1, Cartesian 2 and activation of each step.
        hidden: (S, B, T, layers · sides, width): activity of each hidden layer.
        observation: (S, B, T, n_inputs): what the networks saw before each step.
        gradient: (streams, S, width), of the last :meth:`backward`.
    """

    def __init__(
        self,
        layout: Layout,
        arm: ArmParameters,
        size: RolloutSize,
        device: str = "cpu",
        dtype: torch.dtype = torch.float32,
        workers: Workers | None = None,
    ) -> None:
        self.layout, self.size, self.device, self.real = layout, size, device, _REAL[dtype]
        self._workers = workers or Workers()
        parameters = kernel_parameters(arm, self.real)
        kernels = rollout_kernels(self.real, layout.shape)
        a = self._arrays = RolloutArrays(layout, size, kernels, self.real, dtype, device)
        self.weights, self.trials = a.weights, a.trials
        self.joint, self.muscle, self.hand, self.hidden = a.joint, a.muscle, a.hand, a.hidden
        self.observation = a.seen.view(*a.terms.shape[:3], -1)[..., : layout.shape.n_inputs]
        self.excitation, self.terms, self.gradient = a.excitation, a.terms, a.gradient
        head = [parameters, a.weights_struct, a.trials_struct, size.n_trials, size.n_steps]
        tail = [a.activity_struct, a.trajectories_struct]
        self._forward = self._record(kernels.roll, head, tail)
        self._backward = self._record(kernels.roll_adjoint, head, tail + a.for_adjoint) if size.n_streams else []

    def forward(self) -> None:
        """Every trial once; fills the trajectories."""
        self._launch(self._forward)

    def backward(self, term_weights: Tensor, seeds: TrajectoryGradients | None = None) -> Tensor:
        """Gradients of losses of the last :meth:`forward` with respect to the weights.

        Args:
            term_weights: (streams, 3): each loss is, for every network, the sum over its trials and steps of these
                weights times the step's terms.
            seeds: gradients of what else each loss is made of.

        Returns:
            :attr:`gradient`, overwritten by the next call.

        Raises:
            ValueError: gradients of what ``size`` said that no loss looks at.
        """
        a, seeds = self._arrays, seeds or TrajectoryGradients()
        a.of_terms.copy_(term_weights)
        for own, given in zip((a.of_joint, a.of_muscle, a.of_hand, a.of_hidden), seeds, strict=True):
            if own.numel():
                own.zero_() if given is None else own.copy_(given.reshape(own.shape))
            elif given is not None:
                raise ValueError("the rollout was made without room for gradients of states or of activity.")
        self._launch(self._backward)
        parts = self._workers.parts(self.size.n_networks)
        self._workers.share([functools.partial(self._assemble, part) for part in parts])
        return self.gradient

    def set_lesions(self, lesions: Sequence[Lesion]) -> None:
        """Lesion network ``s`` by ``lesions[s]``."""
        gates = torch.ones(self.size.n_networks, N_GATES)
        for gate, lesion in zip(gates, lesions, strict=True):
            if lesion.input_of:
                gate[_INPUT_GATE[lesion.input_of]] = 0.0
            if lesion.output_of:
                gate[_OUTPUT_GATE[lesion.output_of]] = 0.0
            if lesion.callosum:
                gate[CALLOSUM] = 0.0
        self._arrays.gates.copy_(gates)

    def _record(self, kernel: Any, head: list[Any], tail: list[Any]) -> list[Any]:
        """The kernel recorded once for each thread's part of the trials."""
        return [
            wp.launch(
                kernel, dim=len(part), inputs=[*head, part.start, *tail], record_cmd=True, **launch_place(self.device)
            )
            for part in self._workers.parts(self.size.n_networks * self.size.n_trials)
        ]

    def _launch(self, launches: list[Any]) -> None:
        stream = launch_place(self.device).get("stream")
        self._workers.share([functools.partial(launch.launch, stream) for launch in launches])

    def _assemble(self, networks: range) -> None:
        """Weight gradients from what each layer received and the gradient of what it put out.

        The products also pair what does not belong together: three large ones are faster than the ten needed ones.
        """
        a, layout, shape, streams = self._arrays, self.layout, self.layout.shape, self.size.n_streams
        n_hidden, n_received = shape.layers * shape.sides, (shape.layers - 1) * shape.sides
        for s in networks:
            deltas = a.delta_hidden[s].flatten(1)
            of_first = (a.seen[s].t() @ deltas).view(-1, streams, n_hidden, shape.width)
            of_hidden = (a.received[s].flatten(1).t() @ deltas).view(
                n_received, shape.width + 1, streams, n_hidden, shape.width
            )
            of_output = (a.combined[s].t() @ a.delta_output[s].flatten(1)).view(-1, streams, shape.n_outputs)
            row = self.gradient[:, s]
            first, hidden = layout.region(row, "first"), layout.region(row, "hidden")
            first.copy_(of_first[:, :, : shape.sides].permute(1, 2, 0, 3))
            first[:, :, :-1] *= a.gates[s, INPUT_DOMINANT : INPUT_DOMINANT + shape.sides].view(-1, 1, 1)
            for index in range(n_received):
                hidden[:, index] = of_hidden[index, :, :, index + shape.sides].transpose(0, 1)
            if shape.sides == 2:
                layout.region(row, "combination").copy_(a.of_combination[:, s].sum(1))
            layout.region(row, "output").copy_(of_output.transpose(0, 1))
