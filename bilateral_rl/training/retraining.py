"""The epoch after a lesion: the output layer adapts to it, everything else is frozen (paper section 6)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from torch import Tensor

from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.losses import StreamLosses
from bilateral_rl.bptt.optimizer import StackedAdam
from bilateral_rl.bptt.rollout import Rollout
from bilateral_rl.bptt.rollout_arrays import TrialTensors
from bilateral_rl.bptt.trials import retraining_trials, stacked
from bilateral_rl.bptt.workers import Workers
from bilateral_rl.config.hyperparameters import BPTTHyperparameters
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
        layout: layout of the networks' parameters.
        task: the task that they do.
        trial: how its trials run.
        settings: learning rate, batch and number of trials.
        penalty: kind of the weight penalty in the combined loss.
        coefficient: the penalty's coefficient λ.
        threads: number of CPU threads; 0 for as many as there are CPUs.
    """

    def __init__(
        self,
        layout: Layout,
        task: str,
        trial: TrialSettings,
        settings: BPTTHyperparameters,
        penalty: Penalty,
        coefficient: float,
        threads: int = 0,
    ) -> None:
        self._layout, self._task, self._trial, self._settings = layout, task, trial, settings
        self._losses = StreamLosses("combined", penalty, coefficient, layout, trial.arm)
        self._threads = threads

    @property
    def updates(self) -> int:
        """Number of updates in the epoch."""
        return self._settings.trials // self._settings.batch_size

    def run(
        self, weights: Tensor, seeds: Sequence[int], lesion: Lesion, on_update: Callable[[int], None] = lambda _: None
    ) -> Tensor:
        """Return what networks become under ``lesion``.

        Args:
            weights: (S, width), the networks' parameters.
            seeds: the networks' seeds, whose trials they are trained on.
            lesion: the lesion of all of them.
            on_update: called after each update, with how many there were.

        Returns:
            (S, width), the retrained parameters. A network whose loss was not finite ends with an output layer that is
            not finite either.
        """
        workers = Workers(self._threads)
        try:
            with one_torch_thread():
                return self._train(workers, weights, seeds, lesion, on_update)
        finally:
            workers.close()

    def _train(
        self,
        workers: Workers,
        weights: Tensor,
        seeds: Sequence[int],
        lesion: Lesion,
        on_update: Callable[[int], None],
    ) -> Tensor:
        settings, losses = self._settings, self._losses
        size = losses.rollout_size(len(seeds), settings.batch_size, self._trial.trial_length)
        rollout = Rollout(self._layout, self._trial.arm, size, workers=workers)
        rollout.weights.copy_(weights)
        rollout.set_lesions([lesion] * len(seeds))
        optimizer = StackedAdam(
            rollout,
            losses,
            "combined",
            settings.learning_rate,
            settings.epsilon,
            settings.clip_norm,
            trained=TRAINED,
        )
        trials = self._trials(seeds)
        for update in range(self.updates):
            rollout.load(trials, first=update * settings.batch_size)
            rollout.forward()
            optimizer.gradient()
            optimizer.step()
            on_update(update + 1)
        return rollout.weights.clone()

    def _trials(self, seeds: Sequence[int]) -> TrialTensors:
        """Return the trials (S, n, 2) that the networks are trained on."""
        task, n = make_task(self._task), self._settings.trials
        return stacked([retraining_trials(seed, n, task, self._trial) for seed in seeds])
