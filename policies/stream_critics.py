"""The critics of SAC and TD3, which may see more than the network does, and in units of their own."""

from __future__ import annotations

from typing import Any

import torch
from stable_baselines3.common.policies import ContinuousCritic
from stable_baselines3.common.preprocessing import get_action_dim
from torch import Tensor

from bilateral_rl.policies.motor_policy import check_traces


class StreamCritics(ContinuousCritic):
    """SB3's critics of all streams in one list, which may see traces of past actions besides the observation.

    Args:
        features_dim: number of features that are extracted of an observation.
        n_traces: traces of past actions that the critics see; 0 for none.
        standardize_inputs: whether observations and traces are standardized by means and standard deviations that
            :meth:`measure_inputs` takes once; until then they are left as they are.
        **kwargs: further arguments of SB3's ``ContinuousCritic``.
    """

    input_mean: Tensor
    input_std: Tensor

    def __init__(
        self, *, features_dim: int, n_traces: int = 0, standardize_inputs: bool = False, **kwargs: Any
    ) -> None:
        n_actions = get_action_dim(kwargs["action_space"])
        self.traces_dim = n_traces * (n_actions + 1)
        n_inputs = features_dim + self.traces_dim
        super().__init__(features_dim=n_inputs, **kwargs)
        self.features_dim = features_dim
        self.standardize_inputs = standardize_inputs
        if standardize_inputs:
            self.register_buffer("input_mean", torch.zeros(n_inputs))
            self.register_buffer("input_std", torch.ones(n_inputs))

    def forward(self, obs: Tensor, actions: Tensor, traces: Tensor | None = None) -> tuple[Tensor, ...]:
        """Return each critic's value (b, 1) of actions (b, n_actions) in [-1, 1].

        Raises:
            ValueError: traces (b, traces_dim) that are missing or of another size.
        """
        inputs = torch.cat([self.inputs(obs, traces), actions], dim=1)
        return tuple(network(inputs) for network in self.q_networks)

    def values_by_stream(
        self, obs: Tensor, actions: Tensor, traces: Tensor | None, n_critics: int, n_first: int
    ) -> Tensor:
        """Return the values of actions that are each stream's own tensor, so that one pass gives each its gradient.

        Args:
            obs: (b, n_observed).
            actions: (n_streams, b, n_actions), in [-1, 1].
            traces: (b, traces_dim).
            n_critics: critics of a stream.
            n_first: how many of those are asked, from the first on.

        Returns:
            (b, n_streams, n_first).
        """
        with torch.no_grad():  # as in SB3: what the actor's features extractor learns comes through the action
            common = self.inputs(obs, traces)
        values = []
        for stream, action in enumerate(actions):
            inputs, first = torch.cat([common, action], dim=1), stream * n_critics
            values.append(torch.cat([network(inputs) for network in self.q_networks[first : first + n_first]], dim=1))
        return torch.stack(values, dim=1)

    def inputs(self, obs: Tensor, traces: Tensor | None) -> Tensor:
        """Return what the critics see besides the action, (b, features_dim + traces_dim)."""
        inputs = self._raw_inputs(obs, traces)
        return (inputs - self.input_mean) / self.input_std if self.standardize_inputs else inputs

    @torch.no_grad()
    def measure_inputs(self, obs: Tensor, traces: Tensor | None) -> None:
        """Standardize from now on by the mean and standard deviation of these inputs; what is constant keeps its unit.

        Args:
            obs: (n, n_observed), more than one.
            traces: (n, traces_dim).
        """
        inputs = self._raw_inputs(obs, traces)
        mean, std = inputs.mean(dim=0), inputs.std(dim=0)
        varies = std > 1e-5 * mean.abs()  # beyond rounding
        self.input_mean.copy_(mean)
        self.input_std.copy_(torch.where(varies, std, 1.0))

    def _raw_inputs(self, obs: Tensor, traces: Tensor | None) -> Tensor:
        check_traces(self.traces_dim, traces)
        # Learn a features extractor that the actor shares by the actor's loss only, as SB3 does.
        with torch.set_grad_enabled(torch.is_grad_enabled() and not self.share_features_extractor):
            features = self.extract_features(obs, self.features_extractor)
        return features if traces is None or not self.traces_dim else torch.cat([features, traces], dim=1)
