"""What follows a lesion: some of a network's weights adapt to it, everything else is frozen (paper section 6)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.analysis.results import FRESH
from bilateral_rl.bptt.conditions import Conditions
from bilateral_rl.bptt.layout import Layout, Variable
from bilateral_rl.bptt.losses import StreamLosses
from bilateral_rl.bptt.noise import draw_noise
from bilateral_rl.bptt.optimizer import StackedAdam
from bilateral_rl.bptt.reach import reached_weights
from bilateral_rl.bptt.rollout import Rollout
from bilateral_rl.bptt.trial_tensors import TrialTensors
from bilateral_rl.bptt.trials import retraining_order, retraining_trials, stacked, training_trials
from bilateral_rl.bptt.workers import Workers
from bilateral_rl.config.resolve import supervised
from bilateral_rl.config.schema import BPTTConfig, TrainConfig
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.threads import one_torch_thread
from bilateral_rl.policies.lesions import Lesion
from bilateral_rl.runs.policies import build_network
from bilateral_rl.training.moments import Moments


class Retraining:
    """Trains lesioned networks on the combined loss, as a protocol says.

    Every network is trained as if it were alone. A weight that the data loss cannot reach under the lesion stays as it
    is, bit for bit, unless the protocol has the penalty move it.

    Args:
        config: of the run that the networks are of.
        protocol: what adapts, and how.
        trials: number of trials of an epoch; None for the run's own number, or the usual one by BPTT.
        threads: number of CPU threads; 0 for as many as there are CPUs.
        device: where it is computed, "cpu" or a CUDA device.

    Attributes:
        used: the protocol with the numbers that are really used.

    Raises:
        UserError: a run that cannot be retrained so.
    """

    def __init__(
        self,
        config: TrainConfig,
        protocol: Protocol,
        trials: int | None = None,
        threads: int = 0,
        device: str = "cpu",
    ) -> None:
        _check(config, protocol)
        training = supervised(config)
        self._config, self._settings = config, training.bptt
        self._n_trials, self._threads, self._device = trials or self._settings.trials, threads, device
        if self._n_trials < self._settings.batch_size:
            batch = self._settings.batch_size
            raise UserError(f"An epoch of {self._n_trials} trials is less than one batch of {batch}.")
        self.used = protocol.resolved(training)
        self._network = build_network(config)
        self._layout = Layout(self._network)
        assert self.used.penalty is not None
        assert self.used.penalty_coefficient is not None
        penalty, coefficient, trial = self.used.penalty, self.used.penalty_coefficient, config.trial
        self._losses = StreamLosses("combined", penalty, coefficient, self._layout, trial.arm, trial.losses)

    def used_by(self, network: str) -> Protocol:
        """Return what is really done with trained or with fresh networks, which have no optimizer to continue."""
        return replace(self.used, optimizer="fresh") if network == FRESH else self.used

    @property
    def updates(self) -> int:
        """Number of updates in all epochs."""
        return self.used.epochs * (self._n_trials // self._settings.batch_size)

    def run(
        self,
        weights: Tensor,
        seeds: Sequence[int],
        lesions: Sequence[Lesion],
        moments: Moments | None = None,
        on_update: Callable[[int], None] = lambda _: None,
    ) -> Tensor:
        """Return what networks become under their lesions.

        Args:
            weights: (S, width), the networks' parameters.
            seeds: the networks' seeds, whose trials they are trained on.
            lesions: the networks' lesions.
            moments: what the optimizer goes on from; None for a fresh one.
            on_update: called after each update, with how many there were.

        Returns:
            (S, width), the retrained parameters. A network whose loss was not finite ends with an output layer that is
            not finite either.
        """
        workers = Workers(self._threads if self._device == "cpu" else 1)
        try:
            with one_torch_thread():
                rollout = self._rollout(workers, weights, lesions)
                optimizer = self._optimizer(rollout, lesions, moments)
                self._train(rollout, optimizer, seeds, on_update)
                return rollout.weights.to("cpu", copy=True)
        finally:
            workers.close()

    def _rollout(self, workers: Workers, weights: Tensor, lesions: Sequence[Lesion]) -> Rollout:
        trial, batch_size = self._config.trial, self._settings.batch_size
        size = self._losses.rollout_size(len(weights), batch_size, trial.trial_length)
        conditions = Conditions.of(self._config.make_task(), trial, self._config.network.hidden_noise)
        rollout = Rollout(*(self._layout, trial.arm, size), device=self._device, workers=workers, conditions=conditions)
        rollout.weights.copy_(weights)
        rollout.set_lesions(lesions)
        return rollout

    def _optimizer(self, rollout: Rollout, lesions: Sequence[Lesion], moments: Moments | None) -> StackedAdam:
        assert self.used.learning_rate is not None
        optimizer = StackedAdam(
            rollout,
            self._losses,
            "combined",
            self.used.learning_rate,
            self._settings.epsilon,
            self._settings.clip_norm,
            step=moments.steps if moments else 0,
            trained=[variable.name for variable in self._layout.variables if self._adapts(variable)],
            still=None if self.used.penalize_unreached else self._unreached(lesions),
        )
        if moments:
            optimizer.first.copy_(moments.first)
            optimizer.second.copy_(moments.second)
        return optimizer

    def _adapts(self, variable: Variable) -> bool:
        layers = {"output": ("output",), "combination": ("output", "combination")}
        return self.used.retrain == "everything" or variable.name.startswith(layers[self.used.retrain])

    def _unreached(self, lesions: Sequence[Lesion]) -> Tensor:
        """Return which numbers (S, width) the data loss cannot reach."""
        return self._layout.pack([reached_weights(self._network, lesion) for lesion in lesions]) == 0

    def _train(
        self, rollout: Rollout, optimizer: StackedAdam, seeds: Sequence[int], on_update: Callable[[int], None]
    ) -> None:
        drawn, per_epoch = self._trials(seeds), self.updates // self.used.epochs
        for update in range(self.updates):
            epoch, batch = divmod(update, per_epoch)
            if batch == 0:
                trials = self._shuffled(drawn, seeds, epoch)
            rollout.load(trials, first=batch * self._settings.batch_size)
            draw_noise(rollout, seeds, "retraining", epoch, batch)
            rollout.forward()
            optimizer.gradient()
            optimizer.step()
            on_update(update + 1)

    def _trials(self, seeds: Sequence[int]) -> TrialTensors:
        """Return the trials (S, n, …) that the networks are trained on."""
        task, n, trial = self._config.make_task(), self._n_trials, self._config.trial
        draw = training_trials if self.used.trials == "training" else retraining_trials
        by_seed = {seed: draw(seed, n, task, trial) for seed in dict.fromkeys(seeds)}
        return stacked([by_seed[seed] for seed in seeds], self._device)

    def _shuffled(self, trials: TrialTensors, seeds: Sequence[int], epoch: int) -> TrialTensors:
        """Return the trials in the order of an epoch."""
        orders = np.stack([retraining_order(seed, epoch, self._n_trials) for seed in seeds])
        return trials.in_order(torch.from_numpy(orders).to(self._device))


def _check(config: TrainConfig, protocol: Protocol) -> None:
    """Raise a UserError for a protocol that networks of such a run cannot follow."""
    if protocol.retrain == "combination" and config.n_arms > 1 and not config.network.trained_combination:
        raise UserError(
            "--retrain combination adapts the weights that mix the sides, which are fixed in these networks: use "
            "--retrain output."
        )
    for name, value, default in (
        ("optimizer", protocol.optimizer, "fresh"),
        ("trials", protocol.trials, "new"),
    ):
        if value != default and not isinstance(config, BPTTConfig):
            raise UserError(
                f"A run of {config.algo} was not trained by BPTT and has no {name} of such a training: use "
                f"--retrain-{name} {default}."
            )
