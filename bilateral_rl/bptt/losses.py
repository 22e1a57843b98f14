"""The supervised losses of the streams: the terms of the steps, and three kinds of weight penalty (paper section 4)."""

from __future__ import annotations

import torch
from torch import Tensor

from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.rollout import Rollout, TrajectoryGradients
from bilateral_rl.envs.arm import ArmParameters
from bilateral_rl.envs.arm.physics import LENGTH, VELOCITY
from bilateral_rl.vocabulary import LOSS_WEIGHTS, SIDES, Loss, Penalty, stream_mix, stream_penalties

_RATE_WEIGHT = 0.05
"""Weight of the mean squared rate of change in the last two kinds."""


class StreamLosses:
    """One loss for each stream of a model, of each of the stacked networks.

    Args:
        loss: what trains the model.
        penalty: kind of the weight penalty.
        coefficient: of the penalty.
        layout: of the networks.
        arm: whose steps they move.

    Attributes:
        n_streams: 2 for a specialized model, else 1.
        term_weights: (streams, 3), of the means of a step's terms.
        penalty_weights: of the penalty in each stream.
        weight_decay: per stream, the factor of a weight in the gradient: of kind ``weights``, else 0.
    """

    def __init__(self, loss: Loss, penalty: Penalty, coefficient: float, layout: Layout, arm: ArmParameters) -> None:
        self.penalty, self.coefficient, self._layout, self._arm = penalty, coefficient, layout, arm
        by_side = torch.tensor([LOSS_WEIGHTS[side].terms for side in SIDES])
        self.term_weights = torch.tensor(stream_mix(loss)) @ by_side
        self.penalty_weights = stream_penalties(loss)
        self.n_streams = len(self.penalty_weights)
        self.weight_decay = [w * coefficient if penalty == "weights" else 0.0 for w in self.penalty_weights]
        self._has_penalty = coefficient > 0 and any(self.penalty_weights)

    @property
    def watches_state(self) -> bool:
        """Whether a gradient with respect to states is needed."""
        return self._has_penalty and self.penalty == "released"

    @property
    def watches_activity(self) -> bool:
        """Whether a gradient with respect to hidden activity is needed."""
        return self._has_penalty and self.penalty == "activity"

    def values(self, rollout: Rollout) -> Tensor:
        """(streams, S) float64: the losses of what ``rollout`` last did."""
        # Network by network: a reduction over the stack may round otherwise for another number of networks.
        means = torch.stack([terms.flatten(0, 1).mean(0, dtype=torch.float64) for terms in rollout.terms])
        values = self.term_weights.to(means) @ means.t()
        if self._has_penalty:
            penalties = torch.stack([self._penalty(rollout, s) for s in range(rollout.size.n_networks)])
            values = values + torch.outer(values.new_tensor(self.penalty_weights), penalties)
        return values

    def gradient(self, rollout: Rollout) -> Tensor:
        """(streams, S, width): their gradients, but for the share of ``weight_decay``."""
        samples = rollout.size.n_trials * rollout.size.n_steps
        return rollout.backward(self.term_weights.to(rollout.weights) / samples, self._seeds(rollout))

    def _penalty(self, rollout: Rollout, s: int) -> Tensor:
        """The penalty, unweighted, of network ``s``."""
        if self.penalty == "weights":
            return self.coefficient * 0.5 * rollout.weights[s].square().sum(dtype=torch.float64)
        sizes = [_size_and_rate(x, self._arm.timestep) for x in self._penalized(rollout, s)]
        return self.coefficient * torch.stack([size + _RATE_WEIGHT * rate for size, rate in sizes]).sum()

    def _penalized(self, rollout: Rollout, s: int) -> list[Tensor]:
        """What the penalty of kind ``activity`` or ``released`` is taken of, each (B, T, …)."""
        n_layers = self._layout.shape.layers * self._layout.shape.sides
        if self.penalty == "activity":
            return [rollout.hidden[s, :, :, layer] for layer in range(n_layers)]
        lengths, velocities = (rollout.muscle[s, :, :, row] / norm for row, norm in self._sensed(rollout))
        felt = torch.cat([lengths, velocities], dim=-1)
        return [rollout.joint[s], rollout.muscle[s], felt, rollout.hand[s]][:n_layers]

    def _sensed(self, rollout: Rollout) -> list[tuple[int, Tensor]]:
        """The rows of the muscle state that are felt, and their norms."""
        optimal = rollout.muscle.new_tensor(self._arm.optimal_muscle_length)
        return [(LENGTH, optimal), (VELOCITY, self._arm.normalized_max_velocity * optimal)]

    def _seeds(self, rollout: Rollout) -> TrajectoryGradients:
        """Gradients of the penalty with respect to trajectories, for each stream."""
        if not self.watches_state and not self.watches_activity:
            return TrajectoryGradients()
        per_network = [
            [_size_and_rate_gradient(x, self._arm.timestep) for x in self._penalized(rollout, s)]
            for s in range(rollout.size.n_networks)
        ]
        parts = [torch.stack(part) for part in zip(*per_network, strict=True)]
        scales = rollout.terms.new_tensor(self.penalty_weights) * self.coefficient

        def of_streams(part: Tensor) -> Tensor:
            return scales.view(-1, *[1] * part.ndim) * part

        if self.penalty == "activity":
            return TrajectoryGradients(hidden=of_streams(torch.stack(parts, dim=3)))
        parts += [torch.zeros_like(x) for x in (rollout.joint, rollout.muscle)][len(parts) :]
        joint, muscle = parts[:2]
        if len(parts) > 2:
            for (row, norm), of_felt in zip(self._sensed(rollout), parts[2].chunk(2, dim=-1), strict=True):
                muscle[:, :, :, row] += of_felt / norm
        hand = of_streams(parts[3]) if len(parts) > 3 else None
        return TrajectoryGradients(joint=of_streams(joint), muscle=of_streams(muscle), hand=hand)


def _size_and_rate(x: Tensor, dt: float) -> tuple[Tensor, Tensor]:
    """Mean x² and mean ẋ² of ``x`` (B, T, …)."""
    rate = x.diff(dim=1) / dt
    return x.square().mean(dtype=torch.float64), rate.square().mean(dtype=torch.float64)


def _size_and_rate_gradient(x: Tensor, dt: float) -> Tensor:
    """Gradient of mean x² + 0.05 · mean ẋ² with respect to ``x`` (B, T, …)."""
    gradient = x * (2.0 / x.numel())
    change = x.diff(dim=1)
    change *= 2.0 * _RATE_WEIGHT / (dt * dt * change.numel())
    gradient[:, 1:] += change
    gradient[:, :-1] -= change
    return gradient
