"""Stacked networks on the arm, each with trials of its own: what happens, and the losses' gradients."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import torch
import warp as wp
from torch import Tensor

from bilateral_rl.bptt.conditions import Conditions
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.network_kernels import (
    CALLOSUM,
    INPUT_DOMINANT,
    INPUT_NON_DOMINANT,
    N_GATES,
    OUTPUT_DOMINANT,
    OUTPUT_NON_DOMINANT,
    NetworkShape,
)
from bilateral_rl.bptt.rollout_arrays import RolloutArrays, RolloutSize
from bilateral_rl.bptt.rollout_kernels import rollout_kernels
from bilateral_rl.bptt.rollout_structs import View
from bilateral_rl.bptt.targets import Targets
from bilateral_rl.bptt.trial_tensors import TrialTensors
from bilateral_rl.bptt.workers import Workers
from bilateral_rl.envs.arm import ArmParameters
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import kernel_parameters
from bilateral_rl.envs.arm.warp_start import launch_on
from bilateral_rl.policies.lesions import Lesion

_REAL = {torch.float32: wp.float32, torch.float64: wp.float64}
_INPUT_GATE = {"dominant": INPUT_DOMINANT, "non_dominant": INPUT_NON_DOMINANT}
_OUTPUT_GATE = {"dominant": OUTPUT_DOMINANT, "non_dominant": OUTPUT_NON_DOMINANT}


class TrajectoryGradients(NamedTuple):
    """Gradients of each stream's loss with respect to trajectories, each (streams, S, B, T, …); None for zeros."""

    joint: Tensor | None = None
    muscle: Tensor | None = None
    hand: Tensor | None = None
    hidden: Tensor | None = None


class Rollout:
    """``S`` networks, each moving arms through ``B`` trials of ``T`` steps, and back-propagation through it.

    What an arm does has a row for each of ``H = B · arms`` hands, in the arm's own frame: arm ``a`` of trial ``i`` is
    row ``i * arms + a``. With one arm, as in the paper, H is B.

    What belongs to one network depends on nothing of the others, to the last bit on a CPU, nor on how many threads
    share the work.

    Args:
        layout: layout of the networks' parameters.
        arm: physical constants.
        size: S, B, T, and what gradients are wanted.
        device: ``"cpu"`` or a CUDA device.
        dtype: ``torch.float32`` or ``torch.float64``.
        workers: threads that share the work; the calling one by default, whose torch should then use one thread too.
        conditions: what trials, losses and senses ask for; the paper's by default.

    Raises:
        ValueError: networks of other arms than the trials.

    Attributes:
        conditions: what trials, losses and senses ask for.
        weights: (S, width), the networks' parameters; write into it.
        trials: what the next :meth:`forward` does, (S, B, …) each; :meth:`load` fills it.
        noise: (S, H, T, 20), of what is sensed before a step and of the commands in it; write into it.
        hidden_noise: (S, B, T, layers · sides, width), of the activity of hidden units; write into it. Both have no
            trials (S, 0, …) where the conditions have none.
        joint: (S, H, T, 4), after each step, as in :class:`~bilateral_rl.envs.arm.ArmState`.
        muscle: (S, H, T, 7, 6), likewise.
        hand: (S, H, T, 2), likewise (m).
        excitation: (S, H, T, 6), the command of each step.
        terms: (S, H, T, 3): Cartesian 1, Cartesian 2 and activation of each step; (S, H, T, 6) with ``FURTHER_TERMS``
            where any loss looks at those.
        hidden: (S, B, T, layers · sides, width): activity of each hidden layer, with its noise.
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
        conditions: Conditions | None = None,
    ) -> None:
        self.layout, self.size, self.device, self.real = layout, size, device, _REAL[dtype]
        self._workers, self._arm = workers or Workers(), arm
        self.conditions = conditions or Conditions()
        _check_fit(layout.shape, self.conditions.n_arms)
        parameters = kernel_parameters(arm, self.real)  # starts Warp, which arrays need
        kernels = rollout_kernels(self.real, layout.shape, self.conditions.features)
        arrays = self._arrays = RolloutArrays(layout, size, self.conditions, kernels, dtype, device)
        self.weights, self.trials, self.gradient = arrays.weights, arrays.trials, arrays.gradient
        self.noise, self.hidden_noise = arrays.noise, arrays.hidden_noise
        self.joint, self.muscle, self.hand, self.hidden = arrays.joint, arrays.muscle, arrays.hand, arrays.hidden
        self.excitation, self.terms = arrays.excitation, arrays.terms
        of_steps = size.n_networks, size.n_trials, size.n_steps
        self.observation = arrays.observation.view(*of_steps, -1)[..., : layout.shape.n_inputs]
        self._forward = self._record(kernels.roll, parameters, arrays.forward_structs)
        self._backward = []
        if size.n_streams:
            structs = arrays.forward_structs + arrays.adjoint_structs
            self._backward = self._record(kernels.roll_adjoint, parameters, structs)

    def load(self, trials: TrialTensors, first: int = 0) -> None:
        """Take ``B`` trials of each network, from trial ``first`` on, out of ``trials`` (S, n, …).

        Raises:
            ValueError: not as many networks, too few trials, or trials of another kind.
        """
        loaded, drawn = self.trials.tensors(), trials.tensors()
        if loaded.keys() != drawn.keys():
            raise ValueError(f"the rollout takes trials with {', '.join(loaded)}, got {', '.join(drawn)}.")
        parts = trials.part(first, self.size.n_trials).tensors()
        for name, tensor in loaded.items():
            part = parts[name]
            if part.shape != tensor.shape:  # a single trial would be done by all arms
                raise ValueError(f"the rollout takes trials of shape {tuple(tensor.shape)}, got {tuple(part.shape)}.")
            tensor.copy_(part)

    def share(self, jobs: list[Callable[[], Any]]) -> None:
        """Do jobs that its trials need, by its threads."""
        self._workers.share(jobs)

    def forward(self) -> None:
        """Do every trial once; fills the trajectories."""
        self._launch(self._forward)

    def targets(self) -> Targets:
        """Return where the targets were in the trials, and the hand's distances to them in the last :meth:`forward`."""
        return Targets.of(self.trials, self.hand, self._arm)

    def contributions(self, network: int) -> tuple[Tensor, Tensor]:
        """Return what each side of a network adds to the commands before the sigmoid, the dominant one first.

        Args:
            network: its index; it has two sides.

        Returns:
            Contributions (B, T, n_outputs) in the last :meth:`forward`.
        """
        open_gates = self._arrays.gates[network, [OUTPUT_DOMINANT, OUTPUT_NON_DOMINANT]]
        weights = open_gates[:, None] * self.layout.region(self.weights[network], "combination")  # (2, arms)
        outputs = self.layout.region(self.weights[network], "output")[:, :-1]  # (arms, width, n_muscles), no bias
        by_side = [
            torch.cat([weight * side @ output for weight, output in zip(of_side, outputs, strict=True)], dim=-1)
            for of_side, side in zip(weights, self.hidden[network, :, :, -2:].unbind(2), strict=True)  # (B, T, width)
        ]
        return by_side[0], by_side[1]

    def backward(self, term_weights: Tensor, upstream: TrajectoryGradients | None = None) -> Tensor:
        """Return gradients of losses of the last :meth:`forward` with respect to the weights.

        Args:
            term_weights: (streams, 3 or 6): each loss is, for every network, the sum over its trials and steps of these
                weights times the step's terms.
            upstream: gradients of what else each loss is made of.

        Returns:
            :attr:`gradient`, overwritten by the next call.

        Raises:
            ValueError: gradients of what ``size`` said that no loss looks at.
        """
        a, upstream = self._arrays, upstream or TrajectoryGradients()
        a.upstream_terms.copy_(term_weights)
        arrays = (a.upstream_joint, a.upstream_muscle, a.upstream_hand, a.upstream_hidden)
        for array, gradient in zip(arrays, upstream, strict=True):
            if array.numel():
                array.zero_() if gradient is None else array.copy_(gradient.reshape(array.shape))
            elif gradient is not None:
                raise ValueError("the rollout was made without room for gradients of states or of activity.")
        self._launch(self._backward)
        parts = self._workers.parts(self.size.n_networks)
        self._workers.share([functools.partial(self._assemble, part) for part in parts])
        return self.gradient

    def groups(self, networks: range | None = None) -> list[slice]:
        """Return ``networks``, all by default, in the groups that torch takes at once.

        One by one on a CPU, as a sum over several may be rounded otherwise than over one; all on CUDA, where a call of
        torch's costs more than the work that it starts.
        """
        networks = networks or range(self.size.n_networks)
        if self.device != "cpu":
            return [slice(networks.start, networks.stop)]
        return [slice(s, s + 1) for s in networks]

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

    def _record(self, kernel: wp.Kernel, parameters: Any, structs: list[Any]) -> list[Any]:
        """Record the kernel's launch once for each thread's part of the trials."""
        weights, trials, senses, *others = structs
        n_steps = self.size.n_steps
        sizes = [self.size.n_trials, n_steps, self.conditions.counts_from(n_steps)]
        return [
            wp.launch(
                kernel,
                dim=len(part),
                inputs=[parameters, weights, trials, senses, *sizes, part.start, *others],
                record_cmd=True,
                **launch_on(self.device),
            )
            for part in self._workers.parts(self.size.n_networks * self.size.n_trials)
        ]

    def _launch(self, launches: list[Any]) -> None:
        stream = launch_on(self.device).get("stream")
        self._workers.share([functools.partial(launch.launch, stream) for launch in launches])

    def _assemble(self, networks: range) -> None:
        """Make weight gradients of what each layer received, transposed, times the gradients of what it put out.

        Of samples n = B · T, streams K and hidden layers L, ``deltas`` is (n, K · L · width): one product gives what
        every layer received times the deltas of every layer, and only pairs that belong together are taken. Three large
        products are faster than the ten needed ones.
        """
        a, layout, shape, streams = self._arrays, self.layout, self.layout.shape, self.size.n_streams
        n_hidden, n_received = shape.layers * shape.sides, (shape.layers - 1) * shape.sides
        for group in self.groups(networks):
            deltas = a.delta_hidden[group].flatten(2)
            g = len(deltas)
            by_first = (a.observation[group].mT @ deltas).view(g, -1, streams, n_hidden, shape.width)
            by_hidden = (a.received[group].flatten(2).mT @ deltas).view(
                g, n_received, shape.width + 1, streams, n_hidden, shape.width
            )
            rows = self.gradient[:, group]  # (K, g, width of a row)
            first, hidden = layout.region(rows, "first"), layout.region(rows, "hidden")
            for side in range(shape.sides):
                of_side = by_first[:, :, :, side].permute(2, 0, 1, 3)  # (K, g, n_inputs + 1, width)
                first[:, :, side, :-1] = of_side[:, :, shape.seen_by(side)]
                first[:, :, side, -1] = of_side[:, :, -1]
            # A closed input gate lets through the bias, but no observation.
            first[..., :-1, :] *= a.gates[group, INPUT_DOMINANT : INPUT_DOMINANT + shape.sides, None, None]
            for index in range(n_received):
                # The first hidden layer of each side sees the inputs: what receives begins ``sides`` later.
                hidden[:, :, index] = by_hidden[:, index, :, :, index + shape.sides].permute(2, 0, 1, 3)
            if shape.sides == 2:
                layout.region(rows, "combination").copy_(a.combination_gradient[:, group].sum(2))
            output = layout.region(rows, "output")
            for arm in range(shape.arms):
                deltas = a.delta_output[group][:, :, :, arm].flatten(2)
                by_output = (a.combined[group][:, :, arm].mT @ deltas).view(g, -1, streams, shape.n_muscles)
                output[:, :, arm] = by_output.permute(2, 0, 1, 3)


def _check_fit(shape: NetworkShape, arms: int) -> None:
    """Raise a ValueError for networks that do not see and command so many arms."""
    needed = arms * View.of(arms).size, arms * N_MUSCLES
    if (shape.n_inputs, shape.n_outputs) != needed or (shape.sides == 2 and shape.arms != arms):
        raise ValueError(
            f"trials of {arms} arm(s) are for networks of {needed[0]} inputs and {needed[1]} outputs with "
            f"n_arms={arms}, got {shape.n_inputs} and {shape.n_outputs}."
        )
