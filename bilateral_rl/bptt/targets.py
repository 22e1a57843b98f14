"""Where the targets of trials are from step to step, and how far the hand is from them."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from bilateral_rl.bptt.trial_tensors import TrialTensors
from bilateral_rl.envs import Arm, ArmParameters
from bilateral_rl.envs.measures import TrialMeasures, trial_measures


class Targets(NamedTuple):
    """The targets that trials of ``T`` steps are judged by; of two arms, each hand is one of the B."""

    distance: Tensor
    """(S, B, T): from the hand to the target after each step (m)."""
    start_distance: Tensor
    """(S, B): likewise when the last target began (m)."""
    onset: Tensor | None
    """(S, B) int32: the step at which that was, T where no cue came; None in trials without a timeline: at once."""
    reaches: Tensor
    """(S, B) bool: whether the goal is another place than the start, rather than the hand's to keep."""

    @classmethod
    def of(cls, trials: TrialTensors, hand: Tensor, arm: ArmParameters) -> Targets:
        """Return the targets of ``trials`` (S, B, …) in which ``hand`` (S, B, T, 2) moved so."""
        angles = trials.start.flatten(0, 1)
        start = Arm(arm, hand.device, hand.dtype).rest(angles).cartesian[:, :2].view_as(trials.target)
        reaches = (start != trials.target).any(dim=-1)
        if trials.go is None or trials.jump is None or trials.jump_target is None:
            seen = trials.target[:, :, None]
            return cls((hand - seen).norm(dim=-1), (start - trials.target).norm(dim=-1), None, reaches)
        n_steps = hand.shape[2]
        step = torch.arange(n_steps, dtype=torch.int32, device=hand.device)
        jumped, cued = ((step >= when[:, :, None])[..., None] for when in (trials.jump, trials.go))
        seen = torch.where(cued, trials.target[:, :, None], start[:, :, None])
        seen = torch.where(jumped, trials.jump_target[:, :, None], seen)
        onset = torch.where(trials.jump < n_steps, trials.jump, trials.go).clamp(max=n_steps)
        path = torch.cat([start[:, :, None], hand], dim=2)  # (S, B, T + 1, 2) before each step, and after the last
        at = torch.where(onset < n_steps, onset, 0).long()[:, :, None, None].expand(-1, -1, 1, 2)
        last = seen[:, :, -1]  # of the last target, wherever it began
        return cls((hand - seen).norm(dim=-1), (path.gather(2, at)[:, :, 0] - last).norm(dim=-1), onset, reaches)

    def measures(self, index: int, threshold: float, rows: Tensor | None = None) -> TrialMeasures:
        """Return the measures of the trials of one network, or of some ``rows`` (B,) bool of them."""
        parts = {"distance": self.distance, "start_distance": self.start_distance, "onset": self.onset}
        chosen = slice(None) if rows is None else rows
        own = {name: part[index][chosen].cpu().numpy() for name, part in parts.items() if part is not None}
        return trial_measures(**own, threshold=threshold)
