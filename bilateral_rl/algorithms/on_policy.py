"""What hemispheric PPO and A2C have in common: rollouts with streams, advantages by stream, one routed step."""

from __future__ import annotations

import math
from collections import defaultdict
from typing import ClassVar

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

from bilateral_rl.algorithms.hemispheric import Hemispheric
from bilateral_rl.algorithms.routing import clip_group_gradients
from bilateral_rl.algorithms.stream_rollout import StreamBatch, StreamRollout
from bilateral_rl.policies import POLICY_ALIASES, BilateralActorCriticPolicy
from bilateral_rl.vocabulary import stream_mix, stream_names

Log = defaultdict[str, list[Tensor]]


class HemisphericOnPolicy(Hemispheric, OnPolicyAlgorithm):
    """Collects rollouts with a reward, a value and an advantage for each stream; subclasses train on them.

    Attributes:
        rollout: the last one.
    """

    POLICY_CLASS = BilateralActorCriticPolicy
    policy_aliases: ClassVar[dict[str, type[BasePolicy]]] = dict(POLICY_ALIASES)
    policy: BilateralActorCriticPolicy
    rollout: StreamRollout
    normalize_advantage: bool

    def _setup_model(self) -> None:
        # SB3's own buffer is not used: keep it at one step.
        n_steps, self.n_steps = self.n_steps, 1
        super()._setup_model()
        self.n_steps = n_steps
        n_streams = len(stream_mix(self.loss))
        self.rollout = StreamRollout(n_steps, self.n_envs, self.observation_space, self.action_space, n_streams)

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), "rollout"]

    # --- collecting -------------------------------------------------------------------------------------------------

    def collect_rollouts(
        self, env: VecEnv, callback: BaseCallback, rollout_buffer: RolloutBuffer, n_rollout_steps: int
    ) -> bool:
        """Fill :attr:`rollout` with ``n_rollout_steps`` of every environment; False if the callback stopped it."""
        self.policy.set_training_mode(False)
        callback.on_rollout_start()
        rollout = self.rollout
        cut_short: list[tuple[int, NDArray[np.intp], NDArray[np.float32]]] = []
        new_obs = self._last_obs
        assert isinstance(new_obs, np.ndarray)  # neither image nor dictionary spaces reach this policy
        for step in range(n_rollout_steps):
            rollout.observations[step] = new_obs.reshape(env.num_envs, -1)
            actions = self._act(step)
            step_obs, rewards, dones, infos = env.step(actions)
            assert isinstance(step_obs, np.ndarray)
            new_obs = step_obs
            self.num_timesteps += env.num_envs
            callback.update_locals(locals())
            if not callback.on_step():
                return False
            rollout.rewards[step] = self._stream_rewards(env, infos)
            rollout.dones[step] = dones
            if dones.any():
                self._update_info_buffer(infos, dones)
                truncated = np.array([i for i in np.flatnonzero(dones) if infos[i].get("TimeLimit.truncated")], int)
                if len(truncated):
                    last = np.stack([infos[i]["terminal_observation"] for i in truncated])
                    cut_short.append((step, truncated, last.reshape(len(truncated), -1)))
            self._last_obs = new_obs
            self._last_episode_starts = dones
        self._evaluate_rollout(new_obs.reshape(env.num_envs, -1), cut_short)
        callback.update_locals(locals())
        callback.on_rollout_end()
        return True

    @torch.no_grad()
    def _act(self, step: int) -> NDArray[np.float32]:
        """Sample actions for ``rollout.observations[step]``, store what training needs, give the environment's."""
        observations = torch.from_numpy(self.rollout.observations[step]).to(self.device)
        mean = self.policy.action_mean(observations)
        latent = torch.addcmul(mean, torch.randn_like(mean), self.policy.log_std.exp())
        self.rollout.latent_actions[step] = latent.cpu().numpy()
        self.rollout.log_prob[step] = gaussian_log_prob(latent, mean, self.policy.log_std).cpu().numpy()
        actions = torch.tanh(latent).cpu().numpy().reshape(-1, *self.policy.action_space.shape)  # type: ignore[misc]
        return self.policy.unscale_action(actions)

    @torch.no_grad()
    def _evaluate_rollout(
        self, last_obs: NDArray[np.float32], cut_short: list[tuple[int, NDArray[np.intp], NDArray[np.float32]]]
    ) -> None:
        """Values of everything seen, in one batch each; time limits bootstrap; then advantages and returns."""
        rollout = self.rollout
        observations = rollout.observations.reshape(-1, rollout.observations.shape[2])
        rollout.values = self._values(observations).reshape(rollout.rewards.shape)
        if cut_short:
            values = self._values(np.concatenate([last for _, _, last in cut_short]))
            bounds = np.cumsum([len(envs) for _, envs, _ in cut_short])[:-1]
            for (step, envs, _), value in zip(cut_short, np.split(values, bounds), strict=True):
                rollout.rewards[step, envs] += self.gamma * value
        rollout.finish(self._values(last_obs), self.gamma, self.gae_lambda)

    def _values(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        values = self.policy.predict_stream_values(torch.from_numpy(observations).to(self.device))
        return values.cpu().numpy()  # type: ignore[no-any-return]

    # --- training ---------------------------------------------------------------------------------------------------

    def _log_prob(self, batch: StreamBatch) -> Tensor:
        """(b,): log density of the batch's actions before their squashing, under the present policy."""
        return gaussian_log_prob(batch.latent_actions, self.policy.action_mean(batch.observations), self.policy.log_std)

    def _advantages(self, batch: StreamBatch) -> Tensor:
        """(b, n_streams): each stream's by itself normalized, if wanted."""
        advantages = batch.advantages
        if self.normalize_advantage and len(advantages) > 1:
            advantages = (advantages - advantages.mean(dim=0)) / (advantages.std(dim=0) + 1e-8)
        return advantages

    def _stream_losses(self, policy_loss: Tensor, value_loss: Tensor, log: Log) -> list[Tensor]:
        """Each stream's whole loss from its parts (n_streams,)."""
        log["policy_loss"].append(policy_loss.detach())
        log["value_loss"].append(value_loss.detach())
        loss = policy_loss + self.vf_coef * value_loss
        ent_coef = self._present_ent_coef()
        if ent_coef:
            loss = loss - ent_coef * gaussian_entropy(self.policy.log_std)
        return list(loss.unbind())

    def _step(self, losses: list[Tensor], log: Log) -> None:
        """One update from the streams' losses."""
        self._route(losses, self._groups)
        norms = clip_group_gradients(self._groups, self.max_grad_norm)
        self.policy.optimizer.step()
        for name, (before, after) in norms.items():
            log[f"gradient_norm/{name}"].append(before)
            log[f"gradient_norm_clipped/{name}"].append(after)

    def _present_ent_coef(self) -> float:
        return FloatSchedule(self.ent_coef)(self._current_progress_remaining)

    # --- logs -------------------------------------------------------------------------------------------------------

    def dump_logs(self, iteration: int = 0) -> None:
        """SB3's log, and the mean return of each stream over the last trials."""
        self._log_stream_returns()
        super().dump_logs(iteration)

    def _record(self, log: Log) -> None:
        """Averages of the update, the streams of a quantity under one heading."""
        record = self.logger.record
        for stream, name in enumerate(stream_names(self.loss)):
            values, returns = self.rollout.values[..., stream].ravel(), self.rollout.returns[..., stream].ravel()
            record(f"explained_variance/{name}", float(explained_variance(values, returns)))
            record(f"value/{name}", float(values.mean()))
        self._log_averages(log)
        record("train/std", self.policy.log_std.exp().mean().item())
        record("train/entropy", gaussian_entropy(self.policy.log_std).item())
        record("train/ent_coef", self._present_ent_coef())


def gaussian_entropy(log_std: Tensor) -> Tensor:
    """Entropy of independent Gaussians (nats)."""
    return (log_std + 0.5 * math.log(2 * math.pi * math.e)).sum()


def gaussian_log_prob(x: Tensor, mean: Tensor, log_std: Tensor) -> Tensor:
    """(n,) log density of ``x`` (n, d) under independent Gaussians."""
    constant = 0.5 * math.log(2 * math.pi) * x.shape[1]
    return -0.5 * (((x - mean) * (-log_std).exp()) ** 2).sum(dim=1) - log_std.sum() - constant
