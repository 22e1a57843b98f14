"""TD3 with a reward stream and critics for each hemisphere."""

from __future__ import annotations

from typing import ClassVar

import torch
from stable_baselines3 import TD3
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from stable_baselines3.common.utils import polyak_update

from bilateral_rl.algorithms.off_policy import HemisphericOffPolicy, Log
from bilateral_rl.policies.off_policy import TD3_ALIASES, BilateralTD3Policy


class HemisphericTD3(HemisphericOffPolicy, TD3):
    """TD3 (Fujimoto et al. 2018, arXiv 1802.09477) whose reward is a pair, dominant and non-dominant.

    Each stream has its own critics, of which the smallest value counts, and its own target critics; the deterministic
    policy gradient through a stream's first critic is that stream's, and is routed (``algorithms/routing.py``).
    Arguments as for :class:`~bilateral_rl.algorithms.off_policy.HemisphericOffPolicy` and SB3's ``TD3``.
    """

    POLICY_CLASS = BilateralTD3Policy
    policy_aliases: ClassVar[dict[str, type[BasePolicy]]] = dict(TD3_ALIASES)
    policy: BilateralTD3Policy

    def _update(self, batch: ReplayBufferSamples, log: Log) -> None:
        policy = self.policy
        with torch.no_grad():
            noise = torch.randn_like(batch.actions) * self.target_policy_noise
            noise = noise.clamp(-self.target_noise_clip, self.target_noise_clip)
            next_actions = (policy.actor_target(batch.next_observations) + noise).clamp(-1, 1)
            next_values = self._values(self.critic_target, batch.next_observations, next_actions).amin(dim=2)
        self._update_critics(batch, next_values, log)
        if self._n_updates % self.policy_delay == 0:
            losses = -policy.first_values(batch.observations, policy.actor(batch.observations)).mean(dim=0)
            log["actor_loss"].append(losses.detach())
            self._update_network(losses)
            self._follow(self.critic, self.critic_target)
            self._follow(policy.actor, policy.actor_target)
            polyak_update(self.critic_batch_norm_stats, self.critic_batch_norm_stats_target, 1.0)
            polyak_update(self.actor_batch_norm_stats, self.actor_batch_norm_stats_target, 1.0)
