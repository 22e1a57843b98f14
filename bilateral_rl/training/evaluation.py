"""Evaluations along a reinforcement learning: logged, tabulated, and the best weights kept."""

from __future__ import annotations

import torch
from stable_baselines3.common.logger import Figure as LoggedFigure
from stable_baselines3.common.logger import Logger
from torch import Tensor

from bilateral_rl.analysis.modulation import TAGS, SideModulation, side_modulation
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.config.schema import RLConfig
from bilateral_rl.figures import hand_paths
from bilateral_rl.io.tensors import Tensors
from bilateral_rl.io.training_log import TrainingLog
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.training.checkpoint import fill


class Evaluations:
    """Evaluates the deterministic policy, always on the same trials.

    The best policy is the one with the highest return, which is minus the combined loss.

    Args:
        config: of the training.
        folder: where ``evaluations.csv`` goes.

    Attributes:
        log: the file.
        best_weights: ``state_dict()`` of the best policy so far; empty before the first evaluation.
        modulation: what each side supplied in the last evaluation; None before it, or of a network without sides.
    """

    FIGURE_EVERY = 4
    """Evaluations between figures of hand paths."""

    def __init__(self, config: RLConfig, folder: RunFolder) -> None:
        evaluation = config.evaluation
        self._trial = config.trial
        self._evaluator = Evaluator(config.make_task(), config.trial, evaluation.trials, evaluation.seed, config.device)
        self.log = TrainingLog(folder.path / "evaluations.csv")
        self.best_weights: Tensors = {}
        self.modulation: SideModulation | None = None
        self._count = 0
        self._best_return = -float("inf")

    def tensors(self) -> Tensors:
        """Return what the next evaluations depend on."""
        weights = {f"weights.{name}": tensor for name, tensor in self.best_weights.items()}
        best = torch.tensor(self._best_return, dtype=torch.float64)
        return {"done": torch.tensor(self._count), "best_return": best, **weights}

    def restore(self, tensors: Tensors, policy: MotorPolicy) -> None:
        """Go on from :meth:`tensors`. Raises ValueError for what does not fit ``policy``."""
        self.best_weights = _copy_of_weights(policy)
        fill("evaluation", present := self.tensors(), tensors)
        self._count, self._best_return = int(present["done"]), float(present["best_return"])

    def run(self, policy: MotorPolicy, logger: Logger, step: int) -> tuple[dict[str, float], bool]:
        """Evaluate ``policy`` after ``step`` environment steps: its measures, and whether it is the best so far."""
        record = self._evaluator.run(policy)
        measures = record.summary(self._trial.threshold) | _of_hands(record, self._trial.threshold)
        measures["return_scalar"] = (measures["return_dominant"] + measures["return_non_dominant"]) / 2
        self.modulation = side_modulation(policy.motor_network, record)
        measures |= record.numbers_by_hand(self._trial.threshold)
        measures |= self.modulation.measures() if self.modulation else {}
        self._write(measures, record, logger, step)
        is_best = measures["return_scalar"] > self._best_return
        if is_best:
            self._best_return, self.best_weights = measures["return_scalar"], _copy_of_weights(policy)
        self._count += 1
        return measures, is_best

    def _write(self, measures: dict[str, float], record: TrialRecord, logger: Logger, step: int) -> None:
        for name, value in measures.items():
            logger.record(_tag(name), value)
        if self._count % self.FIGURE_EVERY == 0:
            figure = hand_paths(record, self._trial.threshold, sum(self._trial.arm.link_length))
            logger.record("figures/hand_paths", LoggedFigure(figure, close=True), exclude=("stdout", "csv"))
        logger.dump(step)
        row = ",".join([str(step), *(f"{value:.6g}" for value in measures.values())]) + "\n"
        self.log.append(row, ",".join(["timesteps", *measures]) + "\n")


def _of_hands(record: TrialRecord, radius: float) -> dict[str, float]:
    """Return what each of two hands does in its role, named as in the history of BPTT; nothing of one arm."""
    if record.n_arms == 1:
        return {}
    by_hand = record.summaries_by_hand(radius).items()
    return {f"{name}_of_{hand}_{role}": value for (hand, role), means in by_hand for name, value in means.items()}


def _tag(name: str) -> str:
    """Return what tensorboard calls a measure; a heading of their own puts the two sides' side by side."""
    if name in TAGS:
        return TAGS[name]
    return f"evaluation_return/{name.removeprefix('return_')}" if name.startswith("return_") else f"evaluation/{name}"


def _copy_of_weights(policy: MotorPolicy) -> dict[str, Tensor]:
    return {name: tensor.detach().clone() for name, tensor in policy.state_dict().items()}
