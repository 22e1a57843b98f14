"""Reinforcement learning runs from start or resume to their end."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat
from torch import Tensor

from bilateral_rl.algorithms import HemisphericPPO
from bilateral_rl.callbacks import (
    CheckpointCallback,
    EvaluationCallback,
    MonitorCallback,
    StopCallback,
)
from bilateral_rl.config import RLConfig
from bilateral_rl.controllers import initial_states, load_policy_weights
from bilateral_rl.envs import ENVIRONMENT_IDS
from bilateral_rl.errors import UserError
from bilateral_rl.progress import (
    FAILED,
    FINISHED,
    INTERRUPTED,
    RUNNING,
    UNWATCHED,
    Outcome,
    Progress,
    StopRequest,
)
from bilateral_rl.rl_algorithms import build_algorithm
from bilateral_rl.run_folder import FINAL, RunFolder


def train(config: RLConfig, out: Path, progress: Progress = UNWATCHED) -> Outcome:
    """Train from scratch into a new folder below ``out``.

    Raises:
        UserError: a device or an initial network that is not there, or a folder that cannot be written.
    """
    states = initial_states(config)
    algorithm = build_algorithm(config)
    if states:
        algorithm.policy.motor_network.load_state_dict(states[config.seed])
    return _run(algorithm, config, RunFolder.create(out, config), config.timesteps, progress)


def resume(folder: RunFolder, config: RLConfig, progress: Progress = UNWATCHED) -> Outcome:
    """Go on with ``folder``'s training until ``config.timesteps``.

    Weights, optimizer, step counters, schedules and torch's random state continue; every arm starts a new trial.

    Raises:
        UserError: a damaged run, or one that has already come that far.
    """
    status = folder.status()
    done = status.get("timesteps", 0)
    if "weights" not in status:
        again = f"bilateral-rl train --config {folder.path / 'config.yaml'}"
        raise UserError(f"{folder.path} stopped before it was first saved; start anew with `{again}`.")
    if done >= config.timesteps:
        raise UserError(f"{folder.path} has done its {done:,} steps; give a larger --timesteps to train it further.")
    algorithm = build_algorithm(config)
    load_policy_weights(algorithm.policy, folder.load_weights(status["weights"]), folder)
    _restore(algorithm, folder)
    folder.write_config(config)
    algorithm.num_timesteps = done
    algorithm._n_updates = status.get("updates", 0)
    # Neither the trials of the first steps again, nor those of an evaluation.
    seeds = np.random.SeedSequence([config.seed, done]).generate_state(config.n_envs).tolist()
    algorithm.env.seed_arms(seeds)  # type: ignore[union-attr]
    return _run(algorithm, config, folder, config.timesteps - done, progress)


def _run(algorithm: HemisphericPPO, config: RLConfig, folder: RunFolder, timesteps: int, progress: Progress) -> Outcome:
    began = time.monotonic()
    stop = StopRequest()
    callbacks = CallbackList(
        [
            StopCallback(stop),
            _ProgressCallback(progress.on_step),
            MonitorCallback(folder, ENVIRONMENT_IDS.get(config.task, config.task)),
            EvaluationCallback(folder, config, progress.on_evaluation),
            CheckpointCallback(
                config.evaluation.checkpoint_every, lambda step: _save(algorithm, folder, f"step_{step:010d}", RUNNING)
            ),
        ]
    )
    progress.on_start(algorithm.num_timesteps)
    algorithm.set_logger(Logger(str(folder.path), [TensorBoardOutputFormat(str(folder.path))]))
    folder.write_json("status.json", _status(algorithm, RUNNING, folder.status().get("weights")))
    interrupted = False
    with stop.on_interrupt(), _closing(algorithm):
        try:
            algorithm.learn(timesteps, callback=callbacks, reset_num_timesteps=algorithm.num_timesteps == 0)
        except KeyboardInterrupt:
            interrupted = True
        except ValueError as error:
            _raise_if_diverged(algorithm, folder, error)
            raise
        interrupted |= stop.requested and algorithm.num_timesteps < config.timesteps
        _save(algorithm, folder, FINAL, INTERRUPTED if interrupted else FINISHED)
    seconds = time.monotonic() - began
    return Outcome(folder, algorithm.num_timesteps, interrupted, seconds, {config.seed: algorithm.policy})


def _raise_if_diverged(algorithm: HemisphericPPO, folder: RunFolder, error: ValueError) -> None:
    if all(bool(parameter.isfinite().all()) for parameter in algorithm.policy.parameters()):
        return
    folder.write_json("status.json", _status(algorithm, FAILED, folder.status().get("weights")))
    raise UserError(
        f"The policy diverged after {algorithm.num_timesteps:,} steps; try a smaller ppo.learning_rate. "
        f"What was saved before is in {folder.path}."
    ) from error


def _save(algorithm: HemisphericPPO, folder: RunFolder, name: str, state: str) -> None:
    """Weights first, then what belongs to them, then the status that points to them."""
    folder.save_weights(name, dict(algorithm.policy.state_dict()))
    folder.save_resume(_resume_tensors(algorithm))
    folder.write_json("status.json", _status(algorithm, state, name))


def _status(algorithm: HemisphericPPO, state: str, weights: str | None) -> dict[str, Any]:
    status = {"state": state, "timesteps": algorithm.num_timesteps, "updates": algorithm._n_updates}
    return status | ({"weights": weights} if weights else {})


def _resume_tensors(algorithm: HemisphericPPO) -> dict[str, Tensor]:
    state = algorithm.policy.optimizer.state_dict()["state"]
    tensors = {f"optimizer.{i}.{key}": torch.as_tensor(v) for i, entry in state.items() for key, v in entry.items()}
    return tensors | {"torch_random_state": torch.get_rng_state()}


def _restore(algorithm: HemisphericPPO, folder: RunFolder) -> None:
    tensors = folder.load_resume()
    random_state = tensors.pop("torch_random_state", None)
    optimizer = algorithm.policy.optimizer
    n_parameters = sum(len(group["params"]) for group in optimizer.param_groups)
    state: dict[int, dict[str, Tensor]] = {}
    for name, tensor in tensors.items():
        _, _, place = name.partition("optimizer.")
        index, _, key = place.partition(".")
        if not index.isdecimal() or int(index) >= n_parameters or not key:
            raise UserError(f"{folder.path / 'resume.safetensors'} is damaged: it holds an unknown {name!r}.")
        state.setdefault(int(index), {})[key] = tensor
    optimizer.load_state_dict({"state": state, "param_groups": optimizer.state_dict()["param_groups"]})
    if random_state is not None:
        torch.set_rng_state(random_state)


@contextlib.contextmanager
def _closing(algorithm: HemisphericPPO) -> Iterator[None]:
    try:
        yield
    finally:
        algorithm.logger.close()
        assert algorithm.env is not None
        algorithm.env.close()


class _ProgressCallback(BaseCallback):
    def __init__(self, tell: Callable[[int], None]) -> None:
        super().__init__()
        self._tell = tell

    def _on_step(self) -> bool:
        self._tell(self.num_timesteps)
        return True
