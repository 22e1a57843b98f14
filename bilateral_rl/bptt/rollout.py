"""Stacked networks on the arm, each with trials of its own: what happens, and the losses' gradients."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
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
from bilateral_rl.bptt.rollout_kernels import rollout_kernels
from bilateral_rl.envs.arm import ArmParameters
from bilateral_rl.envs.arm.parameters import N_MUSCLES
from bilateral_rl.envs.arm.physics import N_MUSCLE_ROWS, kernel_parameters
from bilateral_rl.envs.arm.warp_start import launch_place
from bilateral_rl.policies.lesions import Lesion

_REAL = {torch.float32: wp.float32, torch.float64: wp.float64}


class TrialTensors(NamedTuple):
    """What sets trials apart; leading axes are any, such as (networks, trials)."""

    start: Tensor
    """(…, 2): angles (rad); the arm is at rest."""
    target: Tensor
    """(…, 2): of the hand (m)."""
    load: Tensor
    """(…, 2): on the hand (N)."""


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
        n_networks: S.
        n_trials: B.
        n_steps: T.
        n_streams: losses whose gradients are wanted; 0 for none.
        watches_state: whether a loss looks at states: joints, muscles or the hand, but for its distance to the target.
        watches_activity: whether a loss looks at hidden activity.
        device: ``"cpu"`` or a CUDA device.
        dtype: ``torch.float32`` or ``torch.float64``.
        pool: threads that share the trials; None for the calling one.
        n_threads: how many they are.

    Attributes:
        weights: (S, width), the networks' parameters; write into it.
        trials: what the next :meth:`forward` does; write into it. (S, B, 2) each.
        joint: (S, B, T, 4), after each step, as in :class:`~bilateral_rl.envs.arm.ArmState`.
        muscle: (S, B, T, 7, 6), likewise.
        hand: (S, B, T, 2) m.
        excitation: (S, B, T, 6).
        terms: (S, B, T, 3): Cartesian 1, Cartesian 2 and activation of each step.
        hidden: (S, B, T, layers · sides, width): activity of each hidden layer.
        observation: (S, B, T, n_inputs).
    """

    def __init__(
        self,
        layout: Layout,
        arm: ArmParameters,
        n_networks: int,
        n_trials: int,
        n_steps: int,
        n_streams: int = 0,
        watches_state: bool = False,
        watches_activity: bool = False,
        device: str = "cpu",
        dtype: torch.dtype = torch.float32,
        pool: ThreadPoolExecutor | None = None,
        n_threads: int = 1,
    ) -> None:
        self.layout, self.device, self.dtype = layout, device, dtype
        self.n_networks, self.n_trials, self.n_steps, self.n_streams = n_networks, n_trials, n_steps, n_streams
        self._watches_state, self._watches_activity = watches_state, watches_activity
        self._pool, self._n_threads = pool, n_threads if pool is not None else 1
        self.real = _REAL[dtype]
        self._kernels = rollout_kernels(self.real, layout.shape)
        self._p = kernel_parameters(arm, self.real)
        self._allocate()
        self._forward_launches = self._launches(self._kernels.roll, [self._activity_args, self._out_args])
        if n_streams:
            self._backward_launches = self._launches(
                self._kernels.roll_adjoint, [self._activity_args, self._out_args, *self._gradient_args]
            )

    def forward(self) -> None:
        """Every trial once; fills the trajectories."""
        self._launch(self._forward_launches)

    def backward(self, term_weights: Tensor, seeds: TrajectoryGradients | None = None) -> Tensor:
        """Gradients of losses of the last :meth:`forward` with respect to the weights.

        Args:
            term_weights: (streams, 3): each loss is, for every network, the sum over its trials and steps of these
                weights times the step's terms.
            seeds: gradients of what else each loss is made of.

        Returns:
            (streams, S, width), overwritten by the next call.
        """
        self._term_weights.copy_(term_weights)
        seeds = seeds or TrajectoryGradients()
        for own, given in (
            (self._of_joint, seeds.joint),
            (self._of_muscle, seeds.muscle),
            (self._of_hand, seeds.hand),
            (self._of_hidden, seeds.hidden),
        ):
            if own.numel():
                own.zero_() if given is None else own.copy_(given.reshape(own.shape))
            elif given is not None:
                raise ValueError("the rollout was made without room for gradients of states or of activity.")
        self._launch(self._backward_launches)
        networks = range(self.n_networks)
        parts = _parts(self.n_networks, self._n_threads)
        self._share([functools.partial(self._assemble, networks[part]) for part in parts])
        return self.gradient

    def set_lesions(self, lesions: Sequence[Lesion]) -> None:
        """Lesion network ``s`` by ``lesions[s]``."""
        gates = torch.ones(self.n_networks, N_GATES)
        sites = {
            "dominant": (INPUT_DOMINANT, OUTPUT_DOMINANT),
            "non_dominant": (INPUT_NON_DOMINANT, OUTPUT_NON_DOMINANT),
        }
        for gate, lesion in zip(gates, lesions, strict=True):
            if lesion.input_of:
                gate[sites[lesion.input_of][0]] = 0.0
            if lesion.output_of:
                gate[sites[lesion.output_of][1]] = 0.0
            if lesion.callosum:
                gate[CALLOSUM] = 0.0
        self._gates.copy_(gates)

    def _allocate(self) -> None:
        shape, layout = self.layout.shape, self.layout
        s, b, t, k = self.n_networks, self.n_trials, self.n_steps, self.n_streams
        n_hidden, n_received = shape.layers * shape.sides, (shape.layers - 1) * shape.sides
        self.weights = self._zeros(s, layout.width)
        self._gates = self._zeros(s, N_GATES) + 1.0
        self.trials = TrialTensors(*(self._zeros(s, b, 2) for _ in range(3)))
        self.joint = self._zeros(s, b, t, 4)
        self.muscle = self._zeros(s, b, t, N_MUSCLE_ROWS, N_MUSCLES)
        self.hand = self._zeros(s, b, t, 2)
        self.excitation = self._zeros(s, b, t, shape.n_outputs)
        self.terms = self._zeros(s, b, t, 3)
        self.hidden = self._zeros(s, b, t, n_hidden, shape.width)
        self._seen = self._zeros(s, b * t, shape.n_inputs + 1)
        self._received = self._zeros(s, b * t, n_received, shape.width + 1)
        self._combined = self._zeros(s, b * t, shape.width + 1)
        self.observation = self._seen.view(s, b, t, -1)[..., : shape.n_inputs]

        self._term_weights = self._zeros(k, 3)
        state, activity = int(self._watches_state), int(self._watches_activity)
        self._of_joint = self._zeros(k, s * b * t * state, 4)
        self._of_muscle = self._zeros(k, s * b * t * state, N_MUSCLE_ROWS, N_MUSCLES)
        self._of_hand = self._zeros(k, s * b * t * state, 2)
        self._of_hidden = self._zeros(k, s * b * t * activity, n_hidden, shape.width)
        self._delta_hidden = self._zeros(s, b * t, k, n_hidden, shape.width)
        self._delta_output = self._zeros(s, b * t, k, shape.n_outputs)
        self._of_combination = self._zeros(k, s * b, 2)
        self._carried = (
            self._zeros(k, s * b, 4),
            self._zeros(k, s * b, N_MUSCLE_ROWS, N_MUSCLES),
            self._zeros(k, s * b, 4),
        )
        self.gradient = self._zeros(k, s, layout.width)
        self._make_structs()

    def _make_structs(self) -> None:
        kernels, network, physics = self._kernels, self._kernels.network, self._kernels.physics
        shape = self.layout.shape
        real = self.real
        sides, width = shape.sides, shape.width
        weights = network.Weights()
        first = "hidden.0.weight" if sides == 1 else "dominant.0.weight"
        weights.first = self._row_view(first, (sides, shape.n_inputs + 1, width), network.vec_side)
        after_first = self.layout.offset(first) + sides * (shape.n_inputs + 1) * width
        weights.hidden = self._row_view(after_first, ((shape.layers - 1) * sides, width + 1, width), network.vec_side)
        combination = "combination_dominant" if sides == 2 else "output.weight"
        weights.combination = wp.from_torch(self._at(combination, 2), dtype=real)
        weights.output = self._row_view("output.weight", (width + 1, shape.n_outputs), network.vec_out)
        weights.gates = wp.from_torch(self._gates, dtype=real)

        trials = kernels.Trials()
        for name, tensor in self.trials._asdict().items():
            setattr(trials, name, wp.from_torch(tensor.view(-1, 2), dtype=physics.vec2))
        activity = network.Activity()
        n = self._seen.shape[0] * self._seen.shape[1]
        activity.observation = wp.from_torch(self._seen.view(n, -1), dtype=network.vec_in_one)
        activity.received = wp.from_torch(self._received.view(n, *self._received.shape[2:]), dtype=network.vec_side_one)
        activity.hidden = wp.from_torch(self.hidden.view(n, -1, width), dtype=network.vec_side)
        activity.combined = wp.from_torch(self._combined.view(n, -1), dtype=network.vec_side_one)
        out = kernels.Trajectories()
        for name, dtype in (
            ("joint", physics.vec4),
            ("muscle", kernels.rows),
            ("hand", physics.vec2),
            ("excitation", physics.vec6),
            ("terms", kernels.vec_terms),
        ):
            setattr(out, name, wp.from_torch(getattr(self, name).flatten(0, 2), dtype=dtype))
        self._head = [self._p, weights, trials, self.n_trials, self.n_steps]
        self._activity_args, self._out_args = activity, out
        if not self.n_streams:
            return
        gradients, deltas, carried = kernels.Gradients(), network.Deltas(), kernels.Carried()
        gradients.terms = wp.from_torch(self._term_weights, dtype=kernels.vec_terms)
        gradients.joint = wp.from_torch(self._of_joint, dtype=physics.vec4)
        gradients.muscle = wp.from_torch(self._of_muscle, dtype=kernels.rows)
        gradients.hand = wp.from_torch(self._of_hand, dtype=physics.vec2)
        deltas.hidden = wp.from_torch(self._delta_hidden.flatten(0, 1), dtype=network.vec_side)
        deltas.output = wp.from_torch(self._delta_output.flatten(0, 1), dtype=network.vec_out)
        deltas.combination = wp.from_torch(self._of_combination, dtype=real)
        deltas.activity = wp.from_torch(self._of_hidden, dtype=network.vec_side)
        for name, tensor, dtype in zip(
            ("joint", "muscle", "hand"), self._carried, (physics.vec4, kernels.rows, physics.vec4), strict=True
        ):
            setattr(carried, name, wp.from_torch(tensor, dtype=dtype))
        self._gradient_args = [gradients, deltas, carried]

    def _at(self, place: str | int, size: int) -> Tensor:
        offset = self.layout.offset(place) if isinstance(place, str) else place
        return self.weights[:, offset : offset + size]

    def _row_view(self, place: str | int, shape: tuple[int, ...], dtype: Any) -> Any:
        """A Warp view of part of every row, an array of vectors (S, *shape[:-1])."""
        size = 1
        for n in shape:
            size *= n
        return wp.from_torch(self._at(place, size).view(self.n_networks, *shape), dtype=dtype)

    def _launches(self, kernel: Any, arguments: list[Any]) -> list[Any]:
        """The kernel recorded once for each thread's part of the trials."""
        return [
            wp.launch(
                kernel,
                dim=part.stop - part.start,
                inputs=[*self._head, part.start, *arguments],
                record_cmd=True,
                **launch_place(self.device),
            )
            for part in _parts(self.n_networks * self.n_trials, self._n_threads)
        ]

    def _assemble(self, networks: range) -> None:
        """Weight gradients from what each layer received and the gradient of what it put out.

        The products also pair what does not belong together: three large ones are faster than the ten needed ones.
        """
        layout, shape = self.layout, self.layout.shape
        sides, width = shape.sides, shape.width
        after_first = sides * (shape.n_inputs + 1) * width
        after_hidden = after_first + (shape.layers - 1) * sides * (width + 1) * width
        output = layout.offset("output.weight")
        for s in networks:
            deltas = self._delta_hidden[s].flatten(1)
            of_first = (self._seen[s].t() @ deltas).view(-1, self.n_streams, shape.layers * sides, width)
            of_hidden = (self._received[s].flatten(1).t() @ deltas).view(
                (shape.layers - 1) * sides, width + 1, self.n_streams, shape.layers * sides, width
            )
            of_output = self._combined[s].t() @ self._delta_output[s].flatten(1)
            row = self.gradient[:, s]
            first = row[:, :after_first].view(self.n_streams, sides, -1, width)
            first.copy_(of_first[:, :, :sides].permute(1, 2, 0, 3))
            first[:, :, :-1] *= self._gates[s, INPUT_DOMINANT : INPUT_DOMINANT + sides].view(sides, 1, 1)
            hidden = row[:, after_first:after_hidden].view(self.n_streams, (shape.layers - 1) * sides, width + 1, width)
            for index in range((shape.layers - 1) * sides):
                hidden[:, index] = of_hidden[index, :, :, index + sides].transpose(0, 1)
            if sides == 2:
                by_trial = self._of_combination.view(self.n_streams, self.n_networks, self.n_trials, 2)[:, s]
                row[:, after_hidden : after_hidden + 2] = by_trial.sum(1)
            row[:, output : output + of_output.numel() // self.n_streams].view(
                self.n_streams, width + 1, shape.n_outputs
            ).copy_(of_output.view(width + 1, self.n_streams, -1).transpose(0, 1))

    def _launch(self, launches: list[Any]) -> None:
        stream = launch_place(self.device).get("stream")
        self._share([functools.partial(launch.launch, stream) for launch in launches])

    def _share(self, jobs: list[Callable[[], Any]]) -> None:
        if self._pool is None:
            for job in jobs:
                job()
        else:
            for done in [self._pool.submit(job) for job in jobs]:
                done.result()

    def _zeros(self, *shape: int) -> Tensor:
        return torch.zeros(shape, dtype=self.dtype, device=self.device)


def _parts(n: int, parts: int) -> list[slice]:
    """``range(n)`` cut into at most ``parts`` parts of nearly equal size."""
    parts = min(n, parts)
    bounds = [n * i // parts for i in range(parts + 1)]
    return [slice(a, b) for a, b in itertools.pairwise(bounds)]
