"""Training of stacked networks: epochs of updates, validation, and an end for each seed by itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from bilateral_rl.analysis.modulation import Contributions, modulation_of
from bilateral_rl.bptt.conditions import Conditions
from bilateral_rl.bptt.history import groups, history_columns, measured
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.losses import StreamLosses
from bilateral_rl.bptt.noise import draw_noise
from bilateral_rl.bptt.optimizer import StackedAdam
from bilateral_rl.bptt.rollout import Rollout
from bilateral_rl.bptt.rollout_arrays import RolloutSize
from bilateral_rl.bptt.state import SeedState, TrainingState
from bilateral_rl.bptt.trial_tensors import TrialTensors
from bilateral_rl.bptt.trials import epoch_order, stacked, training_trials, validation_trials
from bilateral_rl.bptt.workers import Workers
from bilateral_rl.config.schema import BPTTConfig
from bilateral_rl.io.threads import one_torch_thread
from bilateral_rl.vocabulary import Loss


@dataclass
class _Stack:
    """The ``S`` seeds that train at present, by their index among all, and what trains them."""

    seeds: list[int]
    rollout: Rollout
    losses: StreamLosses
    optimizer: StackedAdam


@dataclass
class _EpochResult:
    """The outcome of an epoch's updates, for each seed of the stack."""

    means: Tensor
    """(S, streams + groups) float64: mean losses and mean gradient norms."""
    failed_batch: dict[int, int]
    """The batch, from 1, in which a seed failed, by its index in the stack."""
    last_good: Tensor
    """(S, width): the last weights whose losses were finite."""


class Trainer:
    """Trains every seed of ``config`` side by side, and writes what it does into ``state``.

    Args:
        config: the training's configuration.
        layout: the layout of its networks' parameters.
        state: the state to go on from; changed at the end of every epoch.

    Attributes:
        columns: what the history of a seed holds (:func:`~bilateral_rl.bptt.history.history_columns`).
    """

    def __init__(self, config: BPTTConfig, layout: Layout, state: TrainingState) -> None:
        self.config, self.layout, self.state = config, layout, state
        self.columns = history_columns(config, layout)
        self._loss = config.spec.loss
        self._groups = groups(layout)
        task, settings = config.make_task(), config.bptt
        self._conditions = Conditions.of(task, config.trial, config.network.hidden_noise)
        self._training = stacked(
            [training_trials(seed, settings.trials, task, config.trial) for seed in config.all_seeds], config.device
        )
        self._validation = stacked(
            [validation_trials(seed, settings.validation_trials, task, config.trial) for seed in config.all_seeds],
            config.device,
        )
        self._workers = Workers(config.threads if config.device == "cpu" else 1)
        self._stack: _Stack | None = None
        self._running: _Stack | None = None

    @property
    def updates_per_epoch(self) -> int:
        """Number of updates of every seed in an epoch."""
        return self.config.updates_per_epoch

    @property
    def finished(self) -> bool:
        """Whether no seed has anything left to do."""
        return self.state.epoch >= self.config.epochs or not self.state.training()

    def run_epoch(self, goes_on: Callable[[int], bool] = lambda _: True) -> bool:
        """Train every seed that still trains for one epoch, validate it, and decide whether it goes on.

        Args:
            goes_on: asked after each update, with how many there were in this epoch.

        Returns:
            Whether the epoch was finished; if not, the state is that of the epoch before.
        """
        with one_torch_thread():
            stack = self._stack or self._make_stack()
            self._stack, self._running = None, stack
            result = self._update(stack, goes_on)
            self._running = None
            if result is None:
                return False
            self._take_over(stack)
            validation = self._validate(stack.seeds)
            self._conclude_epoch(stack.seeds, result, validation)
        if self.state.training() == stack.seeds:
            self._stack = stack  # else the next epoch makes a smaller one: seeds that stopped cost no more work
        return True

    @property
    def weights(self) -> Tensor:
        """(S, width): the present parameters of every seed, also between two updates of an epoch."""
        weights = self.state.weights.clone()
        if self._running is not None:
            weights[self._running.seeds] = self._running.rollout.weights.cpu()
        return weights

    def close(self) -> None:
        """Let the threads go."""
        self._workers.close()

    def _make_stack(self) -> _Stack:
        config, settings, state, seeds = self.config, self.config.bptt, self.state, self.state.training()
        losses = self._losses(self._loss)
        rollout = self._rollout(losses.rollout_size(len(seeds), settings.batch_size, config.trial.trial_length))
        optimizer = StackedAdam(
            rollout,
            losses,
            self._loss,
            learning_rate=settings.learning_rate,
            epsilon=settings.epsilon,
            clip_norm=settings.clip_norm,
            step=int(state.updates),
            trained=[variable.name for variable in self.layout.variables if variable.group not in config.frozen],
        )
        rollout.weights.copy_(state.weights[seeds])
        optimizer.first.copy_(state.first[seeds])
        optimizer.second.copy_(state.second[seeds])
        return _Stack(seeds, rollout, losses, optimizer)

    def _losses(self, loss: Loss) -> StreamLosses:
        config = self.config
        penalty, coefficient, trial = config.penalty, config.penalty_coefficient, config.trial
        return StreamLosses(loss, penalty, coefficient, self.layout, trial.arm, trial.losses)

    def _rollout(self, size: RolloutSize) -> Rollout:
        config = self.config
        return Rollout(
            *(self.layout, config.trial.arm, size),
            device=config.device,
            workers=self._workers,
            conditions=self._conditions,
        )

    def _update(self, stack: _Stack, goes_on: Callable[[int], bool]) -> _EpochResult | None:
        """Do every update of an epoch; return None if it was not to go on.

        A seed fails in the update in which its losses, its gradient or its new weights are not finite. It gets back the
        last weights whose losses were finite and moves no more; the others do not notice, as no number crosses seeds.
        """
        rollout, losses, optimizer = stack.rollout, stack.losses, stack.optimizer
        weights = rollout.weights  # (S, width), moved in place
        shuffled, seeds = self._shuffled(stack.seeds), self._numbers(stack.seeds)
        sums = torch.zeros(len(stack.seeds), losses.n_streams + len(self._groups), dtype=torch.float64)
        failed_batch: dict[int, int] = {}
        last_good = weights.clone()
        for batch in range(self.updates_per_epoch):
            rollout.load(shuffled, first=batch * self.config.bptt.batch_size)
            draw_noise(rollout, seeds, "training", self.state.epoch, batch)
            rollout.forward()
            values = losses.values(rollout)  # (streams, S)
            finite_loss = values.isfinite().all(0)  # (S,)
            last_good[finite_loss] = weights[finite_loss]

            optimizer.learning_rate = self._learning_rate(batch)
            moving = finite_loss & optimizer.gradient()
            moving[list(failed_batch)] = False
            optimizer.step(None if moving.all() else moving)

            sound = moving & weights.isfinite().all(1)
            for index in (~sound).nonzero().flatten().tolist():
                if index not in failed_batch:
                    failed_batch[index] = batch + 1
                    weights[index] = last_good[index]
            if len(failed_batch) == len(stack.seeds):
                break
            sums += torch.cat([values.t().cpu(), self._group_norms(optimizer.norms)], dim=1)
            if not goes_on(batch + 1):
                return None
        return _EpochResult(sums / self.updates_per_epoch, failed_batch, last_good.cpu())

    def _learning_rate(self, batch: int) -> float:
        """Return the learning rate of a batch of the present epoch."""
        first, last = self.config.bptt.learning_rate, self.config.bptt.final_learning_rate
        if last is None:
            return first
        done = (self.state.epoch * self.updates_per_epoch + batch) / self.config.total
        return first + (last - first) * done

    def _numbers(self, seeds: list[int]) -> list[int]:
        """Return the seeds themselves, from their index among all."""
        return [self.config.all_seeds[index] for index in seeds]

    def _shuffled(self, seeds: list[int]) -> TrialTensors:
        """Return the epoch's trials in their order, (len(seeds), trials, …) each."""
        n = self.config.bptt.trials
        orders = [epoch_order(self.config.seed + i, self.state.epoch, n) for i in seeds]
        order = torch.from_numpy(np.stack(orders)).to(self.config.device)
        return self._training.map(lambda tensor: tensor[seeds]).in_order(order)

    def _group_norms(self, norms: Tensor) -> Tensor:
        """Return the gradient norm of each group (S, groups) float64, from that of each variable (S, variables)."""
        squares = norms.cpu().double().square()
        groups = [[i for i, v in enumerate(self.layout.variables) if v.group == group] for group in self._groups]
        return torch.stack([squares[:, members].sum(1).sqrt() for members in groups], dim=1)

    def _take_over(self, stack: _Stack) -> None:
        """Write the stack's weights and moments into the state."""
        self.state.weights[stack.seeds] = stack.rollout.weights.cpu()
        self.state.first[stack.seeds] = stack.optimizer.first.cpu()
        self.state.second[stack.seeds] = stack.optimizer.second.cpu()
        self.state.updates += self.updates_per_epoch

    def _validate(self, seeds: list[int]) -> Tensor:
        """Return what the history holds of the validation trials, (len(seeds), columns) float64."""
        config = self.config
        loss = "combined" if self._loss == "specialized" else self._loss
        losses = self._losses(loss)
        rollout = self._rollout(RolloutSize(len(seeds), config.bptt.validation_trials, config.trial.trial_length))
        rollout.weights.copy_(self.state.weights[seeds])
        rollout.load(self._validation.map(lambda tensor: tensor[seeds]))
        draw_noise(rollout, self._numbers(seeds), "validation")
        rollout.forward()
        values = losses.values(rollout)[0].tolist()
        targets = rollout.targets()
        rows = [[value, *measured(targets, i, config), *self._supplied(rollout, i)] for i, value in enumerate(values)]
        return torch.tensor(rows, dtype=torch.float64)

    def _supplied(self, rollout: Rollout, index: int) -> list[float]:
        """Return the numbers of what each side of a network supplied in the rollout's trials, if it has sides."""
        if self.layout.shape.sides == 1:
            return []
        added = Contributions(*(side.cpu().numpy() for side in rollout.contributions(index)))
        with np.errstate(over="ignore", invalid="ignore"):  # a network may have failed
            return list(modulation_of(added, self.layout.shape.arms).measures().values())

    def _conclude_epoch(self, seeds: list[int], result: _EpochResult, validation: Tensor) -> None:
        """Write the epoch into the history, and settle which seeds failed or converged in it."""
        state = self.state
        row = torch.full((len(state.weights), 1, len(self.columns)), torch.nan, dtype=torch.float64)
        for index, seed in enumerate(seeds):
            failed_batch = result.failed_batch.get(index)
            if failed_batch is None and not validation[index, 0].isfinite():
                failed_batch = self.updates_per_epoch
                state.weights[seed] = result.last_good[index]
            if failed_batch is not None:
                state.seed_state[seed], state.failed_batch[seed] = SeedState.FAILED, failed_batch
                continue
            row[seed, 0] = torch.cat([result.means[index], validation[index]])
            state.epochs[seed] += 1
            self._stop_early(seed, float(validation[index, 0]))
        state.history = torch.cat([state.history, row], dim=1)

    def _stop_early(self, seed: int, loss: float) -> None:
        """End a seed whose validation loss has not got better for ``patience`` epochs, as Keras does."""
        state = self.state
        if loss < float(state.best_loss[seed]):
            state.best_loss[seed], state.waited[seed] = loss, 0
            state.best_weights[seed] = state.weights[seed]
            return
        state.waited[seed] += 1
        if int(state.waited[seed]) >= self.config.bptt.patience:
            state.seed_state[seed] = SeedState.CONVERGED
