"""The batched, differentiable arm for PyTorch: state in, state out."""

from __future__ import annotations

from typing import Any, NamedTuple

import torch
import warp as wp
from torch import Tensor

from bilateral_rl.envs.arm.kernels import arm_kernels
from bilateral_rl.envs.arm.parameters import N_MUSCLES, ArmParameters
from bilateral_rl.envs.arm.physics import LENGTH, N_MUSCLE_ROWS, VELOCITY, ArmTypes, arm_types, kernel_parameters
from bilateral_rl.envs.arm.warp_start import known_device, launch_on
from bilateral_rl.envs.doors import renewed

_REAL = {torch.float32: wp.float32, torch.float64: wp.float64}


class ArmState(NamedTuple):
    """State of ``n`` arms, in the arm's dtype."""

    joint: Tensor
    """(n, 4): shoulder and elbow angle (rad), their velocities (rad/s)."""
    muscle: Tensor
    """(n, 7, 6): rows activation, muscle length (m), velocity (m/s), passive force-length, active force-length,
    normalized active force, force (N). Length and velocity are of the geometry one step before ``joint``."""
    cartesian: Tensor
    """(n, 4): hand x, y (m) and their velocities (m/s), of ``joint``."""


class Arm:
    """Planar two-joint, six-muscle arm (paper section 2), batched and differentiable.

    Args:
        parameters: physical constants.
        device: ``"cpu"`` or a CUDA device.
        dtype: ``torch.float32`` or ``torch.float64``.

    Numbers that are not finite pass through it, as through any operation of torch's.

    Raises:
        TypeError: parameters that are no :class:`ArmParameters`.
        ValueError: a dtype other than the two, a device that there is not, or parameters outside their range.
    """

    def __init__(
        self,
        parameters: ArmParameters | None = None,
        device: str | torch.device = "cpu",
        dtype: torch.dtype = torch.float32,
    ) -> None:
        if dtype not in _REAL:
            raise ValueError(f"the arm computes in torch.float32 or torch.float64, not {dtype}.")
        self.parameters = ArmParameters() if parameters is None else renewed(parameters, ArmParameters)
        self.device = torch.device(known_device(device))
        self.dtype = dtype
        self._kernels, self._types = arm_kernels(_REAL[dtype]), arm_types(_REAL[dtype])
        self._p = kernel_parameters(self.parameters, _REAL[dtype])
        self._optimal_length = self._tensor(self.parameters.optimal_muscle_length)
        self._max_velocity = self.parameters.normalized_max_velocity * self._optimal_length

    def rest(self, angles: Tensor) -> ArmState:
        """Return the state at rest at ``angles`` (n, 2) rad, muscles at their minimal activation; not differentiable.

        Raises:
            TypeError: no tensor of real numbers.
            ValueError: angles of another shape.
        """
        angles = self._converted("angles", angles)
        if angles.ndim != 2 or angles.shape[1] != 2:
            raise ValueError(f"angles must have shape (n, 2), got {tuple(angles.shape)}.")
        return self.state(torch.cat([angles, torch.zeros_like(angles)], dim=1))

    def state(self, joint: Tensor) -> ArmState:
        """Return the state with ``joint`` (n, 4), muscles at their minimal activation; not differentiable.

        Raises:
            TypeError: no tensor of real numbers.
            ValueError: a joint state of another shape.
        """
        joint = self._converted("joint", joint).detach().clone(memory_format=torch.contiguous_format)
        if joint.ndim != 2 or joint.shape[1] != 4:
            raise ValueError(f"joint must have shape (n, 4), got {tuple(joint.shape)}.")
        n = len(joint)
        muscle, cartesian = joint.new_empty(n, N_MUSCLE_ROWS, N_MUSCLES), joint.new_empty(n, 4)
        _launch(self, self._kernels.rest, "jmc", (joint, muscle, cartesian))
        return ArmState(joint, muscle, cartesian)

    def step(self, state: ArmState, excitation: Tensor, load: Tensor | None = None) -> ArmState:
        """Return the state one Euler step of ``parameters.timestep`` on.

        Args:
            state: the state at t.
            excitation: (n, 6), the muscle commands; values outside [min_activation, 1] act as the nearest bound.
            load: (n, 2), force on the hand (N); none by default.

        Returns:
            The state at t + 1, differentiable with respect to ``state``, ``excitation`` and ``load``.

        Raises:
            TypeError: no :class:`ArmState`, or no tensors of real numbers.
            ValueError: shapes that do not agree.
        """
        if not isinstance(state, ArmState):
            raise TypeError(f"state must be an ArmState, as rest and state return it, got {type(state).__name__}.")
        given = {"joint": state.joint, "muscle": state.muscle, "excitation": excitation, "load": load}
        if load is None:
            del given["load"]
        inputs = {name: self._converted(name, tensor) for name, tensor in given.items()}
        n = len(inputs["joint"]) if inputs["joint"].ndim else 0
        inputs.setdefault("load", inputs["joint"].new_zeros(n, 2))
        shapes = ((4,), (N_MUSCLE_ROWS, N_MUSCLES), (N_MUSCLES,), (2,))
        for (name, tensor), shape in zip(inputs.items(), shapes, strict=True):
            if tensor.shape != (n, *shape):
                raise ValueError(f"{name} of {n} arms must have shape {(n, *shape)}, got {tuple(tensor.shape)}.")
        return ArmState(*_Step.apply(self, *inputs.values()))  # type: ignore[no-untyped-call]

    def proprioception(self, state: ArmState) -> Tensor:
        """Return the sensed (n, 12): muscle lengths (optimal lengths), then velocities (maximal velocities)."""
        return torch.cat(
            [state.muscle[:, LENGTH] / self._optimal_length, state.muscle[:, VELOCITY] / self._max_velocity], dim=1
        )

    def _converted(self, name: str, tensor: object) -> Tensor:
        """Return ``tensor`` on the arm's device and in its precision; a gradient goes back through it.

        Raises:
            TypeError: no dense tensor of real numbers.
        """
        if not isinstance(tensor, Tensor):
            raise TypeError(f"{name} must be a torch tensor, got {type(tensor).__name__}.")
        real = not (tensor.is_complex() or tensor.is_quantized or tensor.dtype is torch.bool)
        if not real or tensor.layout is not torch.strided or tensor.is_meta:
            raise TypeError(f"{name} must be a dense tensor of real numbers, got {tensor.dtype}, {tensor.layout}.")
        return tensor.to(self.device, self.dtype)

    def _tensor(self, values: Any) -> Tensor:
        return torch.tensor(values, dtype=self.dtype, device=self.device)


class _Step(torch.autograd.Function):
    """The step kernel and its adjoint as one torch operation."""

    @staticmethod
    def forward(ctx: Any, arm: Arm, *inputs: Tensor) -> tuple[Tensor, ...]:
        inputs = tuple(t.contiguous() for t in inputs)
        n = len(inputs[0])
        outputs = (
            inputs[0].new_empty(n, 4),
            inputs[0].new_empty(n, N_MUSCLE_ROWS, N_MUSCLES),
            inputs[0].new_empty(n, 4),
        )
        ctx.arm = arm
        ctx.save_for_backward(*inputs, outputs[1])
        _launch(arm, arm._kernels.step, "jmel" + "jmc", (*inputs, *outputs))
        return outputs

    @staticmethod
    @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator]
    def backward(ctx: Any, *grad_outputs: Tensor) -> tuple[Tensor | None, ...]:
        tensors: tuple[Tensor, ...] = ctx.saved_tensors
        grad_inputs = [torch.empty_like(t) for t in tensors[:4]]
        grad_outputs = tuple((g if g.layout is torch.strided else g.to_dense()).contiguous() for g in grad_outputs)
        _launch(
            ctx.arm, ctx.arm._kernels.step_adjoint, "jmelm" + "jmc" + "jmel", (*tensors, *grad_outputs, *grad_inputs)
        )
        return (None, *grad_inputs)


def _launch(arm: Arm, kernel: wp.Kernel, letters: str, tensors: tuple[Tensor, ...]) -> None:
    """Run ``kernel`` for every arm of ``tensors``, each (n, …) and of the element type that its letter stands for."""
    elements = _elements(arm._types)
    arrays = [
        wp.from_torch(tensor, dtype=elements[letter], requires_grad=False)
        for letter, tensor in zip(letters, tensors, strict=True)
    ]
    wp.launch(kernel, dim=len(tensors[0]), inputs=[arm._p, *arrays], **launch_on(arm.device))


def _elements(types: ArmTypes) -> dict[str, Any]:
    """Return the element type of joint, muscle and cartesian state, excitation and load, by first letter."""
    return {"j": types.vec4, "m": types.rows, "c": types.vec4, "e": types.vec6, "l": types.vec2}
