"""An adaptation by blocks: after every so much learning, trials without learning, with and without the field.

So human studies show what a field has changed: the error in it, the after-effect once it is off, and the force with
which the hand opposes it in a channel (Shadmehr & Mussa-Ivaldi 1994, doi:10.1523/JNEUROSCI.14-05-03208.1994; Scheidt et
al. 2000, doi:10.1152/jn.2000.84.2.853).
"""

from __future__ import annotations

from collections.abc import Iterable

import torch
from stable_baselines3.common.callbacks import BaseCallback

from bilateral_rl.analysis.block_table import BLOCKS, COLUMNS, MEASURES, OF_HANDS, in_conditions
from bilateral_rl.analysis.metrics import find_metric, metric_name
from bilateral_rl.analysis.trials import Evaluator, NotFiniteError
from bilateral_rl.config.schema import EvaluationConfig, TrainConfig
from bilateral_rl.envs.experiments.task import ExperimentTask
from bilateral_rl.io.tensors import Tensors
from bilateral_rl.io.training_log import TrainingLog
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.training.checkpoint import fill
from bilateral_rl.training.schedule import Schedule

_SEED = EvaluationConfig.seed
"""Seed of the first trial of every test, which is no trial of any training."""


class Blocks:
    """Tests the deterministic policies of a training, always in the same trials, and tabulates what they do.

    What is measured waits until it is committed: a training that is stopped within an epoch does that epoch again.

    Args:
        config: of the training, whose experiment has a field.
        folder: where ``blocks.csv`` goes.

    Attributes:
        log: the file.
    """

    def __init__(self, config: TrainConfig, folder: RunFolder) -> None:
        chosen, experiment = config.blocks, config.experiment
        assert experiment is not None
        self.log = TrainingLog(folder.path / BLOCKS)
        self._every = chosen.every
        self._evaluators = {
            name: Evaluator(ExperimentTask(condition), config.trial, chosen.trials, _SEED, config.device)
            for name, condition in in_conditions(experiment).items()
        }
        of_all = {name: find_metric(metric_name(name, config.trial.threshold)) for name in MEASURES}
        of_hands = OF_HANDS.items() if config.n_arms > 1 else ()
        self._metrics = of_all | {column: of_all[name].of(hand) for column, (name, hand) in of_hands}
        self._tested, self._last = 0, -1
        self._committed = self._tested, self._last
        self._waiting: list[str] = []

    def tensors(self) -> Tensors:
        """Return what the next tests depend on, as it was last committed."""
        return {"tested": torch.tensor(self._committed[0]), "last": torch.tensor(self._committed[1])}

    def restore(self, tensors: Tensors) -> None:
        """Go on from :meth:`tensors`. Raises ValueError for what is no such state."""
        fill("blocks", present := self.tensors(), tensors)
        self._tested, self._last = self._committed = int(present["tested"]), int(present["last"])

    def begin(self, done: int) -> None:
        """Start counting what is learned, of which there is ``done`` already."""
        self._schedule = Schedule(self._every, done, at_once=not self._tested)

    def is_due(self, done: int) -> bool:
        """Whether a block is over, with ``done`` learned."""
        return self._schedule.is_due(done)

    def is_tested(self, done: int) -> bool:
        """Whether the last test was that of ``done``."""
        return self._last == done

    def test(self, policies: Iterable[tuple[int, MotorPolicy]], done: int) -> None:
        """Test ``policies``, each with its seed, after ``done`` of learning; one that diverges is left out."""
        for seed, policy in policies:
            try:
                records = {name: evaluator.run(policy) for name, evaluator in self._evaluators.items()}
            except NotFiniteError:  # which the training itself tells
                continue
            for name, record in records.items():
                measures = (f"{metric.value(record):.6g}" for metric in self._metrics.values())
                self._waiting.append(",".join([str(seed), str(self._tested), str(done), name, *measures]) + "\n")
        self._tested, self._last = self._tested + 1, done

    def commit(self) -> None:
        """Write what was measured since the last time."""
        if self._waiting:
            header = [*COLUMNS, *(name for name in self._metrics if name not in COLUMNS)]
            self.log.append("".join(self._waiting), ",".join(header) + "\n")
            self._waiting.clear()
        self._committed = self._tested, self._last


def blocks_of_run(config: TrainConfig, folder: RunFolder) -> Blocks | None:
    """Build what a run's configuration asks for; None if it asks for no blocks."""
    return Blocks(config, folder) if config.blocks.every else None


class BlocksCallback(BaseCallback):
    """Tests a policy of stable-baselines3 between two iterations, whenever a block is over, and at the end.

    Args:
        blocks: does it.
        seed: of the policy.
    """

    def __init__(self, blocks: Blocks, seed: int) -> None:
        super().__init__()
        self._blocks, self._seed = blocks, seed

    def _on_training_start(self) -> None:
        self._blocks.begin(self.num_timesteps)

    def _on_rollout_start(self) -> None:
        if self._blocks.is_due(self.num_timesteps):
            self._test()

    def _on_step(self) -> bool:
        return True

    def _on_training_end(self) -> None:
        if not self._blocks.is_tested(self.num_timesteps):
            self._test()

    def _test(self) -> None:
        assert isinstance(self.model.policy, MotorPolicy)
        self._blocks.test([(self._seed, self.model.policy)], self.num_timesteps)
        self._blocks.commit()
