"""What happens along a training, between its iterations: logs, evaluations, saved states, a clean stop."""

from __future__ import annotations

import json
import time
from collections.abc import Callable

import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Figure as LoggedFigure
from torch import Tensor

from bilateral_rl.analysis.trials import Evaluator, TrialRecord
from bilateral_rl.config.schema import RLConfig
from bilateral_rl.figures import hand_paths
from bilateral_rl.io.tensors import Tensors
from bilateral_rl.io.training_log import TrainingLog
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.runs.folder import BEST, RunFolder
from bilateral_rl.training.checkpoint import fill
from bilateral_rl.training.session import Progress, StopRequest

OnEvaluation = Callable[[int, dict[str, float]], None]


class BetweenIterations(BaseCallback):
    """Does something between two iterations, once at least ``every`` environment steps have gone by."""

    def __init__(self, every: int) -> None:
        super().__init__()
        self._every = every
        self._due = 0

    def _on_training_start(self) -> None:
        self._plan()

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= self._due:
            self._plan()
            self.act()

    def _on_step(self) -> bool:
        return True

    def act(self) -> None:
        """Do it now."""
        raise NotImplementedError

    def _plan(self) -> None:
        """The next multiple, so that a resumed training does it where an uninterrupted one would."""
        self._due = (self.num_timesteps // self._every + 1) * self._every


class LogCallback(BetweenIterations):
    """Write what SB3 and the algorithm recorded: ``learn`` itself is called with ``log_interval=None``.

    SB3 counts iterations from where ``learn`` was called, or episodes, which end many at once with many arms.

    Args:
        timesteps: of the whole training.
    """

    POINTS = 1000
    """Of a curve, at most."""

    def __init__(self, timesteps: int) -> None:
        super().__init__(max(timesteps // self.POINTS, 1))

    def _on_training_start(self) -> None:
        super()._on_training_start()
        self._began = time.monotonic_ns()

    def act(self) -> None:
        """Write it now."""
        # SB3 takes the speed from the clock on the wall, which may be set back.
        self.model.start_time = time.time_ns() - (time.monotonic_ns() - self._began)
        self.model.dump_logs()  # type: ignore[attr-defined] # of on- and off-policy algorithms alike

    def _on_training_end(self) -> None:
        self.act()


class EvaluationCallback(BetweenIterations):
    """Evaluate the deterministic policy every so many environment steps, log it, and keep the best weights.

    The best policy is the one with the highest return, which is minus the combined loss.

    Args:
        folder: where ``evaluations.csv`` and the best weights go.
        config: of the training.
        on_evaluation: called with the step and the measures of each evaluation.
    """

    FIGURE_EVERY = 4
    """Evaluations between figures of hand paths."""

    def __init__(self, folder: RunFolder, config: RLConfig, on_evaluation: OnEvaluation) -> None:
        evaluation = config.evaluation
        super().__init__(evaluation.every)
        self._folder, self._config, self._on_evaluation = folder, config, on_evaluation
        self._evaluator = Evaluator(config.task, config.trial, evaluation.trials, evaluation.seed, config.device)
        self.log = TrainingLog(folder.path / "evaluations.csv")
        self._done = 0
        self._best = -float("inf")
        self._best_weights: Tensors = {}

    def tensors(self) -> Tensors:
        """What it goes on from, after the first evaluation."""
        weights = {f"weights.{name}": tensor for name, tensor in self._best_weights.items()}
        best = torch.tensor(self._best, dtype=torch.float64)
        return {"done": torch.tensor(self._done), "best_return": best, **weights}

    def restore(self, tensors: Tensors, policy: MotorPolicy) -> None:
        """Go on from :meth:`tensors`. Raises ValueError for what does not fit ``policy``."""
        self._best_weights = _copy(policy)
        fill("evaluation", own := self.tensors(), tensors)
        self._done, self._best = int(own["done"]), float(own["best_return"])

    def _on_training_start(self) -> None:
        super()._on_training_start()
        if self._done:
            self._folder.save_weights(BEST, self._best_weights)  # those there may be of a later evaluation
        else:
            self._due = 0

    def _on_training_end(self) -> None:
        self.act()

    def act(self) -> None:
        """Evaluate now."""
        policy = self.model.policy
        assert isinstance(policy, MotorPolicy)
        record = self._evaluator.run(policy)
        measures = record.summary(self._config.trial.threshold)
        measures["return_scalar"] = (measures["return_dominant"] + measures["return_non_dominant"]) / 2
        self._write(measures, record)
        if measures["return_scalar"] > self._best:
            self._best, self._best_weights = measures["return_scalar"], _copy(policy)
            self._folder.save_weights(BEST, self._best_weights)
        self._on_evaluation(self.num_timesteps, measures)
        self._done += 1

    def _write(self, measures: dict[str, float], record: TrialRecord) -> None:
        for name, value in measures.items():
            is_return = name.startswith("return_")  # a heading of their own puts the two streams side by side
            tag = f"evaluation_return/{name.removeprefix('return_')}" if is_return else f"evaluation/{name}"
            self.logger.record(tag, value)
        if self._done % self.FIGURE_EVERY == 0:
            trial = self._config.trial
            figure = hand_paths(record, trial.threshold, sum(trial.arm.link_length))
            self.logger.record("figures/hand_paths", LoggedFigure(figure, close=True), exclude=("stdout", "csv"))
        self.logger.dump(self.num_timesteps)
        header = ",".join(["timesteps", *measures]) + "\n"
        row = ",".join([str(self.num_timesteps), *(f"{value:.6g}" for value in measures.values())]) + "\n"
        self.log.append(row, header)


class SaveCallback(BetweenIterations):
    """Save every so many environment steps, and stop if asked to; it comes after all that writes.

    Args:
        every: environment steps between saved weights.
        save: called with the name of the weights to save, or None to save only what resuming needs.
        stop: the request.
    """

    def __init__(self, every: int, save: Callable[[str | None], None], stop: StopRequest) -> None:
        super().__init__(every)
        self._save, self._stop = save, stop

    def _on_training_start(self) -> None:
        super()._on_training_start()
        self._is_saved = self.num_timesteps > 0

    def _on_rollout_start(self) -> None:
        super()._on_rollout_start()
        if not self._is_saved:  # killed at any time, a training goes on
            self._is_saved = True
            self._save(None)
        if self._stop.requested:
            raise Stopped

    def act(self) -> None:
        """Save now."""
        self._is_saved = True
        self._save(f"step_{self.num_timesteps:010d}")


class Stopped(Exception):  # noqa: N818 - nothing went wrong
    """The training stops here, between two iterations: SB3 takes no other word for it."""


class MonitorCallback(BaseCallback):
    """Write every finished trial to ``monitor.csv`` in the format of SB3's ``Monitor``, with both streams' returns."""

    COLUMNS = ("r", "l", "t", "dominant", "non_dominant")

    def __init__(self, folder: RunFolder, environment_id: str) -> None:
        super().__init__()
        self.log = TrainingLog(folder.path / "monitor.csv")
        about = json.dumps({"t_start": time.time(), "env_id": environment_id})
        self._header = f"#{about}\n{','.join(self.COLUMNS)}\n"
        self._lines: list[str] = []

    def _on_training_start(self) -> None:
        self._write()

    def _on_step(self) -> bool:
        if self.locals["dones"].any():
            episodes = [info["episode"] for info in self.locals["infos"] if "episode" in info]
            self._lines += [",".join(f"{e[column]:.6g}" for column in self.COLUMNS) + "\n" for e in episodes]
        return True

    def _on_rollout_start(self) -> None:
        if self._lines:
            self._write()

    def _on_training_end(self) -> None:
        self._write()

    def _write(self) -> None:
        self.log.append("".join(self._lines), self._header)
        self._lines.clear()


class ProgressCallback(BaseCallback):
    """Tell how far the training is."""

    def __init__(self, progress: Progress) -> None:
        super().__init__()
        self._progress = progress

    def _on_step(self) -> bool:
        self._progress.on_step(self.num_timesteps)
        return True


def _copy(policy: MotorPolicy) -> dict[str, Tensor]:
    return {name: tensor.detach().clone() for name, tensor in policy.state_dict().items()}
