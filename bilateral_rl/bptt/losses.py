"""The supervised losses of the streams: the terms of the steps, and three kinds of weight penalty (paper section 4)."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.rollout import Rollout, TrajectoryGradients
from bilateral_rl.bptt.rollout_arrays import RolloutSize
from bilateral_rl.bptt.rollout_structs import n_terms
from bilateral_rl.envs.arm import ArmParameters
from bilateral_rl.envs.arm.physics import LENGTH, VELOCITY
from bilateral_rl.envs.losses import LossSettings
from bilateral_rl.vocabulary import Loss, Penalty, stream_mix, stream_penalties

_RATE_WEIGHT = 0.05
"""Weight of the mean squared rate of change in the penalties of kinds ``activity`` and ``released``."""


class StreamLosses:
    """The loss of each stream of a model, for every network of a stack.

    Args:
        loss: what trains the model.
        penalty: kind of the weight penalty.
        coefficient: the penalty's coefficient λ.
        layout: layout of the networks' parameters.
        arm: the arm that they move, for the units of what a penalty is taken of.
        settings: weights of terms and penalty on both sides; the paper's by default.

    Attributes:
        n_streams: 2 for a specialized model, else 1.
        term_weights: (streams, 3), weights of the means of the terms of a step; (streams, 6) with ``FURTHER_TERMS``
            where the settings need them.
        penalty_weights: weight of the penalty in each stream.
        weight_decay: per stream, the factor of a weight in its gradient: not 0 for a penalty of kind ``weights`` only.
    """

    def __init__(
        self,
        loss: Loss,
        penalty: Penalty,
        coefficient: float,
        layout: Layout,
        arm: ArmParameters,
        settings: LossSettings | None = None,
    ) -> None:
        self.penalty, self.coefficient, self._layout, self._arm = penalty, coefficient, layout, arm
        settings = settings or LossSettings()
        by_side = torch.tensor(settings.weights)[:, : n_terms(not settings.is_of_the_paper)]
        self.term_weights = torch.tensor(stream_mix(loss)) @ by_side
        self.penalty_weights = stream_penalties(loss, settings.penalties)
        self.n_streams = len(self.penalty_weights)
        self.weight_decay = [w * coefficient if penalty == "weights" else 0.0 for w in self.penalty_weights]
        self._has_penalty = coefficient > 0 and any(self.penalty_weights)

    @property
    def watches_state(self) -> bool:
        """Whether a loss depends on states in another way than by the terms of the steps."""
        return self._has_penalty and self.penalty == "released"

    @property
    def watches_activity(self) -> bool:
        """Whether a loss depends on hidden activity in another way than by the excitation."""
        return self._has_penalty and self.penalty == "activity"

    def rollout_size(self, n_networks: int, n_trials: int, n_steps: int) -> RolloutSize:
        """Return the size of a rollout that gives the gradients of these losses."""
        return RolloutSize(n_networks, n_trials, n_steps, self.n_streams, self.watches_state, self.watches_activity)

    def values(self, rollout: Rollout) -> Tensor:
        """Return the losses (streams, S) float64 of the rollout's last forward pass."""
        groups = rollout.groups()
        means = torch.cat([rollout.terms[group].mean((1, 2), dtype=torch.float64) for group in groups])  # (S, terms)
        # No matrix product, whose last bits depend on the number of networks on some processors: (streams, S, terms).
        values = (self.term_weights.to(means)[:, None] * means).sum(dim=2)
        if self._has_penalty:
            penalties = torch.cat([self._penalty(rollout, group) for group in groups])
            values = values + torch.outer(values.new_tensor(self.penalty_weights), penalties)
        return values

    def gradient(self, rollout: Rollout) -> Tensor:
        """Return their gradients (streams, S, width), but for those of ``weight_decay``, which the optimizer adds."""
        samples = math.prod(rollout.terms.shape[1:3])  # steps of every hand
        return rollout.backward(self.term_weights.to(rollout.weights) / samples, self._penalty_gradients(rollout))

    def _penalty(self, rollout: Rollout, group: slice) -> Tensor:
        """Return the penalty of each network of ``group`` (g,) float64, not yet weighted by stream."""
        if self.penalty == "weights":
            free = rollout.weights[group].where(self._layout.free.to(rollout.device), 0.0)
            return self.coefficient * 0.5 * free.square().sum(1, dtype=torch.float64)
        sizes = [_size_and_rate(x, self._arm.timestep) for x in self._penalized(rollout, group)]
        return self.coefficient * torch.stack([size + _RATE_WEIGHT * rate for size, rate in sizes]).sum(0)

    def _penalized(self, rollout: Rollout, group: slice) -> list[Tensor]:
        """Return what a penalty of kind ``activity`` or ``released`` is taken of in ``group``, each (g, B, T, …)."""
        n_layers = self._layout.shape.layers * self._layout.shape.sides
        if self.penalty == "activity":
            return [rollout.hidden[group, :, :, layer] for layer in range(n_layers)]
        lengths, velocities = (rollout.muscle[group, :, :, row] / norm for row, norm in self._sensed(rollout))
        proprioception = torch.cat([lengths, velocities], dim=-1)
        # The released code pairs the first outputs of its network with the hidden layers: only that many are penalized.
        return [rollout.joint[group], rollout.muscle[group], proprioception, rollout.hand[group]][:n_layers]

    def _sensed(self, rollout: Rollout) -> list[tuple[int, Tensor]]:
        """Return the sensed rows of the muscle state, and the (6,) by which each is divided to be sensed."""
        optimal = rollout.muscle.new_tensor(self._arm.optimal_muscle_length)
        return [(LENGTH, optimal), (VELOCITY, self._arm.normalized_max_velocity * optimal)]

    def _penalty_gradients(self, rollout: Rollout) -> TrajectoryGradients:
        """Return each stream's gradients of the penalty with respect to trajectories; none for kind ``weights``."""
        if not self.watches_state and not self.watches_activity:
            return TrajectoryGradients()
        by_group = [
            [_size_and_rate_gradient(x, self._arm.timestep) for x in self._penalized(rollout, group)]
            for group in rollout.groups()
        ]
        parts = [torch.cat(part) for part in zip(*by_group, strict=True)]  # each (S, B, T, …)
        scales = rollout.terms.new_tensor(self.penalty_weights) * self.coefficient

        def by_stream(part: Tensor) -> Tensor:
            """(streams, S, B, T, …): the gradient times each stream's weight of the penalty."""
            return scales.view(-1, *[1] * part.ndim) * part

        if self.penalty == "activity":
            return TrajectoryGradients(hidden=by_stream(torch.stack(parts, dim=3)))
        # Kind ``released``: the parts of joint, muscle, proprioception and hand, as many as there are hidden layers.
        # With one layer the muscles' is missing: zero. What is sensed is part of the muscles' state, and joins it.
        parts += [torch.zeros_like(x) for x in (rollout.joint, rollout.muscle)][len(parts) :]
        joint, muscle = parts[:2]
        if len(parts) > 2:
            for (row, norm), gradient in zip(self._sensed(rollout), parts[2].chunk(2, dim=-1), strict=True):
                muscle[:, :, :, row] += gradient / norm
        hand = by_stream(parts[3]) if len(parts) > 3 else None
        return TrajectoryGradients(joint=by_stream(joint), muscle=by_stream(muscle), hand=hand)


def _size_and_rate(x: Tensor, dt: float) -> tuple[Tensor, Tensor]:
    """Return mean x² and mean ẋ² of each network's ``x`` (g, B, T, …), both (g,), with ẋ in units per second."""
    rate = x.diff(dim=2) / dt
    return (
        x.square().flatten(1).mean(1, dtype=torch.float64),
        rate.square().flatten(1).mean(1, dtype=torch.float64),
    )


def _size_and_rate_gradient(x: Tensor, dt: float) -> Tensor:
    """Return the gradient of mean x² + 0.05 · mean ẋ² of each network with respect to ``x``, both (g, B, T, …).

    A difference x[t] − x[t − 1] pulls x[t] one way and x[t − 1] the other.
    """
    gradient = x * (2.0 / x[0].numel())
    change = x.diff(dim=2)
    change *= 2.0 * _RATE_WEIGHT / (dt * dt * change[0].numel())
    gradient[:, :, 1:] += change
    gradient[:, :, :-1] -= change
    return gradient
