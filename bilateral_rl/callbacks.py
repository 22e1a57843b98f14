"""What happens along a training: evaluations, saved weights, the monitor file, a clean stop."""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Callable, Iterator
from typing import TextIO

from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Figure as LoggedFigure

from bilateral_rl.config import RLConfig
from bilateral_rl.errors import UserError
from bilateral_rl.evaluation import Evaluator, TrialRecord
from bilateral_rl.figures import hand_paths
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.progress import StopRequest
from bilateral_rl.run_folder import BEST, RunFolder

OnEvaluation = Callable[[int, dict[str, float]], None]


class EvaluationCallback(BaseCallback):
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
        super().__init__()
        self._folder, self._config, self._on_evaluation = folder, config, on_evaluation
        evaluation = config.evaluation
        self._evaluator = Evaluator(config.task, config.trial, evaluation.trials, evaluation.seed, config.device)
        self._path = folder.path / "evaluations.csv"
        self._done = 0
        self._due = 0
        self._best = -float("inf")

    def _on_training_start(self) -> None:
        rows = list(self._rows())
        self._done = len(rows)
        try:
            self._due = int(rows[-1]["timesteps"]) + self._config.evaluation.every if rows else 0
            self._best = max((float(row["return_scalar"]) for row in rows), default=-float("inf"))
        except (KeyError, TypeError, ValueError):
            raise UserError(f"{self._path} is damaged; move it away to go on without it.") from None

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= self._due:
            self._due += self._config.evaluation.every
            self.evaluate()

    def _on_step(self) -> bool:
        return True

    def _on_training_end(self) -> None:
        self.evaluate()
        self.logger.dump(self.num_timesteps)

    def evaluate(self) -> None:
        """Evaluate now."""
        policy = self.model.policy
        assert isinstance(policy, MotorPolicy)
        record = self._evaluator.run(policy)
        measures = record.summary(self._config.trial.threshold)
        measures["return_scalar"] = (measures["return_dominant"] + measures["return_non_dominant"]) / 2
        self._log(measures, record)
        self._append(measures)
        if measures["return_scalar"] > self._best:
            self._best = measures["return_scalar"]
            self._folder.save_weights(BEST, dict(policy.state_dict()))
        self._on_evaluation(self.num_timesteps, measures)
        self._done += 1

    def _log(self, measures: dict[str, float], record: TrialRecord) -> None:
        for name, value in measures.items():
            is_return = name.startswith("return_")  # a heading of their own puts the two streams side by side
            tag = f"evaluation_return/{name.removeprefix('return_')}" if is_return else f"evaluation/{name}"
            self.logger.record(tag, value)
        if self._done % self.FIGURE_EVERY == 0:
            trial = self._config.trial
            figure = hand_paths(record, trial.threshold, sum(trial.arm.link_length))
            self.logger.record("figures/hand_paths", LoggedFigure(figure, close=True), exclude=("stdout", "csv"))

    def _append(self, measures: dict[str, float]) -> None:
        is_new = not self._path.exists() or not self._path.stat().st_size
        with self._path.open("a", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            if is_new:
                writer.writerow(["timesteps", *measures])
            writer.writerow([self.num_timesteps, *(f"{value:.6g}" for value in measures.values())])

    def _rows(self) -> Iterator[dict[str, str]]:
        if self._path.exists():
            with self._path.open(newline="", encoding="utf-8") as file:
                yield from csv.DictReader(file)


class CheckpointCallback(BaseCallback):
    """Save weights, and what resuming needs, every so many environment steps.

    Args:
        every: environment steps between saves.
        save: called with the step.
    """

    def __init__(self, every: int, save: Callable[[int], None]) -> None:
        super().__init__()
        self._every, self._save = every, save
        self._due = every

    def _on_training_start(self) -> None:
        self._due = (self.num_timesteps // self._every + 1) * self._every

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= self._due:
            self._due = (self.num_timesteps // self._every + 1) * self._every
            self._save(self.num_timesteps)

    def _on_step(self) -> bool:
        return True


class MonitorCallback(BaseCallback):
    """Write every finished trial to ``monitor.csv`` in the format of SB3's ``Monitor``, with both streams' returns."""

    COLUMNS = ("r", "l", "t", "dominant", "non_dominant")

    def __init__(self, folder: RunFolder, environment_id: str) -> None:
        super().__init__()
        self._path = folder.path / "monitor.csv"
        self._environment_id = environment_id
        self._file: TextIO | None = None

    def _on_training_start(self) -> None:
        is_new = not self._path.exists()
        self._file = self._path.open("a", newline="", encoding="utf-8")
        if is_new:
            header = {"t_start": time.time(), "env_id": self._environment_id}
            self._file.write(f"#{json.dumps(header)}\n{','.join(self.COLUMNS)}\n")

    def _on_step(self) -> bool:
        if self._file is not None and self.locals["dones"].any():
            episodes = [info["episode"] for info in self.locals["infos"] if "episode" in info]
            self._file.writelines(",".join(f"{e[column]:.6g}" for column in self.COLUMNS) + "\n" for e in episodes)
        return True

    def _on_training_end(self) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()
            self._file = None


class StopCallback(BaseCallback):
    """Stop the training between two steps once ``request`` asks for it."""

    def __init__(self, request: StopRequest) -> None:
        super().__init__()
        self._request = request

    def _on_step(self) -> bool:
        return not self._request.requested
