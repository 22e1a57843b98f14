"""What sets trials apart, as the tensors that rollouts read."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from bilateral_rl.bptt.features import Features

_ALWAYS = {"start": (2,), "target": (2,), "load": (2,)}
_TIMELINE = {"go": (), "jump": (), "jump_target": (2,)}
_FORCES = {"offset": (2,), "velocity_gain": (2, 2), "position_gain": (2, 2), "pulse": (2,), "pulse_window": (2,)}
_STEPS = ("go", "jump", "pulse_window")


@dataclass(frozen=True)
class TrialTensors:
    """Trials; leading axes are any, such as (networks, trials). Iterating goes over the tensors that there are."""

    start: Tensor
    """(…, 2): angles at the start (rad); the arm is at rest."""
    target: Tensor
    """(…, 2): position of the target (m), from step ``go`` on in trials with a timeline."""
    load: Tensor
    """(…, 2): force on the hand (N)."""
    go: Tensor | None = None
    """(…) int32: step from which on the target is seen; till then it is where the hand started."""
    jump: Tensor | None = None
    """(…) int32: step from which on the target is ``jump_target``."""
    jump_target: Tensor | None = None
    """(…, 2): position (m)."""
    offset: Tensor | None = None
    """(…, 2): of the force offset + B v − K x on a hand at x of velocity v (N)."""
    velocity_gain: Tensor | None = None
    """(…, 2, 2): B (N·s/m)."""
    position_gain: Tensor | None = None
    """(…, 2, 2): K (N/m)."""
    pulse: Tensor | None = None
    """(…, 2): force (N) in the steps of ``pulse_window``."""
    pulse_window: Tensor | None = None
    """(…, 2) int32: first step of the pulse, and first after it."""

    @classmethod
    def zeros(cls, shape: tuple[int, ...], features: Features, dtype: torch.dtype, device: str = "cpu") -> TrialTensors:
        """Return tensors of zeros with what trials of ``features`` have, each (*shape, …)."""
        sizes = _ALWAYS | (_TIMELINE if features.timeline else {}) | (_FORCES if features.forces else {})
        return cls(
            **{
                name: torch.zeros((*shape, *size), dtype=torch.int32 if name in _STEPS else dtype, device=device)
                for name, size in sizes.items()
            }
        )

    @classmethod
    def stack(cls, trials: Sequence[TrialTensors]) -> TrialTensors:
        """Return them along a new first axis."""
        return cls(**{name: torch.stack([getattr(each, name) for each in trials]) for name in trials[0].tensors()})

    def tensors(self) -> dict[str, Tensor]:
        """Return the tensors that there are by name."""
        by_name = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return {name: tensor for name, tensor in by_name.items() if tensor is not None}

    def __iter__(self) -> Iterator[Tensor]:
        return iter(self.tensors().values())

    def map(self, function: Callable[[Tensor], Tensor]) -> TrialTensors:
        """Return what ``function`` makes of every tensor."""
        return TrialTensors(**{name: function(tensor) for name, tensor in self.tensors().items()})

    def in_order(self, order: Tensor) -> TrialTensors:
        """Return the trials (S, n, …) of each network in its own ``order`` (S, m) int64."""
        networks = torch.arange(len(order), device=order.device)[:, None]
        return self.map(lambda tensor: tensor[networks, order])
