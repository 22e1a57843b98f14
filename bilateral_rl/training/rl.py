"""Reinforcement learning of one network, by one of the hemispheric algorithms."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat

from bilateral_rl.algorithms.finite import DivergedError
from bilateral_rl.config.schema import RLConfig
from bilateral_rl.envs import ENVIRONMENT_IDS
from bilateral_rl.io import event_files
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.tensors import Tensors
from bilateral_rl.io.threads import torch_threads
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.policies.off_policy import BilateralTD3Policy
from bilateral_rl.runs.folder import FINAL, RunFolder
from bilateral_rl.training import checkpoint
from bilateral_rl.training.blocks import BlocksCallback, blocks_of_run
from bilateral_rl.training.build import build_algorithm
from bilateral_rl.training.callbacks import LogCallback, MonitorCallback, Stopped, WatcherCallback
from bilateral_rl.training.evaluation import Evaluations
from bilateral_rl.training.learner import Diverged, Learner, Moment, Watcher
from bilateral_rl.training.lesion_probe import probe_of_run
from bilateral_rl.training.silence import silence_notes
from bilateral_rl.training.tracking import Tracking

_EVALUATION, _BLOCKS = "evaluation", "blocks"
"""Prefixes of the evaluations' and the blocks' part of the state."""


class RLLearner(Learner):
    """Learns by interaction with many arms at once; a stretch is a rollout and the updates that follow it.

    Args:
        config: of the training.
        folder: where logs go.
        initial: ``state_dict()`` of the network to begin with; None for a fresh one.
    """

    def __init__(self, config: RLConfig, folder: RunFolder, initial: Tensors | None = None) -> None:
        self._config, self._folder = config, folder
        self.evaluation_every, self.checkpoint_every = config.evaluation.every, config.evaluation.checkpoint_every
        self.algorithm = build_algorithm(config)
        if initial:
            self._begin_with(initial)
        self._evaluations = Evaluations(config, folder)
        self._monitor = MonitorCallback(folder, ENVIRONMENT_IDS.get(config.task, config.task))
        self._probe = probe_of_run(config, folder)
        self._blocks = blocks_of_run(config, folder)
        logs = [self._evaluations.log, self._monitor.log, *([self._blocks.log] if self._blocks else [])]
        self.logs = {log.path.name: log for log in logs}
        self._resumes = False
        self._tracking: Tracking | None = None
        self._resources = contextlib.ExitStack()
        self.algorithm.set_logger(Logger(str(folder.path), []))

    @property
    def done(self) -> int:
        return self.algorithm.num_timesteps

    @property
    def finished(self) -> bool:
        return self.done >= self._config.timesteps

    def why_finished(self) -> str:
        return f"has done its {self.done:,} steps; give a larger --timesteps to train it further"

    def state(self) -> Tensors:
        self._check_finite()
        parts = {_EVALUATION: self._evaluations.tensors()} | ({_BLOCKS: self._blocks.tensors()} if self._blocks else {})
        return checkpoint.state_tensors(self.algorithm) | checkpoint.join(parts)

    def load(self, state: Tensors) -> None:
        checkpoint.check(state)
        if checkpoint.goes_by_other_rules(state):
            path = self._folder.path
            raise UserError(
                f"{path} was trained by an earlier version, whose updates weighed the penalty otherwise; begin a new "
                f"training with its network: `bilateral-rl train --init-from {path}` and the same settings."
            )
        parts = checkpoint.split(state)
        self._evaluations.restore(parts.pop(_EVALUATION, {}), self.algorithm.policy)
        if self._blocks:
            self._blocks.restore(parts.pop(_BLOCKS, {}))
        checkpoint.restore(self.algorithm, checkpoint.join(parts))
        self._resumes = True

    def status(self, run_state: str) -> dict[str, Any]:
        return {"timesteps": self.done, "updates": self.algorithm._n_updates}

    def weights(self, moment: Moment) -> dict[str, Tensors]:
        if moment == "start":
            return {}
        return {FINAL if moment == "end" else f"step_{self.done:010d}": dict(self.algorithm.policy.state_dict())}

    def best(self) -> Tensors:
        return self._evaluations.best_weights

    def policies(self) -> dict[int, MotorPolicy]:
        return {self._config.seed: self.algorithm.policy}

    def open(self, folder: RunFolder) -> None:
        """Open tensorboard's file, cut back to the present step, and Weights & Biases if it tracks the training."""
        algorithm = self.algorithm
        assert algorithm.env is not None
        self._resources.enter_context(torch_threads(self._config.threads))
        self._resources.callback(algorithm.env.close)
        event_files.cut_back(folder.path, self.done)
        output = TensorBoardOutputFormat(str(folder.path))
        self._resources.callback(output.close)
        algorithm.logger.output_formats.append(output)
        if self._config.track:
            self._tracking = Tracking(folder, self._config)
            self._resources.callback(self._tracking.close)
            algorithm.logger.output_formats.append(self._tracking)

    def close(self) -> None:
        self._resources.close()

    def learn(self, watcher: Watcher) -> bool:
        algorithm, config = self.algorithm, self._config
        # In the order in which they act between two iterations: the watcher, who saves, knows of all the others.
        callbacks: list[BaseCallback] = [self._monitor, LogCallback(config.timesteps)]
        callbacks += [self._probe] if self._probe else []
        callbacks += [BlocksCallback(self._blocks, config.seed)] if self._blocks else []
        try:
            algorithm.learn(
                config.timesteps - algorithm.num_timesteps,
                callback=CallbackList([*callbacks, WatcherCallback(watcher)]),
                log_interval=None,  # type: ignore[arg-type] # SB3 takes it, LogCallback does it
                reset_num_timesteps=not self._resumes,
            )
        except Stopped:
            return False
        except ValueError as error:  # torch refuses a distribution around what is not finite
            self._check_finite(error)
            if isinstance(error, DivergedError):
                raise Diverged(self._how_it_diverged()) from error
            raise
        return True

    def evaluate(self) -> tuple[dict[str, float], bool]:
        return self._evaluations.run(self.algorithm.policy, self.algorithm.logger, self.done)

    def notes(self) -> list[str]:
        notes = [*self._tracking.notes] if self._tracking else []
        if self._config.evaluation.lesion_probe_every and not self._probe:
            notes.append(f"{self._config.model} has no hemispheres to lesion: there was no lesion probe.")
        if self.finished and self._evaluations.modulation:
            weights = self.algorithm.policy.motor_network.combination_weights()
            notes += silence_notes(self._evaluations.modulation, weights, self._config)
        return notes

    def _begin_with(self, network: Tensors) -> None:
        policy = self.algorithm.policy
        policy.motor_network.load_state_dict(network)
        if isinstance(policy, BilateralTD3Policy):  # or its first values are those of a network of chance
            policy.actor_target.load_state_dict(policy.actor.state_dict())

    def _check_finite(self, cause: Exception | None = None) -> None:
        """Raise Diverged unless the policy is made of finite numbers, and comes to finite numbers."""
        policy, observation = self.algorithm.policy, self.algorithm._last_obs
        is_finite = all(bool(tensor.isfinite().all()) for tensor in policy.state_dict().values())
        if is_finite and isinstance(observation, np.ndarray):
            try:  # finite weights may be so large that what they come to is not
                with policy.motor_network.noise.of_trials(range(len(observation))):  # the training's own stream stays
                    action, _ = policy.predict(observation, deterministic=True)
                is_finite = bool(np.isfinite(action).all())
            except ValueError:
                is_finite = False
        if not is_finite:
            raise Diverged(self._how_it_diverged()) from cause

    def _how_it_diverged(self) -> str:
        return f"The policy diverged after {self.done:,} steps; try a smaller {self._config.algo}.learning_rate."
