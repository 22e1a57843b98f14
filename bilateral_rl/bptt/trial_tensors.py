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
_SPRING: dict[str, tuple[int, ...]] = {"stiffness": (), "damping": ()}
_STEPS = ("go", "jump", "pulse_window")


@dataclass(frozen=True)
class TrialTensors:
    """Trials; leading axes are any, such as (networks, trials). Iterating goes over the tensors that there are.

    Of two arms, all but the spring have a row for each hand, in its arm's own frame: (networks, trials · arms), where
    row ``i * arms + a`` is arm ``a`` of trial ``i``.
    """

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
    stiffness: Tensor | None = None
    """(…) of the spring between the hands of each trial (N/m)."""
    damping: Tensor | None = None
    """(…) likewise (N·s/m)."""

    @classmethod
    def zeros(cls, shape: tuple[int, ...], features: Features, dtype: torch.dtype, device: str = "cpu") -> TrialTensors:
        """Return tensors of zeros with what ``shape`` (…, n) trials of ``features`` have, a row a hand."""
        of_hands = _ALWAYS | (_TIMELINE if features.timeline else {}) | (_FORCES if features.forces else {})
        hands = (*shape[:-1], shape[-1] * features.arms)
        shapes = {name: (*hands, *size) for name, size in of_hands.items()}
        if features.arms > 1:
            shapes |= {name: (*shape, *size) for name, size in _SPRING.items()}
        return cls(
            **{
                name: torch.zeros(of_name, dtype=torch.int32 if name in _STEPS else dtype, device=device)
                for name, of_name in shapes.items()
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

    @property
    def n_arms(self) -> int:
        """Arms of a trial."""
        return 1 if self.stiffness is None else self.start[..., 0].numel() // self.stiffness.numel()

    def in_order(self, order: Tensor) -> TrialTensors:
        """Return the trials (S, n, …) of each network in its own ``order`` (S, m) int64."""
        networks = torch.arange(len(order), device=order.device)[:, None]
        return self._by_trial(lambda tensor: tensor[networks, order])

    def part(self, first: int, n: int) -> TrialTensors:
        """Return ``n`` of the trials (S, …) of each network, from number ``first`` on, or as many as there are."""
        return self._by_trial(lambda tensor: tensor[:, first : first + n])

    def _by_trial(self, choose: Callable[[Tensor], Tensor]) -> TrialTensors:
        """Return what ``choose`` takes of every tensor, in which a trial's rows (S, n, arms, …) go together."""
        arms = self.n_arms
        if arms == 1:
            return self.map(choose)
        chosen = {
            name: choose(tensor) if name in _SPRING else choose(tensor.unflatten(1, (-1, arms))).flatten(1, 2)
            for name, tensor in self.tensors().items()
        }
        return TrialTensors(**chosen)
