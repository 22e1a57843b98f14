"""Training of stacked networks: epochs of updates, validation, and an end for each seed by itself."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.losses import StreamLosses
from bilateral_rl.bptt.optimizer import StackedAdam
from bilateral_rl.bptt.rollout import Rollout
from bilateral_rl.bptt.rollout_arrays import RolloutSize, TrialTensors
from bilateral_rl.bptt.state import SeedState, TrainingState
from bilateral_rl.bptt.trials import epoch_order, training_trials, validation_trials
from bilateral_rl.bptt.workers import Workers
from bilateral_rl.config.catalogue import find_model
from bilateral_rl.config.schema import BPTTConfig
from bilateral_rl.envs.measures import trial_measures
from bilateral_rl.envs.tasks import make_task
from bilateral_rl.vocabulary import stream_names

MEASURES = ("goal_completion_percent", "time_in_goal_steps", "final_error_cm")
"""Of the validation trials, as evaluations call them."""


@dataclass
class _Stack:
    """The seeds that train at present, by their index among all, and what trains them."""

    seeds: list[int]
    rollout: Rollout
    losses: StreamLosses
    optimizer: StackedAdam


@dataclass
class _Updates:
    """What the updates of an epoch brought, for each seed of the stack."""

    means: Tensor
    """(S, …): losses and gradient norms."""
    failed: dict[int, int]
    """The batch, from 1, of each seed that failed."""
    good: Tensor
    """(S, width): the last weights whose loss was a number."""


class Trainer:
    """Trains every seed of ``config`` side by side, and writes what it does into ``state``.

    Args:
        config: of the training.
        layout: of its networks.
        state: from where to go on; changed at the end of every epoch.

    Attributes:
        columns: what the history of a seed holds, an epoch a row: the mean loss of each stream and gradient norm of
            each group over the epoch's updates, then loss and measures on the validation trials.
    """

    def __init__(self, config: BPTTConfig, layout: Layout, state: TrainingState) -> None:
        self.config, self.layout, self.state = config, layout, state
        self._loss = find_model(config.model).loss
        self.columns = history_columns(config, layout)
        task, settings = make_task(config.task), config.bptt
        seeds = [config.seed + i for i in range(config.seeds)]
        device = config.device
        self._training = _stacked([training_trials(s, settings.trials, task, config.trial) for s in seeds], device)
        self._validation = _stacked(
            [validation_trials(s, settings.validation_trials, task, config.trial) for s in seeds], device
        )
        torch.set_num_threads(1)
        self._workers = Workers(config.threads if config.device == "cpu" else 1)
        self._stack: _Stack | None = None

    @property
    def updates_per_epoch(self) -> int:
        """Updates of every seed in an epoch."""
        return self.config.bptt.trials // self.config.bptt.batch_size

    @property
    def finished(self) -> bool:
        """Whether no seed has anything left to do."""
        return self.state.epoch >= self.config.epochs or not self.state.training()

    def run_epoch(self, goes_on: Callable[[int], bool] = lambda _: True) -> bool:
        """One epoch of every seed that still trains.

        Args:
            goes_on: asked after each update, with how many there were in this epoch.

        Returns:
            Whether the epoch was finished; if not, the state is that of the epoch before.
        """
        stack = self._stack or self._make_stack()
        self._stack = None
        updates = self._update(stack, goes_on)
        if updates is None:
            return False
        self._finish_epoch(stack, updates)
        if self.state.training() == stack.seeds:  # those that stopped cost no more work
            self._stack = stack
        return True

    def close(self) -> None:
        """Let the threads go."""
        self._workers.close()

    def _make_stack(self) -> _Stack:
        config, state, seeds = self.config, self.state, self.state.training()
        losses = StreamLosses(self._loss, config.penalty, config.penalty_coefficient, self.layout, config.trial.arm)
        rollout = self._rollout(len(seeds), config.bptt.batch_size, losses)
        settings = config.bptt
        optimizer = StackedAdam(
            rollout,
            losses,
            self._loss,
            learning_rate=settings.learning_rate,
            epsilon=settings.epsilon,
            clip_norm=settings.clip_norm,
            step=int(state.updates),
        )
        for own, stored in (
            (rollout.weights, state.weights),
            (optimizer.first, state.first),
            (optimizer.second, state.second),
        ):
            own.copy_(stored[seeds])
        return _Stack(seeds, rollout, losses, optimizer)

    def _rollout(self, n_networks: int, n_trials: int, losses: StreamLosses | None = None) -> Rollout:
        size = RolloutSize(n_networks, n_trials, self.config.trial.trial_length)
        if losses:
            size = dataclasses.replace(
                size,
                n_streams=losses.n_streams,
                watches_state=losses.watches_state,
                watches_activity=losses.watches_activity,
            )
        return Rollout(self.layout, self.config.trial.arm, size, device=self.config.device, workers=self._workers)

    def _update(self, stack: _Stack, goes_on: Callable[[int], bool]) -> _Updates | None:
        """Every update of an epoch; None if it was not to go on."""
        shuffled = self._shuffled(stack.seeds)
        weights, size = stack.rollout.weights, self.config.bptt.batch_size
        total = torch.zeros(len(stack.seeds), stack.losses.n_streams + len(self._groups()), dtype=torch.float64)
        failed: dict[int, int] = {}
        good = weights.clone()
        for batch in range(self.updates_per_epoch):
            for own, trials in zip(stack.rollout.trials, shuffled, strict=True):
                own.copy_(trials[:, batch * size : (batch + 1) * size])
            stack.rollout.forward()
            values = stack.losses.values(stack.rollout)
            has_loss = values.isfinite().all(0)
            good[has_loss] = weights[has_loss]
            moves = has_loss & stack.optimizer.gradient()
            moves[list(failed)] = False
            stack.optimizer.step(None if moves.all() else moves)
            moves &= weights.isfinite().all(1)
            for index in (~moves).nonzero().flatten().tolist():
                if index not in failed:
                    failed[index] = batch + 1
                    weights[index] = good[index]
            if len(failed) == len(stack.seeds):
                break
            total += torch.cat([values.t().cpu(), self._group_norms(stack.optimizer.norms)], dim=1)
            if not goes_on(batch + 1):
                return None
        return _Updates(total / self.updates_per_epoch, failed, good.cpu())

    def _shuffled(self, seeds: list[int]) -> TrialTensors:
        """The epoch's trials in their order, (len(seeds), trials, 2) each."""
        n = self.config.bptt.trials
        orders = [epoch_order(self.config.seed + i, self.state.epoch, n) for i in seeds]
        order = torch.from_numpy(np.stack(orders)).to(self.config.device)[..., None].expand(-1, -1, 2)
        return TrialTensors(*(trials[seeds].gather(1, order) for trials in self._training))

    def _groups(self) -> list[str]:
        return list(dict.fromkeys(v.group for v in self.layout.variables))

    def _group_norms(self, norms: Tensor) -> Tensor:
        """(S, groups) float64: the gradient norm of each group, from that of each variable."""
        squares = norms.cpu().double().square()
        groups = [[i for i, v in enumerate(self.layout.variables) if v.group == group] for group in self._groups()]
        return torch.stack([squares[:, members].sum(1).sqrt() for members in groups], dim=1)

    def _finish_epoch(self, stack: _Stack, updates: _Updates) -> None:
        """Take over weights, validate, and decide which seeds go on."""
        state, seeds, failed = self.state, stack.seeds, updates.failed
        for own, stored in (
            (stack.rollout.weights, state.weights),
            (stack.optimizer.first, state.first),
            (stack.optimizer.second, state.second),
        ):
            stored[seeds] = own.cpu()
        state.updates += self.updates_per_epoch
        validation = self._validate(seeds)
        row = torch.full((len(state.weights), 1, len(self.columns)), torch.nan, dtype=torch.float64)
        for index, seed in enumerate(seeds):
            if index not in failed and not validation[index, 0].isfinite():
                failed[index] = self.updates_per_epoch
                state.weights[seed] = updates.good[index]
            if index in failed:
                state.seed_state[seed], state.failed_batch[seed] = SeedState.FAILED, failed[index]
                continue
            row[seed, 0] = torch.cat([updates.means[index], validation[index]])
            state.epochs[seed] += 1
            self._watch(seed, float(validation[index, 0]))
        state.history = torch.cat([state.history, row], dim=1)

    def _watch(self, seed: int, loss: float) -> None:
        """Early stopping of one seed, as Keras does it."""
        state = self.state
        if loss < float(state.best_loss[seed]):
            state.best_loss[seed], state.waited[seed] = loss, 0
            state.best_weights[seed] = state.weights[seed]
            return
        state.waited[seed] += 1
        if int(state.waited[seed]) >= self.config.bptt.patience:
            state.seed_state[seed] = SeedState.CONVERGED

    def _validate(self, seeds: list[int]) -> Tensor:
        """(len(seeds), 1 + measures) float64: loss and measures on the validation trials."""
        config = self.config
        loss = "combined" if self._loss == "specialized" else self._loss
        losses = StreamLosses(loss, config.penalty, config.penalty_coefficient, self.layout, config.trial.arm)
        rollout = self._rollout(len(seeds), config.bptt.validation_trials)
        rollout.weights.copy_(self.state.weights[seeds])
        for own, trials in zip(rollout.trials, self._validation, strict=True):
            own.copy_(trials[seeds])
        rollout.forward()
        values = losses.values(rollout)[0].cpu()
        distance = (rollout.hand - rollout.trials.target[:, :, None]).norm(dim=-1).cpu().numpy()
        rows = []
        for value, of_seed in zip(values.tolist(), distance, strict=True):
            measures = trial_measures(of_seed, of_seed[:, 0], config.trial.threshold)
            completed, inside = measures.goal_completion.mean(), measures.time_in_goal.mean()
            rows.append([value, 100 * completed, inside, 100 * measures.final_error.mean()])
        return torch.tensor(rows, dtype=torch.float64)


def history_columns(config: BPTTConfig, layout: Layout) -> list[str]:
    """What the history of a seed holds; see :class:`Trainer`."""
    streams = stream_names(find_model(config.model).loss)
    groups = dict.fromkeys(v.group for v in layout.variables)
    return [
        *(f"loss_{name}" for name in streams),
        *(f"gradient_norm_{group}" for group in groups),
        "validation_loss",
        *MEASURES,
    ]


def _stacked(trials: list[TrialTensors], device: str) -> TrialTensors:
    return TrialTensors(*(torch.stack(parts).to(device) for parts in zip(*trials, strict=True)))
