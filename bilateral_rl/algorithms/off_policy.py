"""The base class of hemispheric SAC and TD3: stream rewards in the replay buffer, a routed actor, stream critics."""

from __future__ import annotations

from abc import abstractmethod
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from numpy.typing import NDArray
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.policies import ContinuousCritic
from stable_baselines3.common.type_aliases import GymEnv, ReplayBufferSamples
from torch import Tensor, nn

from bilateral_rl.algorithms.hemispheric import Hemispheric, Log
from bilateral_rl.algorithms.stream_replay import StreamReplayBuffer
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.policies.off_policy import BilateralOffPolicyPolicy
from bilateral_rl.vocabulary import stream_mix


class HemisphericOffPolicy(Hemispheric, OffPolicyAlgorithm):
    """Stores a reward for each stream, trains critics for each, and routes their gradients to the network.

    Raises:
        ValueError: ``replay_buffer_class`` or ``n_steps``, besides what every hemispheric algorithm raises.
    """

    policy: BilateralOffPolicyPolicy
    critic: ContinuousCritic
    critic_target: ContinuousCritic

    _CRITIC_LOSS = 1.0
    """Factor on the mean squared error of each critic, as in the SB3 parent."""

    def __init__(
        self, policy: str | type[MotorPolicy], env: GymEnv | str | None, *, critic_warm_up: int, **arguments: Any
    ) -> None:
        self.critic_warm_up = critic_warm_up
        super().__init__(policy, env, **arguments)

    @classmethod
    def constructor_arguments(cls, hyperparameters: Mapping[str, Any], n_envs: int, n_actions: int) -> dict[str, Any]:
        arguments = super().constructor_arguments(hyperparameters, n_envs, n_actions)
        del arguments["n_critics"]  # an argument of the policy
        return arguments

    def _setup_model(self) -> None:
        if self.replay_buffer_class not in (None, StreamReplayBuffer):
            raise ValueError(f"{type(self).__name__} needs its own replay buffer: leave replay_buffer_class out.")
        if self.n_steps != 1:
            raise ValueError(f"{type(self).__name__} has no returns of several steps: leave n_steps out.")
        self.replay_buffer_class = StreamReplayBuffer
        self.replay_buffer_kwargs = self.replay_buffer_kwargs | {"n_streams": len(stream_mix(self.loss))}
        super()._setup_model()
        self._actor_groups = {name: group for name, group in self._groups.items() if not name.startswith("critic_")}

    def _store_transition(
        self,
        replay_buffer: ReplayBuffer,
        buffer_action: NDArray[Any],
        new_obs: NDArray[Any] | dict[str, NDArray[Any]],
        reward: NDArray[Any],
        dones: NDArray[Any],
        infos: list[dict[str, Any]],
    ) -> None:
        assert isinstance(replay_buffer, StreamReplayBuffer)
        assert self.env is not None
        replay_buffer.next_rewards = self._stream_rewards(self.env, infos)
        super()._store_transition(replay_buffer, buffer_action, new_obs, reward, dones, infos)

    # --- training ---------------------------------------------------------------------------------------------------

    def train(self, gradient_steps: int, batch_size: int = 256) -> None:
        """Sample the replay buffer and update, ``gradient_steps`` times."""
        self.policy.set_training_mode(True)
        self._update_learning_rate(self._optimizers())
        assert self.replay_buffer is not None
        log: Log = defaultdict(list)
        for _ in range(gradient_steps):
            self._n_updates += 1
            self._update(self.replay_buffer.sample(batch_size, env=self._vec_normalize_env), log)
        self._log_averages(log)

    @abstractmethod
    def _update(self, batch: ReplayBufferSamples, log: Log) -> None:
        """Update critics, network and targets once."""

    def _optimizers(self) -> list[torch.optim.Optimizer]:
        """Return all optimizers, which have one learning rate."""
        return [self.policy.actor.optimizer, self.critic.optimizer]

    def _values(self, critic: ContinuousCritic, observations: Tensor, actions: Tensor) -> Tensor:
        """Return the value that every critic of every stream gives to ``actions`` (b, n_actions).

        Returns:
            (b, n_streams, n_critics).
        """
        values = torch.cat(critic(observations, actions), dim=1)  # (b, n_streams · n_critics), stream by stream
        return values.reshape(len(values), self.policy.n_streams, -1)

    def _update_critics(self, batch: ReplayBufferSamples, next_values: Tensor, log: Log) -> None:
        """Move every critic one step towards its stream's reward and discounted ``next_values`` (b, n_streams)."""
        # Target of stream s: y_s = r_s + γ (1 - done) V_s(o'); all of its critics share it.
        target = batch.rewards + (1 - batch.dones) * self.gamma * next_values  # (b, n_streams)
        values = self._values(self.critic, batch.observations, batch.actions)  # (b, n_streams, n_critics)
        loss = self._CRITIC_LOSS * (values - target[..., None]).square().mean(dim=0).sum(dim=1)  # (n_streams,)
        self.critic.optimizer.zero_grad()
        # Streams share no critic, so that one backward pass of the sum routes each loss to its own critics. A features
        # extractor before them all is shared: it gets half of each stream's gradient.
        loss.sum().backward()
        for parameter in self.critic.features_extractor.parameters():
            if parameter.grad is not None:
                parameter.grad /= self.policy.n_streams
        self.critic.optimizer.step()
        log["critic_loss"].append(loss.detach())
        log["value"].append(values.detach().mean(dim=(0, 2)))

    def _update_network(self, losses: Tensor, others: Sequence[torch.optim.Optimizer] = ()) -> None:
        """Move the network, and what ``others`` optimize, one step along the losses' (n_streams,) routed gradients."""
        if self._n_updates <= self.critic_warm_up:
            return
        self._route(list(losses.unbind()), self._actor_groups, [self.reward_scale] * len(losses))
        for optimizer in (self.policy.actor.optimizer, *others):
            optimizer.step()

    def _follow(self, network: nn.Module, target: nn.Module) -> None:
        """Move a target network a little towards its network."""
        with torch.no_grad():
            torch._foreach_lerp_(list(target.parameters()), list(network.parameters()), self.tau)

    # --- logs -------------------------------------------------------------------------------------------------------

    def dump_logs(self) -> None:
        """Write SB3's log, and the mean return of each side over the last trials."""
        self._log_stream_returns()
        super().dump_logs()

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), "_actor_groups"]
