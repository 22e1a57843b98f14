"""PPO with a reward stream, a critic and an advantage for each hemisphere."""

from __future__ import annotations

import math
from collections import defaultdict
from typing import Any, ClassVar, TypeVar

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.type_aliases import GymEnv, Schedule
from stable_baselines3.common.utils import FloatSchedule, explained_variance
from stable_baselines3.common.vec_env import VecEnv
from torch import Tensor

from bilateral_rl.algorithms.routing import (
    Loss,
    add_weight_penalty,
    assign_routed_gradients,
    clip_group_gradients,
    penalty_weights,
    shares,
    stream_mix,
    stream_names,
)
from bilateral_rl.algorithms.stream_rollout import StreamBatch, StreamRollout
from bilateral_rl.policies import POLICY_ALIASES, BilateralActorCriticPolicy

SelfHemisphericPPO = TypeVar("SelfHemisphericPPO", bound="HemisphericPPO")


class HemisphericPPO(PPO):
    """PPO (Schulman et al. 2017, arXiv 1707.06347) whose reward is a pair, dominant and non-dominant.

    Each stream has its own critic, generalized advantage (normalized by itself) and clipped policy loss. One
    optimizer step applies the routed gradients (``algorithms/routing.py``), clipped per parameter group. With
    ``loss`` other than "specialized" there is one stream, and the arithmetic is stock PPO's.

    The environment gives the pair as ``venv.last_vector_reward`` (n_envs, 2), or as ``info["vector_reward"]`` (2,).

    Args:
        policy: a :class:`BilateralActorCriticPolicy` or its alias.
        env: the environment.
        loss: "specialized", or "combined", "dominant" or "non_dominant" for a single stream.
        weight_penalty: λ of the L2 penalty λ · ½ Σ w² on the network (paper section 4): in full (weight 2) on the
            non-dominant hemisphere, by half on shared layers, not at all on the dominant hemisphere.
        reward_scale: factor on all rewards before the critics see them; measures and logs are unscaled.
        learning_rate, n_steps, batch_size, n_epochs, gamma, gae_lambda, clip_range, clip_range_vf,
        normalize_advantage, vf_coef, target_kl, stats_window_size, tensorboard_log, policy_kwargs, verbose,
        seed, device: as for SB3's ``PPO``.
        ent_coef: weight of the entropy of the Gaussian before its squashing, or its schedule. Stock PPO estimates
            the squashed one's from the sampled actions, with zero expected gradient: a bonus that does nothing.
        max_grad_norm: bound of the gradient norm of each parameter group.

    Raises:
        ValueError: an unknown loss, or a policy that is not bilateral_rl's.
    """

    policy_aliases: ClassVar[dict[str, type[BasePolicy]]] = dict(POLICY_ALIASES)
    policy: BilateralActorCriticPolicy
    rollout: StreamRollout

    def __init__(
        self,
        policy: str | type[BilateralActorCriticPolicy],
        env: GymEnv | str | None,
        loss: Loss = "specialized",
        weight_penalty: float = 0.001,
        reward_scale: float = 1.0,
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
        target_kl: float | None = None,
        stats_window_size: int = 100,
        tensorboard_log: str | None = None,
        policy_kwargs: dict[str, Any] | None = None,
        verbose: int = 0,
        seed: int | None = None,
        device: torch.device | str = "auto",
        _init_setup_model: bool = True,
    ) -> None:
        if isinstance(policy, type) and not issubclass(policy, BilateralActorCriticPolicy):
            raise ValueError(f"HemisphericPPO needs a BilateralActorCriticPolicy, not {policy.__name__}.")
        self.loss = loss
        self.weight_penalty = weight_penalty
        self.reward_scale = reward_scale
        policy_kwargs = {"n_streams": len(stream_mix(loss))} | (policy_kwargs or {})
        super().__init__(
            policy,
            env,  # type: ignore[arg-type]
            learning_rate=learning_rate,
            n_steps=n_steps,
            batch_size=batch_size,
            n_epochs=n_epochs,
            gamma=gamma,
            gae_lambda=gae_lambda,
            clip_range=clip_range,
            clip_range_vf=clip_range_vf,
            normalize_advantage=normalize_advantage,
            ent_coef=ent_coef,  # type: ignore[arg-type]
            vf_coef=vf_coef,
            max_grad_norm=max_grad_norm,
            target_kl=target_kl,
            stats_window_size=stats_window_size,
            tensorboard_log=tensorboard_log,
            policy_kwargs=policy_kwargs,
            verbose=verbose,
            seed=seed,
            device=device,
            _init_setup_model=_init_setup_model,
        )

    def _setup_model(self) -> None:
        # SB3's own buffer is not used: keep it at one step.
        n_steps, self.n_steps = self.n_steps, 1
        super()._setup_model()
        self.n_steps = n_steps
        self._check_spaces_and_streams()
        self._mix = stream_mix(self.loss)
        self._shares = shares(self.loss)
        self.rollout = StreamRollout(n_steps, self.n_envs, self.observation_space, self.action_space, len(self._mix))

    def _check_spaces_and_streams(self) -> None:
        if not isinstance(self.observation_space, spaces.Box):
            raise ValueError(f"HemisphericPPO needs observations in a Box, not {self.observation_space}; flatten them.")
        n_streams = len(stream_mix(self.loss))
        if self.policy.n_streams != n_streams:
            raise ValueError(
                f"the loss {self.loss!r} needs {n_streams} critics, but the policy has {self.policy.n_streams}: "
                "a saved model keeps its loss, and policy_kwargs leave n_streams out."
            )

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), "rollout", "_mix", "_shares"]

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
                _name_stream_returns(infos)
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

    def _stream_rewards(self, env: VecEnv, infos: list[dict[str, Any]]) -> NDArray[np.float32]:
        """(n_envs, n_streams) scaled rewards of the last step."""
        pair = getattr(env, "last_vector_reward", None)
        if pair is None:
            if "vector_reward" not in infos[0]:
                raise ValueError(
                    "HemisphericPPO needs a pair of rewards, dominant and non-dominant: the environment has neither "
                    "last_vector_reward (n_envs, 2) nor info['vector_reward'] (2,)."
                )
            pair = np.array([info["vector_reward"] for info in infos], dtype=np.float32)
        return np.asarray(pair @ self._mix.T * self.reward_scale, dtype=np.float32)

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

    def train(self) -> None:
        """Update the policy from :attr:`rollout`."""
        self.policy.set_training_mode(True)
        self._update_learning_rate(self.policy.optimizer)
        clip_range = self.clip_range(self._current_progress_remaining)  # type: ignore[operator]
        log: dict[str, list[Tensor]] = defaultdict(list)
        for _ in range(self.n_epochs):
            completed = self._train_epoch(clip_range, log)
            self._n_updates += 1
            if not completed:
                break
        self._record(log, clip_range)

    def _train_epoch(self, clip_range: float, log: dict[str, list[Tensor]]) -> bool:
        """One pass over the rollout; False if it stopped early because the policy had moved too far."""
        groups = self.policy.parameter_groups()
        network = self.policy.motor_network.parameter_groups()
        for batch in self.rollout.minibatches(self.batch_size, self.device):
            losses, approx_kl = self._losses(batch, clip_range, log)
            if self.target_kl is not None and approx_kl > 1.5 * self.target_kl:
                return False
            assign_routed_gradients(losses, groups, self._shares)
            add_weight_penalty(network, penalty_weights(self.loss), self.weight_penalty)
            norms = clip_group_gradients(groups, self.max_grad_norm)
            self.policy.optimizer.step()
            for name, (before, after) in norms.items():
                log[f"gradient_norm/{name}"].append(before)
                log[f"gradient_norm_clipped/{name}"].append(after)
        return True

    def _losses(
        self, batch: StreamBatch, clip_range: float, log: dict[str, list[Tensor]]
    ) -> tuple[list[Tensor], float]:
        """Each stream's loss, and the approximate KL divergence from the policy that collected the batch."""
        policy = self.policy
        mean = policy.action_mean(batch.observations)
        log_prob = gaussian_log_prob(batch.latent_actions, mean, policy.log_std)
        values = policy.predict_stream_values(batch.observations)
        log_ratio = log_prob - batch.old_log_prob
        ratio = log_ratio.exp()
        clipped = ratio.clamp(1 - clip_range, 1 + clip_range)
        advantages = batch.advantages
        if self.normalize_advantage and len(advantages) > 1:
            advantages = (advantages - advantages.mean(dim=0)) / (advantages.std(dim=0) + 1e-8)
        policy_loss = -torch.min(advantages * ratio[:, None], advantages * clipped[:, None]).mean(dim=0)
        value_loss = (self._clipped_values(values, batch.old_values) - batch.returns).square().mean(dim=0)
        loss = policy_loss + self.vf_coef * value_loss
        ent_coef = self._present_ent_coef()
        if ent_coef:
            loss = loss - ent_coef * gaussian_entropy(policy.log_std)
        with torch.no_grad():
            approx_kl = (ratio - 1 - log_ratio).mean()
            log["approx_kl"].append(approx_kl)
            log["clip_fraction"].append(((ratio - 1).abs() > clip_range).float().mean())
            log["policy_loss"].append(policy_loss.detach())
            log["value_loss"].append(value_loss.detach())
        return list(loss.unbind()), float(approx_kl)

    def _present_ent_coef(self) -> float:
        return FloatSchedule(self.ent_coef)(self._current_progress_remaining)

    def _clipped_values(self, values: Tensor, old_values: Tensor) -> Tensor:
        if self.clip_range_vf is None:
            return values
        clip = self.clip_range_vf(self._current_progress_remaining)  # type: ignore[operator]
        return old_values + (values - old_values).clamp(-clip, clip)

    def dump_logs(self, iteration: int = 0) -> None:
        """SB3's log, and the mean return of each stream over the last trials."""
        assert self.ep_info_buffer is not None
        for stream in ("dominant", "non_dominant"):
            returns = [info[stream] for info in self.ep_info_buffer if stream in info]
            if returns:
                self.logger.record(f"return/{stream}", float(np.mean(returns)))
        super().dump_logs(iteration)

    def _record(self, log: dict[str, list[Tensor]], clip_range: float) -> None:
        """Averages of the update, the streams of a quantity under one heading."""
        record = self.logger.record
        averages = {name: torch.stack(values).mean(dim=0).cpu() for name, values in log.items()}
        for quantity in ("policy_loss", "value_loss"):
            for name, value in zip(stream_names(self.loss), averages.pop(quantity).tolist(), strict=True):
                record(f"{quantity}/{name}", value)
        for stream, name in enumerate(stream_names(self.loss)):
            values, returns = self.rollout.values[..., stream].ravel(), self.rollout.returns[..., stream].ravel()
            record(f"explained_variance/{name}", float(explained_variance(values, returns)))
        for name in ("approx_kl", "clip_fraction"):
            record(f"train/{name}", averages.pop(name).item())
        for name, value in averages.items():
            record(name, value.item())
        record("train/std", self.policy.log_std.exp().mean().item())
        record("train/clip_range", clip_range)
        record("train/ent_coef", self._present_ent_coef())
        record("train/n_updates", self._n_updates, exclude="tensorboard")
        for side, weight in getattr(self.policy.motor_network, "combination_weights", dict)().items():
            record(f"combination/{side}", weight)


def _name_stream_returns(infos: list[dict[str, Any]]) -> None:
    """Put the streams' returns where SB3 keeps episode statistics; a Monitor in between leaves them out."""
    for info in infos:
        if "episode" in info and "vector_return" in info:
            dominant, non_dominant = (float(value) for value in info["vector_return"])
            info["episode"] |= {"dominant": dominant, "non_dominant": non_dominant}


def gaussian_entropy(log_std: Tensor) -> Tensor:
    """Entropy of independent Gaussians (nats)."""
    return (log_std + 0.5 * math.log(2 * math.pi * math.e)).sum()


def gaussian_log_prob(x: Tensor, mean: Tensor, log_std: Tensor) -> Tensor:
    """(n,) log density of ``x`` (n, d) under independent Gaussians."""
    constant = 0.5 * math.log(2 * math.pi) * x.shape[1]
    return -0.5 * (((x - mean) * (-log_std).exp()) ** 2).sum(dim=1) - log_std.sum() - constant
