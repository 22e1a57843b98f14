"""The epoch after a lesion: the output layer adapts to it, everything else is frozen (paper section 6)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import torch
from torch import Tensor

from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.losses import StreamLosses
from bilateral_rl.bptt.optimizer import StackedAdam
from bilateral_rl.bptt.rollout import Rollout
from bilateral_rl.bptt.rollout_arrays import RolloutSize, TrialTensors
from bilateral_rl.bptt.trials import retraining_trials
from bilateral_rl.bptt.workers import Workers
from bilateral_rl.config.schema import SupervisedConfig
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.envs.tasks import make_task
from bilateral_rl.io.threads import one_torch_thread
from bilateral_rl.policies.lesions import Lesion
from bilateral_rl.vocabulary import Penalty

TRAINED = ("output.weight", "output.bias")
"""The variables of the output layer."""


class Retraining:
    """Trains output layers on the combined loss for one epoch, with a fresh optimizer.

    Every network is trained as if it were alone, on trials of its seed's own that it has not been trained on.

    Args:
        layout: of the networks.
        task: that they do.
        trial: how its trials run.
        settings: learning rate, batch and number of trials.
        penalty: kind of the weight penalty in the combined loss.
        coefficient: of the penalty.
        threads: CPU threads; 0 for as many as there are.
    """

    def __init__(
        self,
        layout: Layout,
        task: str,
        trial: TrialSettings,
        settings: SupervisedConfig,
        penalty: Penalty,
        coefficient: float,
        threads: int = 0,
    ) -> None:
        self._layout, self._task, self._trial, self._settings = layout, task, trial, settings
        self._losses = StreamLosses("combined", penalty, coefficient, layout, trial.arm)
        self._threads = threads

    @property
    def updates(self) -> int:
        """Of one epoch."""
        return self._settings.trials // self._settings.batch_size

    def run(
        self, weights: Tensor, seeds: Sequence[int], lesion: Lesion, on_update: Callable[[int], None] = lambda _: None
    ) -> Tensor:
        """(S, width): what the networks ``weights`` (S, width) of ``seeds`` become under ``lesion``.

        A network whose loss is no longer a number ends as one whose output layer is not a number either.
        """
        workers = Workers(self._threads)
        try:
            with one_torch_thread():
                return self._train(self._rollout(len(seeds), workers), weights, seeds, lesion, on_update)
        finally:
            workers.close()

    def _train(
        self,
        rollout: Rollout,
        weights: Tensor,
        seeds: Sequence[int],
        lesion: Lesion,
        on_update: Callable[[int], None],
    ) -> Tensor:
        settings, size = self._settings, self._settings.batch_size
        rollout.weights.copy_(weights)
        rollout.set_lesions([lesion] * len(seeds))
        optimizer = StackedAdam(
            rollout,
            self._losses,
            "combined",
            settings.learning_rate,
            settings.epsilon,
            settings.clip_norm,
            trained=TRAINED,
        )
        trials = self._trials(seeds)
        for batch in range(self.updates):
            for own, drawn in zip(rollout.trials, trials, strict=True):
                own.copy_(drawn[:, batch * size : (batch + 1) * size])
            rollout.forward()
            optimizer.gradient()
            optimizer.step()
            on_update(batch + 1)
        return rollout.weights.clone()

    def _rollout(self, n_networks: int, workers: Workers) -> Rollout:
        losses = self._losses
        size = RolloutSize(
            n_networks,
            self._settings.batch_size,
            self._trial.trial_length,
            losses.n_streams,
            losses.watches_state,
            losses.watches_activity,
        )
        return Rollout(self._layout, self._trial.arm, size, workers=workers)

    def _trials(self, seeds: Sequence[int]) -> TrialTensors:
        task, n = make_task(self._task), self._settings.trials
        drawn = [retraining_trials(seed, n, task, self._trial) for seed in seeds]
        return TrialTensors(*(torch.stack(parts) for parts in zip(*drawn, strict=True)))
