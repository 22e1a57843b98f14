"""PPO with a reward stream, a critic and an advantage for each hemisphere."""

from __future__ import annotations

from collections import defaultdict

import torch
from stable_baselines3 import PPO
from torch import Tensor

from bilateral_rl.algorithms.on_policy import HemisphericOnPolicy, Log
from bilateral_rl.algorithms.stream_rollout import StreamBatch


class HemisphericPPO(HemisphericOnPolicy, PPO):
    """PPO (Schulman et al. 2017, arXiv 1707.06347) whose reward is a pair, dominant and non-dominant.

    Each stream has its own critic, generalized advantage (normalized by itself) and clipped policy loss. One
    optimizer step applies the routed gradients (``algorithms/routing.py``), clipped per parameter group.

    Arguments as for :class:`~bilateral_rl.algorithms.hemispheric.Hemispheric` and SB3's ``PPO``, but for two:
    ``max_grad_norm`` bounds the gradient norm of each parameter group, and ``ent_coef`` (a number or a schedule)
    weighs the entropy of the Gaussian before its squashing; stock PPO estimates the squashed one's from the sampled
    actions, with zero expected gradient: a bonus that does nothing.
    """

    def train(self) -> None:
        """Update the policy from :attr:`rollout`."""
        self.policy.set_training_mode(True)
        self._update_learning_rate(self.policy.optimizer)
        clip_range = self.clip_range(self._current_progress_remaining)  # type: ignore[operator]
        log: Log = defaultdict(list)
        for _ in range(self.n_epochs):
            completed = self._train_epoch(clip_range, log)
            self._n_updates += 1
            if not completed:
                break
        self._record(log)
        self.logger.record("train/clip_range", clip_range)

    def _train_epoch(self, clip_range: float, log: Log) -> bool:
        """One pass over the rollout; False if it stopped early because the policy had moved too far."""
        for batch in self.rollout.minibatches(self.batch_size, self.device):
            losses, approx_kl = self._losses(batch, clip_range, log)
            if self.target_kl is not None and approx_kl > 1.5 * self.target_kl:
                return False
            self._step(losses, log)
        return True

    def _losses(self, batch: StreamBatch, clip_range: float, log: Log) -> tuple[list[Tensor], float]:
        """Each stream's loss, and the approximate KL divergence from the policy that collected the batch."""
        log_ratio = self._log_prob(batch) - batch.old_log_prob
        values = self.policy.predict_stream_values(batch.observations)
        ratio = log_ratio.exp()
        clipped = ratio.clamp(1 - clip_range, 1 + clip_range)
        advantages = self._advantages(batch)
        policy_loss = -torch.min(advantages * ratio[:, None], advantages * clipped[:, None]).mean(dim=0)
        value_loss = (self._clipped_values(values, batch.old_values) - batch.returns).square().mean(dim=0)
        with torch.no_grad():
            approx_kl = (ratio - 1 - log_ratio).mean()
            log["train/approx_kl"].append(approx_kl)
            log["train/clip_fraction"].append(((ratio - 1).abs() > clip_range).float().mean())
        return self._stream_losses(policy_loss, value_loss, log), float(approx_kl)

    def _clipped_values(self, values: Tensor, old_values: Tensor) -> Tensor:
        if self.clip_range_vf is None:
            return values
        clip = self.clip_range_vf(self._current_progress_remaining)  # type: ignore[operator]
        return old_values + (values - old_values).clamp(-clip, clip)
