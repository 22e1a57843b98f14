"""PPO with a reward stream, a critic and an advantage for each hemisphere."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.type_aliases import GymEnv, Schedule
from stable_baselines3.common.utils import FloatSchedule
from torch import Tensor

from bilateral_rl.algorithms.on_policy import HemisphericOnPolicy
from bilateral_rl.algorithms.side_logs import Log
from bilateral_rl.algorithms.stream_rollout import StreamBatch
from bilateral_rl.policies import BilateralActorCriticPolicy
from bilateral_rl.vocabulary import PENALTY_WEIGHTS, Group, Loss


class HemisphericPPO(HemisphericOnPolicy, PPO):
    """PPO (Schulman et al. 2017, arXiv 1707.06347) whose reward is a pair, dominant and non-dominant.

    Each stream has its own critic, generalized advantage (normalized by itself) and clipped policy loss. One
    optimizer step applies the routed gradients (``algorithms/routing.py``), clipped per parameter group. The optimizer
    is Adam with its fused kernel.

    The arguments are those of SB3's ``PPO``, with its defaults, and eight more, from ``loss`` to
    ``network_epsilon``. Two mean something else: ``ent_coef`` and ``max_grad_norm``.

    Args:
        policy: "UnilateralPolicy", "BilateralPolicy" or "CallosalPolicy", or a subclass of
            :class:`~bilateral_rl.policies.BilateralActorCriticPolicy`.
        env: the environment, or its registered id. It gives the pair of rewards as ``last_vector_reward`` (n_envs, 2)
            or ``info["vector_reward"]`` (2,).
        loss: "specialized" for a stream by side; "combined", "dominant" or "non_dominant" for a single stream.
        weight_penalty: λ of the L2 penalty λ · ½ Σ w² on the network (paper section 4). Specialized, the
            non-dominant hemisphere gets it in full (weight 2), shared layers by half, the dominant hemisphere not.
            It is scaled as the rewards are: by ``reward_scale``, and with them when advantages are normalized.
        reward_scale: factor on all rewards before the critics see them; measures and logs are unscaled.
        action_traces: decays, in [0, 1), of running averages of the past actions that the critics see besides the
            observation; none by default. They tell critics of hidden states of actuators, such as the activation of
            muscles (``algorithms/action_traces.py``). The network sees the observation alone.
        frozen: groups of the network's parameters that do not learn, of "dominant", "non_dominant" and "shared";
            critics do, and so does the exploration.
        penalty_weights: weight of the weight penalty in the dominant and in the non-dominant loss, the paper's by
            default.
        critic_rate_factor: learning rate of the critics, in multiples of ``learning_rate``. Critics that learn faster
            than the network know more of what it is to follow. Features extractors learn at the network's rate.
        network_epsilon: ε of Adam (or RMSprop) for all but the critics, beside the root mean square of a gradient; None
            for that of the optimizer. A larger one gives small gradients small steps, so that hemispheres which want a
            little more and a little less of the same command pull against each other more slowly.
        learning_rate: Adam's learning rate, a number or a function of the remaining progress (1 to 0).
        n_steps: steps of each environment between updates.
        batch_size: largest number of samples in a minibatch.
        n_epochs: passes over the rollout in an update.
        gamma: discount.
        gae_lambda: trade-off of bias and variance of the generalized advantages.
        clip_range: bound of the probability ratio's distance from 1, a number or a function of the remaining progress.
        clip_range_vf: likewise, bound of the change of a value; None for none. It depends on the scale of rewards.
        normalize_advantage: whether to normalize each stream's advantages over a minibatch.
        ent_coef: weight of the entropy of the Gaussian before its squashing, a number or a function of the remaining
            progress. Stock PPO estimates the squashed one's from the sampled actions, with zero expected gradient: a
            bonus that does nothing.
        vf_coef: weight of the value loss.
        max_grad_norm: bound of the gradient norm of each parameter group by itself.
        use_sde: must be False: there is no state-dependent exploration (gSDE).
        sde_sample_freq: must be -1, as there is no gSDE.
        rollout_buffer_class: must be None: the streams need a buffer of their own.
        rollout_buffer_kwargs: must be None or empty: all that the buffer takes follows from the algorithm.
        target_kl: approximate KL divergence beyond 1.5 times of which an update ends early; None for no bound.
        stats_window_size: number of trials that logged returns average over.
        tensorboard_log: folder for tensorboard's files; None for none.
        policy_kwargs: arguments of the policy; what the arguments above say of its critics is given by itself.
        verbose: 0 for no output, 1 for information, 2 for debugging.
        seed: seed of all random numbers; None for a random one.
        device: where the networks are: "cpu", "cuda", …, or "auto".

    Raises:
        ValueError: an unknown loss, another policy than bilateral_rl's, observations that are not a Box, or an
            argument that is not available.
    """

    def __init__(
        self,
        policy: str | type[BilateralActorCriticPolicy],
        env: GymEnv | str | None,
        loss: Loss = "specialized",
        weight_penalty: float = 0.001,
        reward_scale: float = 1.0,
        *,
        action_traces: Sequence[float] = (),
        frozen: Sequence[Group] = (),
        penalty_weights: Sequence[float] = PENALTY_WEIGHTS,
        critic_rate_factor: float = 1.0,
        network_epsilon: float | None = None,
        learning_rate: float | Schedule = 3e-4,
        n_steps: int = 2048,
        batch_size: int = 64,
        n_epochs: int = 10,
        gamma: float = 0.99,
        gae_lambda: float = 0.95,
        clip_range: float | Schedule = 0.2,
        clip_range_vf: float | Schedule | None = None,
        normalize_advantage: bool = True,
        ent_coef: float | Schedule = 0.0,
        vf_coef: float = 0.5,
        max_grad_norm: float = 0.5,
        use_sde: bool = False,
        sde_sample_freq: int = -1,
        rollout_buffer_class: type[RolloutBuffer] | None = None,
        rollout_buffer_kwargs: dict[str, Any] | None = None,
        target_kl: float | None = None,
        stats_window_size: int = 100,
        tensorboard_log: str | None = None,
        policy_kwargs: dict[str, Any] | None = None,
        verbose: int = 0,
        seed: int | None = None,
        device: torch.device | str = "auto",
        _init_setup_model: bool = True,
    ) -> None:
        super().__init__(
            policy,
            env,
            loss=loss,
            weight_penalty=weight_penalty,
            reward_scale=reward_scale,
            action_traces=action_traces,
            frozen=frozen,
            penalty_weights=penalty_weights,
            critic_rate_factor=critic_rate_factor,
            network_epsilon=network_epsilon,
            learning_rate=learning_rate,
            n_steps=n_steps,
            batch_size=batch_size,
            n_epochs=n_epochs,
            gamma=gamma,
            gae_lambda=gae_lambda,
            clip_range=clip_range,
            clip_range_vf=clip_range_vf,
            normalize_advantage=normalize_advantage,
            ent_coef=ent_coef,
            vf_coef=vf_coef,
            max_grad_norm=max_grad_norm,
            use_sde=use_sde,
            sde_sample_freq=sde_sample_freq,
            rollout_buffer_class=rollout_buffer_class,
            rollout_buffer_kwargs=rollout_buffer_kwargs,
            target_kl=target_kl,
            stats_window_size=stats_window_size,
            tensorboard_log=tensorboard_log,
            policy_kwargs=policy_kwargs,
            verbose=verbose,
            seed=seed,
            device=device,
            _init_setup_model=_init_setup_model,
        )

    @classmethod
    def constructor_arguments(
        cls, hyperparameters: Mapping[str, Any], timesteps: int, n_envs: int, n_actions: int
    ) -> dict[str, Any]:
        arguments = super().constructor_arguments(hyperparameters, timesteps, n_envs, n_actions)
        arguments["batch_size"] = _even_batch(arguments["batch_size"], arguments["n_steps"] * n_envs)
        return arguments

    def train(self) -> None:
        """Update the policy from the rollout buffer."""
        self.policy.set_training_mode(True)
        self._update_learning_rate(self.policy.optimizer)
        clip_range = FloatSchedule(self.clip_range)(self._current_progress_remaining)
        log: Log = defaultdict(list)
        for _ in range(self.n_epochs):
            completed = self._train_epoch(clip_range, log)
            self._n_updates += 1
            if not completed:
                break
        self._check_policy()
        self._record(log)
        self.logger.record("train/clip_range", clip_range)

    def _train_epoch(self, clip_range: float, log: Log) -> bool:
        """Pass over the rollout once; return False if it stopped early because the policy had moved too far."""
        for batch in self.rollout_buffer.get(self.batch_size):
            losses, scales, approx_kl = self._losses(batch, clip_range, log)
            if self.target_kl is not None and approx_kl > 1.5 * self.target_kl:
                return False
            self._step(losses, scales, log)
        return True

    def _losses(self, batch: StreamBatch, clip_range: float, log: Log) -> tuple[list[Tensor], list[float], float]:
        """Return each stream's loss, by how much it scales rewards, and the policy's approximate KL divergence.

        The divergence is that from the policy that collected the batch.
        """
        # ρ = π(a) / π_old(a). The squashing changes both densities by the same factor, so that the Gaussians before it
        # have the same ratio. It is one ratio (b,) for both streams; advantages and values are each stream's.
        log_ratio = self._log_prob(batch) - batch.old_log_prob  # (b,)
        values = self.policy.predict_stream_values(batch.observations, batch.traces)  # (b, n_streams)
        ratio = log_ratio.exp()
        clipped = ratio.clamp(1 - clip_range, 1 + clip_range)
        advantages, scales = self._advantages(batch)  # (b, n_streams)
        # The clipped surrogate of stream s: -mean min(ρ A_s, clip(ρ, 1 - ε, 1 + ε) A_s). The minimum makes it
        # pessimistic: nothing is gained by moving ρ beyond the bound, but what is lost there counts in full.
        policy_loss = -torch.min(advantages * ratio[:, None], advantages * clipped[:, None]).mean(dim=0)  # (n_streams,)
        value_loss = (self._clipped_values(values, batch.old_values) - batch.returns).square().mean(dim=0)
        with torch.no_grad():
            # E[ρ - 1 - log ρ] under the old policy is KL(old, new): unlike E[-log ρ], no sample of it is negative.
            approx_kl = (ratio - 1 - log_ratio).mean()
            log["train/approx_kl"].append(approx_kl)
            log["train/clip_fraction"].append(((ratio - 1).abs() > clip_range).float().mean())
        return self._stream_losses(policy_loss, value_loss, log), scales, float(approx_kl)

    def _clipped_values(self, values: Tensor, old_values: Tensor) -> Tensor:
        """Return ``values`` (b, n_streams), no further from ``old_values`` than ``clip_range_vf`` allows."""
        if self.clip_range_vf is None:
            return values
        clip = FloatSchedule(self.clip_range_vf)(self._current_progress_remaining)
        return old_values + (values - old_values).clamp(-clip, clip)


def _even_batch(largest: int, samples: int) -> int:
    """Return the minibatch size that splits ``samples`` into the fewest, most equal parts of at most ``largest``."""
    return math.ceil(samples / math.ceil(samples / largest))
