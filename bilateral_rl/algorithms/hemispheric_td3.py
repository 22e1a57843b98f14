"""TD3 with a reward stream and critics for each hemisphere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
import torch
from stable_baselines3 import TD3
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.noise import ActionNoise, NormalActionNoise
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.type_aliases import GymEnv, Schedule
from stable_baselines3.common.utils import polyak_update

from bilateral_rl.algorithms.off_policy import ActorValue, HemisphericOffPolicy
from bilateral_rl.algorithms.side_logs import Log
from bilateral_rl.algorithms.stream_replay import StreamSamples
from bilateral_rl.policies.off_policy import TD3_ALIASES, BilateralTD3Policy
from bilateral_rl.vocabulary import PENALTY_WEIGHTS, Group, Loss


class HemisphericTD3(HemisphericOffPolicy, TD3):
    """TD3 (Fujimoto et al. 2018, arXiv 1802.09477) whose reward is a pair, dominant and non-dominant.

    Each stream has its own critics and their targets, of which the smallest value counts; the deterministic policy
    gradient through a stream's critics is that stream's, and is routed (``algorithms/routing.py``). The optimizers are
    Adam with its fused kernel.

    The arguments are those of SB3's ``TD3``, with its defaults, and twelve more, from ``loss`` to
    ``normalize_streams``.

    Args:
        policy: "UnilateralPolicy", "BilateralPolicy" or "CallosalPolicy", or a subclass of
            :class:`~bilateral_rl.policies.BilateralTD3Policy`.
        env: the environment, or its registered id. It gives the pair of rewards as ``last_vector_reward`` (n_envs, 2)
            or ``info["vector_reward"]`` (2,).
        loss: "specialized" for a stream by side; "combined", "dominant" or "non_dominant" for a single stream.
        weight_penalty: λ of the L2 penalty λ · ½ Σ w² on the network (paper section 4). Specialized, the
            non-dominant hemisphere gets it in full (weight 2), shared layers by half, the dominant hemisphere not.
            It is scaled as the rewards are, by ``reward_scale``, and with them when streams are normalized.
        reward_scale: factor on all rewards before the critics see them; measures and logs are unscaled.
        critic_warm_up: updates of the critics before the first of the network. The cost of effort shows at once and
            what movement is good for only later, so that a network that follows fresh critics learns to do nothing.
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
        standardize_inputs: whether the critics see observations and traces standardized, by the mean and the standard
            deviation of the steps before the first update.
        actor_value: what the network follows of a stream's critics: the smallest value, "min", their mean, "mean", or
            that of the first one, "first". Targets are always the smallest. By default as in SB3: "first".
        normalize_streams: whether each stream's gradient is divided by the running root mean square of ‖∂Q/∂a‖, so
            that what is shared follows no stream just because its rewards are larger.
        learning_rate: Adam's learning rate for network and critics, a number or a function of the remaining progress
            (1 to 0).
        buffer_size: steps that the replay buffer holds, over all environments.
        learning_starts: steps, over all environments, with random actions before the first update.
        batch_size: samples of an update.
        tau: share by which target networks move towards their networks at a time.
        gamma: discount.
        train_freq: steps of each environment between updates, or a pair like ``(2, "episode")``.
        gradient_steps: updates at a time; -1 for as many as there were steps.
        action_noise: noise added to actions; None for none, with which TD3 explores only before ``learning_starts``.
        replay_buffer_class: must be None: the streams need a buffer of their own.
        replay_buffer_kwargs: further arguments of that buffer, such as ``handle_timeout_termination``; all else
            follows from the algorithm.
        optimize_memory_usage: must be False: the buffer keeps next observations.
        n_steps: must be 1: there are no returns of several steps.
        policy_delay: updates of the critics for one of the network and the targets.
        target_policy_noise: standard deviation of the noise on the target network's actions.
        target_noise_clip: bound of that noise.
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

    POLICY_CLASS = BilateralTD3Policy
    policy_aliases: ClassVar[dict[str, type[BasePolicy]]] = dict(TD3_ALIASES)
    policy: BilateralTD3Policy
    actor_value = "first"  # of models that were saved before there was a choice

    def __init__(
        self,
        policy: str | type[BilateralTD3Policy],
        env: GymEnv | str | None,
        loss: Loss = "specialized",
        weight_penalty: float = 0.001,
        reward_scale: float = 1.0,
        *,
        critic_warm_up: int = 0,
        action_traces: Sequence[float] = (),
        frozen: Sequence[Group] = (),
        penalty_weights: Sequence[float] = PENALTY_WEIGHTS,
        critic_rate_factor: float = 1.0,
        network_epsilon: float | None = None,
        standardize_inputs: bool = False,
        actor_value: ActorValue = "first",
        normalize_streams: bool = False,
        learning_rate: float | Schedule = 1e-3,
        buffer_size: int = 1_000_000,
        learning_starts: int = 100,
        batch_size: int = 256,
        tau: float = 0.005,
        gamma: float = 0.99,
        train_freq: int | tuple[int, str] = 1,
        gradient_steps: int = 1,
        action_noise: ActionNoise | None = None,
        replay_buffer_class: type[ReplayBuffer] | None = None,
        replay_buffer_kwargs: dict[str, Any] | None = None,
        optimize_memory_usage: bool = False,
        n_steps: int = 1,
        policy_delay: int = 2,
        target_policy_noise: float = 0.2,
        target_noise_clip: float = 0.5,
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
            critic_warm_up=critic_warm_up,
            action_traces=action_traces,
            frozen=frozen,
            penalty_weights=penalty_weights,
            critic_rate_factor=critic_rate_factor,
            network_epsilon=network_epsilon,
            standardize_inputs=standardize_inputs,
            actor_value=actor_value,
            normalize_streams=normalize_streams,
            learning_rate=learning_rate,
            buffer_size=buffer_size,
            learning_starts=learning_starts,
            batch_size=batch_size,
            tau=tau,
            gamma=gamma,
            train_freq=train_freq,
            gradient_steps=gradient_steps,
            action_noise=action_noise,
            replay_buffer_class=replay_buffer_class,
            replay_buffer_kwargs=replay_buffer_kwargs,
            optimize_memory_usage=optimize_memory_usage,
            n_steps=n_steps,
            policy_delay=policy_delay,
            target_policy_noise=target_policy_noise,
            target_noise_clip=target_noise_clip,
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
        std = np.full(n_actions, arguments["action_noise"])
        return arguments | {"action_noise": NormalActionNoise(np.zeros(n_actions), std)}

    def _update(self, batch: StreamSamples, log: Log) -> None:
        policy = self.policy
        with torch.no_grad():
            # Q'_s(o', a'), the smallest of the stream's target critics, at the target network's action with noise:
            # similar actions shall have similar values.
            noise = torch.randn_like(batch.actions) * self.target_policy_noise
            noise = noise.clamp(-self.target_noise_clip, self.target_noise_clip)
            next_actions = (policy.actor_target(batch.next_observations) + noise).clamp(-1, 1)
            next_values = self._next_values(batch, next_actions)
        self._update_critics(batch, next_values, log)
        if self._n_updates % self.policy_delay == 0:
            # Loss of stream s: -mean Q_s(o, π(o)).
            self._update_network(self._actor_losses(batch, policy.actor(batch.observations), log))
            self._follow(self.critic, self.critic_target)
            self._follow(policy.actor, policy.actor_target)
            polyak_update(self.critic_batch_norm_stats, self.critic_batch_norm_stats_target, 1.0)
            polyak_update(self.actor_batch_norm_stats, self.actor_batch_norm_stats_target, 1.0)
