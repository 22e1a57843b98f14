"""The base class of hemispheric PPO and A2C: rollouts with streams, advantages by stream, one routed step."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.utils import FloatSchedule, explained_variance
from stable_baselines3.common.vec_env import VecEnv
from torch import Tensor

from bilateral_rl.algorithms.arguments import ON_POLICY
from bilateral_rl.algorithms.finite import check_observations
from bilateral_rl.algorithms.hemispheric import Hemispheric
from bilateral_rl.algorithms.outer_rewards import RewardPairs, gives_pairs, outermost_pairs, own_pairs
from bilateral_rl.algorithms.routing import clip_group_gradients
from bilateral_rl.algorithms.schedules import linear_schedule
from bilateral_rl.algorithms.side_logs import Log
from bilateral_rl.algorithms.stream_rollout import StreamBatch, StreamRolloutBuffer
from bilateral_rl.algorithms.stream_scale import penalty_scales
from bilateral_rl.policies import POLICY_ALIASES, BilateralActorCriticPolicy
from bilateral_rl.vocabulary import stream_names


class _CutShort(NamedTuple):
    """The ``m`` episodes that a time limit ended at one step."""

    step: int
    envs: list[int]
    """The environments of the episodes."""
    last_obs: NDArray[np.float32]
    """(m, *observation shape): the last observation of each episode."""
    last_traces: NDArray[np.float32]
    """(m, n): traces of the actions before it."""


class HemisphericOnPolicy(Hemispheric, OnPolicyAlgorithm):
    """Collects rollouts with a reward, a value and an advantage for each stream; subclasses train on them."""

    POLICY_CLASS = BilateralActorCriticPolicy
    CHECKS = ON_POLICY
    policy_aliases: ClassVar[dict[str, type[BasePolicy]]] = dict(POLICY_ALIASES)
    policy: BilateralActorCriticPolicy
    rollout_buffer: StreamRolloutBuffer
    normalize_advantage: bool

    @classmethod
    def constructor_arguments(
        cls, hyperparameters: Mapping[str, Any], timesteps: int, n_envs: int, n_actions: int
    ) -> dict[str, Any]:
        arguments = super().constructor_arguments(hyperparameters, timesteps, n_envs, n_actions)
        arguments["ent_coef"] = linear_schedule(arguments["ent_coef"], arguments.pop("final_ent_coef"))
        return arguments

    def _setup_model(self) -> None:
        # Models saved by version 0.1.0 name SB3's buffer, which they did not use.
        if self.rollout_buffer_class not in (None, RolloutBuffer, StreamRolloutBuffer):
            raise ValueError(f"{type(self).__name__} needs its own rollout buffer: leave rollout_buffer_class out.")
        self.rollout_buffer_class = StreamRolloutBuffer
        self.rollout_buffer_kwargs = self._buffer_arguments(self.rollout_buffer_kwargs)
        super()._setup_model()
        if self.policy.motor_network.noise.std:
            self.rollout_buffer.keep_noise(self.policy.motor_network.hidden_shape)

    def _optimizers_of_policy(self) -> list[torch.optim.Optimizer]:
        return [self.policy.optimizer]

    # --- collecting -------------------------------------------------------------------------------------------------

    def collect_rollouts(
        self, env: VecEnv, callback: BaseCallback, rollout_buffer: RolloutBuffer, n_rollout_steps: int
    ) -> bool:
        """Fill ``rollout_buffer`` with ``n_rollout_steps`` of every environment; False if the callback stopped it."""
        if not isinstance(rollout_buffer, StreamRolloutBuffer) or rollout_buffer.buffer_size != n_rollout_steps:
            raise ValueError(
                f"{type(self).__name__} collects n_steps={n_rollout_steps} steps into a buffer of its own for as many: "
                "give n_steps to the constructor or to load(), and leave rollout_buffer as it is."
            )
        rollout_buffer.gamma, rollout_buffer.gae_lambda = self.gamma, self.gae_lambda  # which may have been set since
        self.policy.set_training_mode(False)
        rollout_buffer.reset()
        callback.on_rollout_start()
        cut_short: list[_CutShort] = []
        # Where the environment itself gives the pairs, they are compared with its rewards once a rollout.
        is_direct, outer = gives_pairs(env), np.empty((n_rollout_steps, env.num_envs), dtype=np.float32)
        pairs = np.empty((*outer.shape, 2), dtype=np.float32)
        new_obs = self._last_obs
        assert isinstance(new_obs, np.ndarray)  # neither image nor dictionary spaces reach this policy
        for step in range(n_rollout_steps):
            # Acting on the stored row, whose place in memory is the same in every process, keeps rounding the same:
            # matrix products may round by alignment. Nor can an environment change it afterwards.
            assert self._last_traces is not None
            noise = self.policy.motor_network.noise.draw(env.num_envs)
            obs = rollout_buffer.begin_step(new_obs, self._last_traces, noise)
            latent_actions, log_probs, squashed = self._act(obs, noise)
            actions = self.policy.unscale_action(squashed.reshape(-1, *self.policy.action_space.shape))  # type: ignore[misc]
            step_obs, rewards, dones, infos = env.step(actions)
            assert isinstance(step_obs, np.ndarray)
            new_obs = step_obs
            self.num_timesteps += env.num_envs
            callback.update_locals(locals())
            if not callback.on_step():
                return False
            check_observations(new_obs, self.num_timesteps)
            streams = None
            if is_direct:
                pairs[step], outer[step] = own_pairs(env, self.num_timesteps), rewards
            else:
                streams = self._stream_rewards(outermost_pairs(env, infos, rewards, self.num_timesteps), rewards)
            rollout_buffer.add(latent_actions, streams, dones, log_probs)
            traces = self._trace(squashed, dones)
            if dones.any():
                self._update_info_buffer(infos, dones)
                if envs := [i for i in np.flatnonzero(dones).tolist() if infos[i].get("TimeLimit.truncated")]:
                    last_obs = np.stack([infos[i]["terminal_observation"] for i in envs])
                    check_observations(last_obs, self.num_timesteps, envs)
                    cut_short.append(_CutShort(step, envs, last_obs.astype(np.float32, copy=False), traces[envs]))
            self._last_obs = new_obs
            self._last_episode_starts = dones
        if is_direct:
            rollout_buffer.rewards[:] = self._stream_rewards(RewardPairs(pairs), outer)
        self._evaluate_rollout(rollout_buffer, new_obs.astype(np.float32, copy=False), cut_short)
        callback.update_locals(locals())
        callback.on_rollout_end()
        return True

    @torch.no_grad()
    def _act(
        self, obs: NDArray[np.float32], noise: Tensor | None
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """Sample actions.

        Args:
            obs: (n_envs, *observation shape).
            noise: (n_envs, layers · sides, width), of the network's hidden units; None if they have none.

        Returns:
            the actions before their squashing (n_envs, n_actions), the log of their density (n_envs,), and the actions
            in [-1, 1] (n_envs, n_actions).
        """
        noise = None if noise is None else noise.to(self.device)
        mean, log_std = self.policy.action_mean(torch.from_numpy(obs).to(self.device), noise), self.policy.log_std
        latent = torch.addcmul(mean, torch.randn_like(mean), log_std.exp())
        log_probs = gaussian_log_prob(latent, mean, log_std)
        latent_actions = latent.cpu().numpy()
        self._check_actions(latent_actions)
        return latent_actions, log_probs.cpu().numpy(), torch.tanh(latent).cpu().numpy()

    @torch.no_grad()
    def _evaluate_rollout(
        self, rollout_buffer: StreamRolloutBuffer, last_obs: NDArray[np.float32], cut_short: list[_CutShort]
    ) -> None:
        """Value every observation of the rollout in one batch; then compute its advantages and returns."""
        arrays = rollout_buffer.observations, rollout_buffer.traces
        observations, traces = (array.reshape(math.prod(array.shape[:2]), *array.shape[2:]) for array in arrays)
        values = self._values(observations, traces).reshape(rollout_buffer.rewards.shape)
        if cut_short:
            # γ V(last observation) stands for the rewards that the time limit cut off.
            ends_obs, ends_traces = zip(*((ends.last_obs, ends.last_traces) for ends in cut_short), strict=True)
            cut_off = self._values(np.concatenate(ends_obs), np.concatenate(ends_traces))
            bounds = np.cumsum([len(ends.envs) for ends in cut_short])[:-1]
            for ends, value in zip(cut_short, np.split(cut_off, bounds), strict=True):
                rollout_buffer.rewards[ends.step, ends.envs] += self.gamma * value
        assert self._last_traces is not None
        rollout_buffer.compute_returns_and_advantage(values, self._values(last_obs, self._last_traces))

    def _values(self, observations: NDArray[np.float32], traces: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the values of the streams (n, n_streams) of observations (n, …) with their traces (n, n_traces)."""
        tensors = (torch.from_numpy(array).to(self.device) for array in (observations, traces))
        return self.policy.predict_stream_values(*tensors).cpu().numpy()  # type: ignore[no-any-return]

    # --- training ---------------------------------------------------------------------------------------------------

    def _log_prob(self, batch: StreamBatch) -> Tensor:
        """Return the log density (b,) of the batch's actions before their squashing, under the present policy.

        It is that given the noise with which they were taken, as if that had been observed: the noise is the same for
        the policy before and after an update, so that their ratio is of what was learned alone.
        """
        noise = batch.hidden_noise if self.policy.motor_network.noise.std else None
        mean = self.policy.action_mean(batch.observations, noise)
        return gaussian_log_prob(batch.latent_actions, mean, self.policy.log_std)

    def _advantages(self, batch: StreamBatch) -> tuple[Tensor, list[float]]:
        """Return the advantages (b, n_streams), and by how much each stream's rewards are scaled in them.

        If advantages are to be normalized, each stream's are by themselves.
        """
        advantages = batch.advantages
        if not self.normalize_advantage or len(advantages) < 2:
            return advantages, [self.reward_scale] * advantages.shape[1]
        std = advantages.std(dim=0) + 1e-8
        return (advantages - advantages.mean(dim=0)) / std, penalty_scales(self.reward_scale / std)

    def _stream_losses(self, policy_loss: Tensor, value_loss: Tensor, log: Log) -> list[Tensor]:
        """Add up each stream's loss from its parts (n_streams,).

        Every stream's loss has the whole entropy bonus: it moves nothing but the standard deviation, which is shared
        and so gets half of each stream's gradient.
        """
        log["policy_loss"].append(policy_loss.detach())
        log["value_loss"].append(value_loss.detach())
        loss = policy_loss + self.vf_coef * value_loss
        ent_coef = self._present_ent_coef()
        if ent_coef:
            loss = loss - ent_coef * gaussian_entropy(self.policy.log_std)
        return list(loss.unbind())

    def _step(self, losses: list[Tensor], scales: Sequence[float], log: Log) -> None:
        """Update every parameter once from the streams' losses, which scale the rewards by ``scales``."""
        self._route(losses, self._groups, scales)
        norms = clip_group_gradients(self._groups, self.max_grad_norm)
        self.policy.optimizer.step()
        for name, (before, after) in norms.items():
            log[f"gradient_norm/{name}"].append(before)
            log[f"gradient_norm_clipped/{name}"].append(after)

    def _present_ent_coef(self) -> float:
        """Return the weight of the entropy bonus at the present progress."""
        return FloatSchedule(self.ent_coef)(self._current_progress_remaining)

    # --- logs -------------------------------------------------------------------------------------------------------

    def dump_logs(self, iteration: int = 0) -> None:
        """Write SB3's log, and the mean return of each side over the last trials."""
        self._log_stream_returns()
        super().dump_logs(iteration)

    def _record(self, log: Log) -> None:
        """Log averages of the updates, the streams of a quantity under one heading."""
        record = self.logger.record
        buffer = self.rollout_buffer
        for stream, name in enumerate(stream_names(self.loss)):
            values, returns = buffer.values[..., stream].ravel(), buffer.returns[..., stream].ravel()
            record(f"explained_variance/{name}", float(explained_variance(values, returns)))
            record(f"value/{name}", float(values.mean()))
        self._log_averages(log)
        record("train/std", self.policy.log_std.exp().mean().item())
        record("train/entropy", gaussian_entropy(self.policy.log_std).item())
        record("train/ent_coef", self._present_ent_coef())


def gaussian_entropy(log_std: Tensor) -> Tensor:
    """Return the entropy (nats) of independent Gaussians, Σ (log σ + ½ log 2πe)."""
    return (log_std + 0.5 * math.log(2 * math.pi * math.e)).sum()


def gaussian_log_prob(x: Tensor, mean: Tensor, log_std: Tensor) -> Tensor:
    """Return the log density (n,) of ``x`` (n, d) under independent Gaussians, Σ -½ ((x-μ)/σ)² - log σ - ½ log 2π."""
    constant = 0.5 * math.log(2 * math.pi) * x.shape[1]
    return -0.5 * (((x - mean) * (-log_std).exp()) ** 2).sum(dim=1) - log_std.sum() - constant
