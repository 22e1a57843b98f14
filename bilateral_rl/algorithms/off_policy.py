"""The base class of hemispheric SAC and TD3: stream rewards in the replay buffer, a routed actor, stream critics."""

from __future__ import annotations

import contextlib
import io
import math
import pathlib
import warnings
from abc import abstractmethod
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, Self, get_args

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.noise import ActionNoise
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.policies import ContinuousCritic
from stable_baselines3.common.save_util import load_from_zip_file
from stable_baselines3.common.type_aliases import GymEnv, MaybeCallback, TensorDict
from torch import Tensor, nn

from bilateral_rl.algorithms.arguments import OFF_POLICY
from bilateral_rl.algorithms.finite import check_observations
from bilateral_rl.algorithms.hemispheric import Hemispheric
from bilateral_rl.algorithms.outer_rewards import RewardPairs, outermost_pairs
from bilateral_rl.algorithms.side_logs import Log
from bilateral_rl.algorithms.stream_replay import StreamReplayBuffer, StreamSamples, check_fits
from bilateral_rl.algorithms.stream_scale import StreamScale, penalty_scales
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.policies.off_policy import BilateralOffPolicyPolicy

ActorValue = Literal["min", "mean", "first"]
"""Which value of a stream's critics the network follows: the smallest, their mean, or the first one's."""

_MEASURED = 100_000
"""Most steps that inputs of the critics are standardized by."""


class HemisphericOffPolicy(Hemispheric, OffPolicyAlgorithm):
    """Stores a reward for each stream, trains critics for each, and routes their gradients to the network.

    Raises:
        ValueError: ``replay_buffer_class``, ``n_steps`` or an unknown ``actor_value``, besides what every hemispheric
            algorithm raises.
    """

    CHECKS = OFF_POLICY
    FIXED = (*Hemispheric.FIXED, "standardize_inputs", "buffer_size", "optimize_memory_usage")
    policy: BilateralOffPolicyPolicy
    critic: ContinuousCritic
    critic_target: ContinuousCritic
    actor_value: ActorValue
    # Of models that were saved before there were these:
    standardize_inputs = False
    normalize_streams = False

    _CRITIC_LOSS = 1.0
    """Factor on the mean squared error of each critic, as in the SB3 parent."""

    def __init__(
        self,
        policy: str | type[MotorPolicy],
        env: GymEnv | str | None,
        *,
        critic_warm_up: int,
        standardize_inputs: bool,
        actor_value: ActorValue,
        normalize_streams: bool,
        policy_kwargs: dict[str, Any] | None,
        **arguments: Any,
    ) -> None:
        self.critic_warm_up = critic_warm_up
        self.standardize_inputs = standardize_inputs
        self.actor_value = actor_value
        self.normalize_streams = normalize_streams
        policy_kwargs = {"standardize_inputs": standardize_inputs} | (policy_kwargs or {})
        super().__init__(policy, env, policy_kwargs=policy_kwargs, **arguments)

    @classmethod
    def constructor_arguments(
        cls, hyperparameters: Mapping[str, Any], timesteps: int, n_envs: int, n_actions: int
    ) -> dict[str, Any]:
        arguments = super().constructor_arguments(hyperparameters, timesteps, n_envs, n_actions)
        del arguments["n_critics"]  # an argument of the policy
        if arguments["buffer_size"] is None:
            arguments["buffer_size"] = _steps_of_training(timesteps, n_envs, arguments["train_freq"])
        return arguments

    def _setup_model(self) -> None:
        if self.replay_buffer_class not in (None, StreamReplayBuffer):
            raise ValueError(f"{type(self).__name__} needs its own replay buffer: leave replay_buffer_class out.")
        self.replay_buffer_class = StreamReplayBuffer
        self.replay_buffer_kwargs = self._buffer_arguments(self.replay_buffer_kwargs)
        super()._setup_model()
        if self.policy.standardize_inputs != self.standardize_inputs:
            raise ValueError(
                f"standardize_inputs is {self.standardize_inputs}, but the policy's {self.policy.standardize_inputs}: "
                "a saved model keeps it, and policy_kwargs leave it out."
            )
        self.stream_scale = StreamScale(self.policy.n_streams).to(self.device)
        self._actor_groups = {name: group for name, group in self._groups.items() if not name.startswith("critic_")}

    def _check_attributes(self) -> None:
        super()._check_attributes()
        self._convert_train_freq()
        if self.n_steps != 1:
            raise ValueError(f"{type(self).__name__} has no returns of several steps: leave n_steps out.")
        if self.actor_value not in get_args(ActorValue):
            choices = ", ".join(get_args(ActorValue))
            raise ValueError(f"actor_value must be one of {choices}, not {self.actor_value!r}.")

    def set_parameters(
        self, load_path_or_dict: str | TensorDict, exact_match: bool = True, device: torch.device | str = "auto"
    ) -> None:
        """Load parameters as SB3 does.

        Raises:
            ValueError: parameters of a model of other parts.
        """
        if isinstance(load_path_or_dict, dict):
            parameters = load_path_or_dict
        else:
            _, parameters, _ = load_from_zip_file(load_path_or_dict, device=device, load_data=False)
        if exact_match and (differing := set(parameters) ^ set(self._get_torch_save_params()[0])):
            raise ValueError(
                f"only one of this model and the saved one has {', '.join(sorted(differing))}: a saved model keeps "
                "normalize_streams, and whether its temperature is learned."
            )
        super().set_parameters(parameters, exact_match, device)

    def load_replay_buffer(self, path: str | pathlib.Path | io.BufferedIOBase, truncate_last_traj: bool = True) -> None:
        """Load a replay buffer as SB3 does, which executes code that the file holds; its rewards get this scale.

        Raises:
            ValueError: a file that holds no such buffer, or one that this model could not go on with; the present one
                stays.
        """
        present = self.replay_buffer
        shape = (max(self.buffer_size // self.n_envs, 1), self.n_envs, self.policy.n_streams)
        try:
            super().load_replay_buffer(path, truncate_last_traj)
            check_fits(self.replay_buffer, (self.observation_space, self.action_space), shape, self.action_traces)
        except (ValueError, OSError):
            self.replay_buffer = present
            raise
        except Exception as error:  # pickles raise anything
            self.replay_buffer = present
            raise ValueError(f"{path} holds no replay buffer: {error!r}.") from error
        self._scale_replay_buffer()

    def _scale_replay_buffer(self) -> None:
        assert isinstance(self.replay_buffer, StreamReplayBuffer)
        self.replay_buffer.scale_to(self.reward_scale)

    def _setup_learn(
        self,
        total_timesteps: int,
        callback: MaybeCallback = None,
        reset_num_timesteps: bool = True,
        tb_log_name: str = "run",
        progress_bar: bool = False,
    ) -> tuple[int, BaseCallback]:
        begins = reset_num_timesteps or self._last_obs is None
        prepared = super()._setup_learn(total_timesteps, callback, reset_num_timesteps, tb_log_name, progress_bar)
        if begins and (normalizer := self._vec_normalize_env) is not None:
            stored = normalizer.normalize_obs(normalizer.get_original_obs())
            if not np.array_equal(stored, self._last_obs):  # type: ignore[arg-type] # neither is a dictionary
                raise ValueError(
                    "a wrapper around VecNormalize changes observations, which a replay buffer keeps as they were "
                    "before: put VecNormalize around that wrapper."
                )
        self._scale_replay_buffer()  # which may have another scale since the last time
        return prepared

    def learn(self, *args: Any, **kwargs: Any) -> Self:
        """Learn as SB3 does; warns where the critics' warm-up has outlasted every update, and the network has none."""
        before = self._n_updates
        super().learn(*args, **kwargs)
        if before < self._n_updates <= self.critic_warm_up:
            warnings.warn(
                f"only the critics have learned: critic_warm_up is {self.critic_warm_up:,}, of {self._n_updates:,} "
                "updates so far; train for more steps, or give less of it.",
                stacklevel=2,
            )
        return self

    @contextlib.contextmanager
    def _telling_divergence(self) -> Iterator[None]:
        """A context in which torch's refusal of a distribution around what is not finite becomes DivergedError."""
        try:
            yield
        except ValueError as error:
            self._check_policy()
            if "invalid values" in str(error):
                self._check_actions(np.array([np.nan]))
            raise

    def _sample_action(
        self, learning_starts: int, action_noise: ActionNoise | None = None, n_envs: int = 1
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        with self._telling_divergence():
            actions, buffer_actions = super()._sample_action(learning_starts, action_noise, n_envs)
        self._check_actions(buffer_actions)
        return actions, buffer_actions

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
        assert isinstance(new_obs, np.ndarray)
        assert self._last_traces is not None
        check_observations(new_obs, self.num_timesteps)
        if ended := [i for i in np.flatnonzero(dones).tolist() if infos[i].get("terminal_observation") is not None]:
            last = np.stack([infos[i]["terminal_observation"] for i in ended])
            check_observations(last, self.num_timesteps, ended)
        replay_buffer.next_rewards = self._stream_rewards(
            self._pairs(infos, reward), reward, without=self._vec_normalize_env
        )
        replay_buffer.next_traces = self._last_traces
        self._trace(buffer_action, dones)
        super()._store_transition(replay_buffer, buffer_action, new_obs, reward, dones, infos)

    def _pairs(self, infos: list[dict[str, Any]], rewards: NDArray[np.float32]) -> RewardPairs:
        """Return the pairs of rewards of the last step.

        Raises:
            ValueError: none, or some that ``VecNormalize`` does not normalize.
        """
        assert self.env is not None
        given, normalizer = outermost_pairs(self.env, infos, rewards, self.num_timesteps), self._vec_normalize_env
        if normalizer is not None and normalizer.norm_reward and normalizer not in given.normalizers:
            raise ValueError(
                "a wrapper around VecNormalize gives pairs of rewards, which a replay buffer cannot normalize when it "
                "samples them: put VecNormalize around that wrapper."
            )
        return given

    # --- training ---------------------------------------------------------------------------------------------------

    def train(self, gradient_steps: int, batch_size: int = 256) -> None:
        """Sample the replay buffer and update, ``gradient_steps`` times."""
        self.policy.set_training_mode(True)
        self._update_learning_rate(self._optimizers())
        assert isinstance(self.replay_buffer, StreamReplayBuffer)
        if self.standardize_inputs and not self._n_updates:
            self._measure_inputs(self.replay_buffer)
        log: Log = defaultdict(list)
        for _ in range(gradient_steps):
            self._n_updates += 1
            batch = self.replay_buffer.sample(batch_size, env=self._vec_normalize_env)
            with self._telling_divergence():
                self._update(batch._replace(rewards=self._normalized(batch.rewards)), log)
        self._check_policy()
        self._log_averages(log)

    def _normalized(self, rewards: Tensor) -> Tensor:
        """Return rewards (b, n_streams) of the replay buffer, which are scaled, as ``VecNormalize`` now leaves them."""
        env = self._vec_normalize_env
        if env is None or not env.norm_reward:
            return rewards
        bound = abs(self.reward_scale) * env.clip_reward
        return (rewards / float(np.sqrt(env.ret_rms.var + env.epsilon))).clamp(-bound, bound)

    def _measure_inputs(self, replay_buffer: StreamReplayBuffer) -> None:
        """Let critics and targets standardize what they see by the steps that are kept now."""
        steps = replay_buffer.kept(_MEASURED, self._vec_normalize_env)
        self.policy.set_training_mode(False)
        for critics in (self.policy.critic, self.policy.critic_target):
            critics.measure_inputs(steps.observations, steps.traces)
        self.policy.set_training_mode(True)

    @abstractmethod
    def _update(self, batch: StreamSamples, log: Log) -> None:
        """Update critics, network and targets once."""

    def _optimizers(self) -> list[torch.optim.Optimizer]:
        """Return all optimizers, which follow one schedule."""
        return self._optimizers_of_policy()

    def _optimizers_of_policy(self) -> list[torch.optim.Optimizer]:
        return [self.policy.actor.optimizer, self.policy.critic.optimizer]

    def _next_values(self, batch: StreamSamples, next_actions: Tensor) -> Tensor:
        """Return the smallest value (b, n_streams) of ``next_actions`` (b, n_actions) by each stream's targets."""
        policy, obs = self.policy, batch.next_observations
        return policy.stream_values(policy.critic_target, obs, next_actions, batch.next_traces).amin(dim=2)

    def _update_critics(self, batch: StreamSamples, next_values: Tensor, log: Log) -> None:
        """Move every critic one step towards its stream's reward and discounted ``next_values`` (b, n_streams)."""
        # Target of stream s: y_s = r_s + γ (1 - done) V_s(o'); all of its critics share it.
        target = batch.rewards + (1 - batch.dones) * self.gamma * next_values  # (b, n_streams)
        policy = self.policy
        values = policy.stream_values(policy.critic, batch.observations, batch.actions, batch.traces)
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

    def _actor_losses(
        self, batch: StreamSamples, actions: Tensor, log: Log, entropy_loss: Tensor | None = None
    ) -> Tensor:
        """Return each stream's loss of the network, minus the mean value of its actions, (n_streams,).

        Its gradients are right, its number is not; the log has that. With ``normalize_streams``, each stream's loss is
        divided by the running root mean square of ‖∂Q/∂a‖.

        Args:
            batch: a batch of steps.
            actions: (b, n_actions), what the network now does in them.
            log: takes in the losses.
            entropy_loss: (), what is added to the loss of each stream.
        """
        # The critics lead no further than to the action, so that each stream's gradient ∂Q_s/∂a is taken once; the
        # routing then goes through the network alone: ∂Q_s/∂θ = ∂Q_s/∂a · ∂a/∂θ.
        leaf = actions.detach().repeat(self.policy.n_streams, 1, 1).requires_grad_()  # (n_streams, b, n_actions)
        values = self._actor_values(batch, leaf)  # (b, n_streams)
        (gradients,) = torch.autograd.grad(values.sum(), leaf)
        entropy = values.new_zeros(()) if entropy_loss is None else entropy_loss
        log["actor_loss"].append(entropy.detach() - values.detach().mean(dim=0))
        losses = entropy - (gradients * actions).sum(dim=2).mean(dim=1)
        if not self.normalize_streams:
            return losses
        self.stream_scale.update(gradients)
        scale = self.stream_scale.root_mean_square()
        log["action_gradient"].append(scale)
        return losses / scale

    def _actor_values(self, batch: StreamSamples, actions: Tensor) -> Tensor:
        """Return the value that the network follows of each stream's ``actions``, (b, n_streams).

        Args:
            batch: a batch of steps.
            actions: (n_streams, b, n_actions), the same ones in a tensor for each stream.
        """
        n_critics = self.policy.n_critics
        n_first = 1 if self.actor_value == "first" else n_critics
        values = self.policy.critic.values_by_stream(batch.observations, actions, batch.traces, n_critics, n_first)
        return values.amin(dim=2) if self.actor_value == "min" else values.mean(dim=2)

    def _update_network(self, losses: Tensor, others: Sequence[torch.optim.Optimizer] = ()) -> None:
        """Move the network, and what ``others`` optimize, one step along the losses' (n_streams,) routed gradients."""
        if self._n_updates <= self.critic_warm_up:
            return
        # By the policy gradient theorem, the mean over steps of ∂Q/∂a · ∂a/∂θ is the gradient of the mean reward of a
        # step (but for the discount), whose size is the paper's loss's: the penalty is scaled as the rewards are.
        scales = torch.full_like(losses, self.reward_scale)
        if self.normalize_streams:
            scales /= self.stream_scale.root_mean_square()
        self._route(list(losses.unbind()), self._actor_groups, penalty_scales(scales))
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
        return [*super()._excluded_save_params(), "_actor_groups", "stream_scale"]

    def _get_torch_save_params(self) -> tuple[list[str], list[str]]:
        modules, variables = super()._get_torch_save_params()
        return ([*modules, "stream_scale"] if self.normalize_streams else modules), variables


def _steps_of_training(timesteps: int, n_envs: int, train_freq: int) -> int:
    """Return the steps, over all environments, that a buffer holds if it is never full in ``timesteps``."""
    rollouts = math.ceil(timesteps / (n_envs * train_freq))
    # One row more than is filled: a training that is lengthened finds none of its steps overwritten.
    return (rollouts * train_freq + 1) * n_envs
