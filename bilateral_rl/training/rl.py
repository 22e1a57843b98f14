"""Reinforcement learning runs from start or resume to their end."""

from __future__ import annotations

import contextlib
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat

from bilateral_rl.algorithms import Hemispheric
from bilateral_rl.config.schema import RLConfig
from bilateral_rl.envs import ENVIRONMENT_IDS
from bilateral_rl.io import event_files as tensorboard_files
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.tensors import Tensors
from bilateral_rl.runs.folder import FAILED, FINAL, FINISHED, INTERRUPTED, RUNNING, RunFolder
from bilateral_rl.runs.policies import initial_states
from bilateral_rl.training import checkpoint as rl_state
from bilateral_rl.training.build import build_algorithm
from bilateral_rl.training.callbacks import (
    EvaluationCallback,
    LogCallback,
    MonitorCallback,
    ProgressCallback,
    SaveCallback,
    Stopped,
)
from bilateral_rl.training.lesion_probe import probe_of_run
from bilateral_rl.training.session import UNWATCHED, Outcome, Progress, StopRequest
from bilateral_rl.training.tracking import Tracking, check_tracking
from bilateral_rl.training.write_failures import explaining_write_failures

_OF_0_1_0 = "torch_random_state"
"""In what version 0.1.0 saved for resuming: weights apart, no environment."""


def train(config: RLConfig, out: Path, progress: Progress = UNWATCHED) -> Outcome:
    """Train from scratch into a new folder below ``out``.

    Raises:
        UserError: a device or an initial network that is not there, a folder that cannot be written, or a policy that
            diverged.
    """
    if config.track:
        check_tracking()
    states = initial_states(config)
    algorithm = build_algorithm(config)
    if states:
        algorithm.policy.motor_network.load_state_dict(states[config.seed])
    folder = RunFolder.create(out, config)
    with folder.locked(), explaining_write_failures(folder):
        return _Run(folder, config, algorithm, progress).go()


def resume(folder: RunFolder, config: RLConfig, progress: Progress = UNWATCHED) -> Outcome:
    """Go on with ``folder``'s training until ``config.timesteps``.

    Everything continues (:mod:`bilateral_rl.training.checkpoint`): on the same machine, with the same number of steps,
    it ends with the bits of a training that was never stopped. More steps stretch the schedules.

    Raises:
        UserError: a damaged run, one of an older version, one that has already come that far, or one that another
            process is at; a folder that cannot be written, or a policy that diverged.
    """
    if config.track:
        check_tracking()
    with folder.locked(), explaining_write_failures(folder):
        tensors = _saved(folder)
        run = _Run(folder, config, build_algorithm(config), progress)
        run.restore(tensors)
        return run.go()


def _saved(folder: RunFolder) -> Tensors:
    if not (folder.path / "resume.safetensors").exists() and "weights" not in folder.status():
        again = f"bilateral-rl train --config {folder.path / 'config.yaml'}"
        raise UserError(f"{folder.path} stopped before it was first saved; start anew with `{again}`.")
    tensors = folder.load_resume()
    if _OF_0_1_0 in tensors:
        raise UserError(
            f"{folder.path} was trained by version 0.1.0, which did not save all that resuming needs; begin a new "
            f"training with its network: `bilateral-rl train --init-from {folder.path}` and the same settings."
        )
    return tensors


class _Run:
    """One stretch of a training, in its folder."""

    def __init__(self, folder: RunFolder, config: RLConfig, algorithm: Hemispheric, progress: Progress) -> None:
        self._folder, self._config, self._algorithm, self._progress = folder, config, algorithm, progress
        self._stop = StopRequest()
        self._evaluation = EvaluationCallback(folder, config, progress.on_evaluation)
        self._monitor = MonitorCallback(folder, ENVIRONMENT_IDS.get(config.task, config.task))
        self._probe = probe_of_run(config, folder)
        self._logs = {log.path.name: log for log in (self._evaluation.log, self._monitor.log)}
        self._resumes = False
        self._tracking: Tracking | None = None
        algorithm.set_logger(Logger(str(folder.path), []))

    def restore(self, tensors: Tensors) -> None:
        """Go on from what :meth:`_tensors` gave. Raises UserError, with the folder as it was, if that cannot be."""
        folder, config = self._folder, self._config
        try:
            rl_state.check(tensors)
            parts = rl_state.split(tensors)
            self._evaluation.restore(parts.pop("evaluation", {}), self._algorithm.policy)
            rl_state.fill("file", sizes := self._sizes(), parts.pop("file", {}))
            rl_state.restore(self._algorithm, rl_state.join(parts))
        except ValueError as error:
            raise UserError(f"{folder.path / 'resume.safetensors'} is damaged: {error}.") from None
        done = self._algorithm.num_timesteps
        if done >= config.timesteps and not self._was_killed_at_its_end(done):
            raise UserError(
                f"{folder.path} has done its {done:,} steps; give a larger --timesteps to train it further."
            )
        for name, log in self._logs.items():
            log.check(int(sizes[name]))
        for name, log in self._logs.items():
            log.cut(int(sizes[name]))
        tensorboard_files.cut_back(folder.path, done)
        folder.write_config(config)
        self._resumes = True

    def _was_killed_at_its_end(self, done: int) -> bool:
        """Between the state after the last step and the word that it is finished."""
        config = self._folder.config()
        assert isinstance(config, RLConfig)
        return self._folder.status().get("state") == RUNNING and done >= config.timesteps

    def go(self) -> Outcome:
        """Train until the end, or until somebody stops it."""
        began = time.monotonic()
        folder, config, algorithm = self._folder, self._config, self._algorithm
        self._progress.on_start(algorithm.num_timesteps)
        with self._stop.on_interrupt(), self._logging():
            folder.write_json("status.json", self._status(RUNNING))
            stopped_by = self._learn() if algorithm.num_timesteps < config.timesteps else None
            self._save(FINAL, INTERRUPTED if stopped_by else FINISHED)
        seconds = time.monotonic() - began
        policies = {config.seed: algorithm.policy}
        return Outcome(folder, algorithm.num_timesteps, stopped_by, seconds, policies, self._notes())

    def _notes(self) -> list[str]:
        notes = [*self._tracking.notes] if self._tracking else []
        if self._config.evaluation.lesion_probe_every and not self._probe:
            notes.append(f"{self._config.model} has no hemispheres to lesion: there was no lesion probe.")
        return notes

    def _learn(self) -> signal.Signals | None:
        """What stopped it, if anything did."""
        algorithm, config = self._algorithm, self._config
        try:
            algorithm.learn(
                config.timesteps - algorithm.num_timesteps,
                callback=CallbackList(self._callbacks()),
                log_interval=None,  # type: ignore[arg-type] # SB3 takes it, LogCallback does it
                reset_num_timesteps=not self._resumes,
            )
        except Stopped:
            return self._stop.signal
        except ValueError as error:
            if self._is_finite():
                raise
            raise self._divergence() from error
        return None

    def _callbacks(self) -> list[BaseCallback]:
        """In the order in which they act between two iterations: what is saved last knows of all the others."""
        config = self._config
        evaluation = config.evaluation
        callbacks: list[BaseCallback] = [
            ProgressCallback(self._progress),
            self._monitor,
            LogCallback(config.timesteps),
            self._evaluation,
        ]
        if self._probe:
            callbacks.append(self._probe)
        save = SaveCallback(evaluation.checkpoint_every, lambda name: self._save(name, RUNNING), self._stop)
        return [*callbacks, save]

    @contextlib.contextmanager
    def _logging(self) -> Iterator[None]:
        """Tensorboard's file is open, and the environment; whatever happens, both are closed."""
        algorithm = self._algorithm
        assert algorithm.env is not None
        with contextlib.ExitStack() as stack:
            stack.callback(algorithm.env.close)
            output = TensorBoardOutputFormat(str(self._folder.path))
            stack.callback(output.close)
            algorithm.logger.output_formats.append(output)
            if self._config.track:
                self._tracking = Tracking(self._folder, self._config)
                stack.callback(self._tracking.close)
                algorithm.logger.output_formats.append(self._tracking)
            yield

    def _save(self, weights: str | None, state: str) -> None:
        """What is only to be read first; then, whole and in one file, from where a killed training does the rest."""
        if not self._is_finite():
            raise self._divergence()
        folder = self._folder
        if weights:
            folder.save_weights(weights, dict(self._algorithm.policy.state_dict()))
        folder.save_resume(self._tensors())
        folder.write_json("status.json", self._status(state, weights))

    def _tensors(self) -> Tensors:
        own = {"evaluation": self._evaluation.tensors(), "file": self._sizes()}
        return rl_state.state_tensors(self._algorithm) | rl_state.join(own)

    def _sizes(self) -> Tensors:
        """Bytes of each log: what is behind them is of a time that a resumed training does again."""
        return {name: torch.tensor(log.size) for name, log in self._logs.items()}

    def _status(self, state: str, weights: str | None = None) -> dict[str, Any]:
        status = {"state": state, "timesteps": self._algorithm.num_timesteps, "updates": self._algorithm._n_updates}
        weights = weights or self._folder.status().get("weights")
        return status | ({"weights": weights} if weights else {})

    def _is_finite(self) -> bool:
        """Whether the policy is made of numbers, and comes to numbers: large ones need not."""
        policy, observation = self._algorithm.policy, self._algorithm._last_obs
        assert isinstance(observation, np.ndarray)
        if not all(bool(tensor.isfinite().all()) for tensor in policy.state_dict().values()):
            return False
        try:
            action, _ = policy.predict(observation, deterministic=True)
        except ValueError:  # torch refuses a distribution around what is no number
            return False
        return bool(np.isfinite(action).all())

    def _divergence(self) -> UserError:
        self._folder.write_json("status.json", self._status(FAILED))
        return UserError(
            f"The policy diverged after {self._algorithm.num_timesteps:,} steps; try a smaller "
            f"{self._config.algo}.learning_rate. What was saved before is in {self._folder.path}."
        )
