"""SAC with a reward stream and critics for each hemisphere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import torch
from stable_baselines3 import SAC
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.noise import ActionNoise
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.type_aliases import GymEnv, Schedule
from stable_baselines3.common.utils import polyak_update
from torch import Tensor, nn

from bilateral_rl.algorithms.off_policy import ActorValue, HemisphericOffPolicy
from bilateral_rl.algorithms.side_logs import Log
from bilateral_rl.algorithms.stream_replay import StreamSamples
from bilateral_rl.policies.off_policy import SAC_ALIASES, BilateralSACPolicy
from bilateral_rl.vocabulary import PENALTY_WEIGHTS, Group, Loss


class HemisphericSAC(HemisphericOffPolicy, SAC):
    """Soft actor-critic (Haarnoja et al. 2018, arXiv 1812.05905) whose reward is a pair, dominant and non-dominant.

    Each stream has its own critics and their targets, of which the smallest value counts. The loss of a stream is
    minus its value, minus the temperature times the entropy; its gradients are routed
    (``algorithms/routing.py``). There is one temperature, learned along the shared group's gradient. The optimizers
    are Adam with its fused kernel.

    The arguments are those of SB3's ``SAC``, with its defaults, and thirteen more, from ``loss`` to
    ``policy_delay``.

    Args:
        policy: "UnilateralPolicy", "BilateralPolicy" or "CallosalPolicy", or a subclass of
            :class:`~bilateral_rl.policies.BilateralSACPolicy`.
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
            that of the first one, "first". Targets are always the smallest. By default as in SB3: "min".
        normalize_streams: whether each stream's gradient is divided by the running root mean square of ‖∂Q/∂a‖, so
            that what is shared follows no stream just because its rewards are larger.
        policy_delay: updates of the critics for one of the network and the temperature. A network that follows critics
            more slowly lets its sides push less against each other before the critics know what that is good for.
        learning_rate: Adam's learning rate for network, critics and temperature, a number or a function of the
            remaining progress (1 to 0).
        buffer_size: steps that the replay buffer holds, over all environments.
        learning_starts: steps, over all environments, with random actions before the first update.
        batch_size: samples of an update.
        tau: share by which target critics move towards their critics at a time.
        gamma: discount.
        train_freq: steps of each environment between updates, or a pair like ``(2, "episode")``.
        gradient_steps: updates at a time; -1 for as many as there were steps.
        action_noise: noise added to actions; None for none.
        replay_buffer_class: must be None: the streams need a buffer of their own.
        replay_buffer_kwargs: further arguments of that buffer, such as ``handle_timeout_termination``; all else
            follows from the algorithm.
        optimize_memory_usage: must be False: the buffer keeps next observations.
        n_steps: must be 1: there are no returns of several steps.
        ent_coef: temperature, the weight of the entropy; "auto" to learn it, "auto_0.1" to begin at 0.1.
        target_update_interval: updates between those of the target critics.
        target_entropy: entropy (nats) that a learned temperature steers to; "auto" for minus the number of actions, and
            where the temperature is given.
        use_sde: must be False: there is no state-dependent exploration (gSDE).
        sde_sample_freq: must be -1, as there is no gSDE.
        use_sde_at_warmup: must be False, likewise.
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

    POLICY_CLASS = BilateralSACPolicy
    FIXED = (*HemisphericOffPolicy.FIXED, "ent_coef")
    policy_aliases: ClassVar[dict[str, type[BasePolicy]]] = dict(SAC_ALIASES)
    policy: BilateralSACPolicy
    actor_value = "min"  # of models that were saved before there was a choice
    policy_delay = 1  # likewise
    _CRITIC_LOSS = 0.5

    def __init__(
        self,
        policy: str | type[BilateralSACPolicy],
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
        actor_value: ActorValue = "min",
        normalize_streams: bool = False,
        policy_delay: int = 1,
        learning_rate: float | Schedule = 3e-4,
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
        ent_coef: str | float = "auto",
        target_update_interval: int = 1,
        target_entropy: str | float = "auto",
        use_sde: bool = False,
        sde_sample_freq: int = -1,
        use_sde_at_warmup: bool = False,
        stats_window_size: int = 100,
        tensorboard_log: str | None = None,
        policy_kwargs: dict[str, Any] | None = None,
        verbose: int = 0,
        seed: int | None = None,
        device: torch.device | str = "auto",
        _init_setup_model: bool = True,
    ) -> None:
        if target_entropy != "auto" and not str(ent_coef).startswith("auto"):
            raise ValueError(f"target_entropy has no effect on a temperature that is given, ent_coef={ent_coef}.")
        self.policy_delay = policy_delay
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
            ent_coef=ent_coef,
            target_update_interval=target_update_interval,
            target_entropy=target_entropy,
            use_sde=use_sde,
            sde_sample_freq=sde_sample_freq,
            use_sde_at_warmup=use_sde_at_warmup,
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
        initial_ent_coef = arguments.pop("initial_ent_coef")
        if arguments["ent_coef"] is None:
            arguments["ent_coef"] = f"auto_{initial_ent_coef}"
        if arguments["target_entropy"] is None or "auto" not in str(arguments["ent_coef"]):
            arguments["target_entropy"] = "auto"
        return arguments

    def parameter_groups(self) -> dict[str, list[nn.Parameter]]:
        """Return every trained parameter by owner; the log of the temperature is shared."""
        groups = super().parameter_groups()
        if self.log_ent_coef is not None:
            groups["shared"].append(self.log_ent_coef)  # type: ignore[arg-type] # SB3 holds it as a plain tensor
        return groups

    def _optimizers(self) -> list[torch.optim.Optimizer]:
        return [*super()._optimizers(), *self._temperature_optimizers()]

    def _temperature_optimizers(self) -> list[torch.optim.Optimizer]:
        """Return the temperature's optimizer, in a list that is empty if the temperature is given."""
        return [] if self.ent_coef_optimizer is None else [self.ent_coef_optimizer]

    def _update(self, batch: StreamSamples, log: Log) -> None:
        actor = self.policy.actor
        is_due = self._n_updates % self.policy_delay == 0
        if is_due:
            actions, log_prob = actor.action_log_prob(batch.observations)  # (b, n_actions), (b,)
        ent_coef = self._temperature()
        with torch.no_grad():
            # V_s(o') = min over the stream's target critics of Q'_s(o', a') - α log π(a'), a' a fresh sample.
            next_actions, next_log_prob = actor.action_log_prob(batch.next_observations)
            next_values = self._next_values(batch, next_actions)
            next_values -= ent_coef * next_log_prob[:, None]  # (b, n_streams)
        self._update_critics(batch, next_values, log)
        if is_due:
            # Loss of stream s: mean(α log π(a) - Q_s(o, a)), through the sampled action. Both streams have the whole
            # entropy term: a hemisphere follows one stream, and what is shared half of each.
            losses = self._actor_losses(batch, actions, log, (ent_coef * log_prob).mean())  # (n_streams,)
            log["train/ent_coef"].append(ent_coef.squeeze())
            log["train/entropy"].append(-log_prob.detach().mean())
            log["train/std"].append(actor.log_std.detach().exp().mean())
            losses = losses + self._temperature_loss(log_prob.detach())
            self._update_network(losses, self._temperature_optimizers())
        if self._n_updates % self.target_update_interval == 0:
            self._follow(self.critic, self.critic_target)
            polyak_update(self.batch_norm_stats, self.batch_norm_stats_target, 1.0)

    def _temperature(self) -> Tensor:
        """Return the temperature α, (1,) or (), without gradient."""
        return self.ent_coef_tensor if self.log_ent_coef is None else self.log_ent_coef.detach().exp()

    def _temperature_loss(self, log_prob: Tensor) -> Tensor:
        """Return -log α · mean(log π(a) + target entropy), (), the same for every stream; zero for a given α.

        It raises α while the policy's entropy, -mean log π(a), is below the target.
        """
        if self.log_ent_coef is None:
            return log_prob.new_zeros(())
        assert isinstance(self.target_entropy, float)
        return -(self.log_ent_coef * (log_prob + self.target_entropy)).mean()
