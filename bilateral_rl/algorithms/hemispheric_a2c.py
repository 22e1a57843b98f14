"""A2C with a reward stream, a critic and an advantage for each hemisphere."""

from __future__ import annotations

from collections import defaultdict

from stable_baselines3 import A2C

from bilateral_rl.algorithms.on_policy import HemisphericOnPolicy, Log


class HemisphericA2C(HemisphericOnPolicy, A2C):
    """A2C (Mnih et al. 2016, arXiv 1602.01783) whose reward is a pair, dominant and non-dominant.

    Each stream has its own critic, advantage and policy loss; one optimizer step over the whole rollout applies the
    routed gradients. Arguments as for :class:`~bilateral_rl.algorithms.hemispheric.Hemispheric` and SB3's ``A2C``,
    with the two differences of :class:`~bilateral_rl.algorithms.hemispheric_ppo.HemisphericPPO`.
    """

    def train(self) -> None:
        """Update the policy from :attr:`rollout`, once."""
        self.policy.set_training_mode(True)
        self._update_learning_rate(self.policy.optimizer)
        log: Log = defaultdict(list)
        for batch in self.rollout.minibatches(self.rollout.log_prob.size, self.device):
            policy_loss = -(self._advantages(batch) * self._log_prob(batch)[:, None]).mean(dim=0)
            values = self.policy.predict_stream_values(batch.observations)
            value_loss = (values - batch.returns).square().mean(dim=0)
            self._step(self._stream_losses(policy_loss, value_loss, log), log)
        self._n_updates += 1
        self._record(log)
