"""SAC with a reward stream and critics for each hemisphere."""

from __future__ import annotations

from typing import ClassVar

import torch
from stable_baselines3 import SAC
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from stable_baselines3.common.utils import polyak_update
from torch import Tensor, nn

from bilateral_rl.algorithms.off_policy import HemisphericOffPolicy, Log
from bilateral_rl.policies.off_policy import SAC_ALIASES, BilateralSACPolicy


class HemisphericSAC(HemisphericOffPolicy, SAC):
    """Soft actor-critic (Haarnoja et al. 2018, arXiv 1812.05905) whose reward is a pair, dominant and non-dominant.

    Each stream has its own critics, of which the smallest value counts, and its own target critics. The loss of a
    stream is minus that value, minus the temperature times the entropy; its gradients are routed
    (``algorithms/routing.py``). There is one temperature, learned along the shared group's gradient. Arguments as for
    :class:`~bilateral_rl.algorithms.off_policy.HemisphericOffPolicy` and SB3's ``SAC``; ``target_update_interval``
    counts updates.
    """

    POLICY_CLASS = BilateralSACPolicy
    policy_aliases: ClassVar[dict[str, type[BasePolicy]]] = dict(SAC_ALIASES)
    policy: BilateralSACPolicy
    _CRITIC_LOSS = 0.5

    def parameter_groups(self) -> dict[str, list[nn.Parameter]]:
        """Every trained parameter by owner; the log of the temperature is shared."""
        groups = super().parameter_groups()
        if self.log_ent_coef is not None:
            groups["shared"].append(self.log_ent_coef)  # type: ignore[arg-type] # SB3 holds it as a plain tensor
        return groups

    def _optimizers(self) -> list[torch.optim.Optimizer]:
        return [*super()._optimizers(), *self._temperature_optimizers()]

    def _temperature_optimizers(self) -> list[torch.optim.Optimizer]:
        return [] if self.ent_coef_optimizer is None else [self.ent_coef_optimizer]

    def _update(self, batch: ReplayBufferSamples, log: Log) -> None:
        actor = self.policy.actor
        actions, log_prob = actor.action_log_prob(batch.observations)
        ent_coef = self._temperature()
        with torch.no_grad():
            next_actions, next_log_prob = actor.action_log_prob(batch.next_observations)
            next_values = self._values(self.critic_target, batch.next_observations, next_actions).amin(dim=2)
            next_values -= ent_coef * next_log_prob[:, None]
        self._update_critics(batch, next_values, log)
        values = self._values(self.critic, batch.observations, actions).amin(dim=2)
        losses = (ent_coef * log_prob[:, None] - values).mean(dim=0)
        log["actor_loss"].append(losses.detach())
        log["train/ent_coef"].append(ent_coef.squeeze())
        log["train/entropy"].append(-log_prob.detach().mean())
        log["train/std"].append(actor.log_std.detach().exp().mean())
        losses = losses + self._temperature_loss(log_prob.detach())
        self._update_network(losses, self._temperature_optimizers())
        if self._n_updates % self.target_update_interval == 0:
            self._follow(self.critic, self.critic_target)
            polyak_update(self.batch_norm_stats, self.batch_norm_stats_target, 1.0)

    def _temperature(self) -> Tensor:
        return self.ent_coef_tensor if self.log_ent_coef is None else self.log_ent_coef.detach().exp()

    def _temperature_loss(self, log_prob: Tensor) -> Tensor:
        """(): the same for every stream; zero if the temperature is given."""
        if self.log_ent_coef is None:
            return log_prob.new_zeros(())
        assert isinstance(self.target_entropy, float)
        return -(self.log_ent_coef * (log_prob + self.target_entropy)).mean()
