"""Supervised training runs from start or resume to their end: folder, checkpoints, tensorboard."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path
from typing import Any

import torch
from matplotlib.figure import Figure
from torch.utils.tensorboard import SummaryWriter

from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.state import SeedState, TrainingState
from bilateral_rl.bptt.trainer import MEASURES, Trainer, history_columns
from bilateral_rl.bptt.trials import initial_weights_seed
from bilateral_rl.config.schema import BPTTConfig, EvaluationConfig
from bilateral_rl.figures import hand_paths
from bilateral_rl.io import event_files as tensorboard_files
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.tensors import Tensors
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.runs.folder import BEST, FAILED, FINAL, FINISHED, INTERRUPTED, RUNNING, RunFolder
from bilateral_rl.runs.policies import build_network, build_policy, initial_states, stack_states
from bilateral_rl.training.session import UNWATCHED, Outcome, Progress, StopRequest, check_device
from bilateral_rl.training.write_failures import explaining_write_failures

FIGURE_TRIALS = 12
"""Drawn at the end, for each seed."""


def train(config: BPTTConfig, out: Path, progress: Progress = UNWATCHED) -> Outcome:
    """Train from scratch, or from ``config.init_from``, into a new folder below ``out``.

    Raises:
        UserError: a device or an initial network that is not there, a folder that cannot be written, or not one seed
            whose loss stayed a number.
    """
    check_device(config.device)
    states = initial_states(config) or {seed: _fresh_network(config, seed) for seed in config.all_seeds}
    layout = Layout(build_network(config))
    state = TrainingState.start(layout.pack(list(states.values())), len(history_columns(config, layout)))
    folder = RunFolder.create(out, config)
    with folder.locked(), explaining_write_failures(folder):
        return _Run(folder, config, layout, state).go(progress)


def resume(folder: RunFolder, config: BPTTConfig, progress: Progress = UNWATCHED) -> Outcome:
    """Go on from the last whole epoch; on the same machine it ends with the same bits as if it had never stopped.

    Raises:
        UserError: a damaged run, one with nothing left to do, or one that another process is at; or a folder that
            cannot be written.
    """
    check_device(config.device)
    with folder.locked(), explaining_write_failures(folder):
        return _restored(folder, config).go(progress)


def _restored(folder: RunFolder, config: BPTTConfig) -> _Run:
    if "weights" not in folder.status() and not (folder.path / "resume.safetensors").exists():
        again = f"bilateral-rl train --config {folder.path / 'config.yaml'}"
        raise UserError(f"{folder.path} stopped before it was first saved; start anew with `{again}`.")
    layout = Layout(build_network(config))
    tensors = folder.load_resume()
    try:
        state = TrainingState.from_tensors(tensors, config.seeds, layout.width, len(history_columns(config, layout)))
    except ValueError as error:
        raise UserError(f"{folder.path / 'resume.safetensors'} is damaged: {error}.") from None
    finished = folder.status().get("state") in (FINISHED, FAILED)
    if finished and not state.training():
        raise UserError(f"{folder.path} is complete: every seed has stopped by itself, or failed.")
    if state.epoch > config.epochs or (finished and state.epoch == config.epochs):
        raise UserError(f"{folder.path} has done its {state.epoch} epochs; give a larger --epochs to train it further.")
    folder.write_config(config)
    return _Run(folder, config, layout, state)


def _fresh_network(config: BPTTConfig, seed: int) -> Tensors:
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(initial_weights_seed(seed))
        return dict(build_network(config).state_dict())


class _Run:
    """One stretch of a training, in its folder."""

    def __init__(self, folder: RunFolder, config: BPTTConfig, layout: Layout, state: TrainingState) -> None:
        self._folder, self._config, self._layout, self._state = folder, config, layout, state
        self._seeds = config.all_seeds
        self._columns = history_columns(config, layout)

    def go(self, progress: Progress) -> Outcome:
        began = time.monotonic()
        stop = StopRequest()
        trainer = Trainer(self._config, self._layout, self._state)
        board = _Tensorboard(self._folder, self._seeds, self._state.epoch)
        with contextlib.closing(trainer), contextlib.closing(board):
            self._save(RUNNING)
            finished = self._train(trainer, board, progress, stop)
            all_failed = bool((self._state.seed_state == SeedState.FAILED).all())
            self._save(FAILED if all_failed else FINISHED if finished else INTERRUPTED)
            policies = self._policies()
            self._draw(board, policies)
        notes = self._notes()
        if all_failed:
            raise UserError(" ".join([*notes, "Try a smaller bptt.learning_rate."]))
        done = int(self._state.updates)
        stopped_by = None if finished else stop.signal
        return Outcome(self._folder, done, stopped_by, time.monotonic() - began, policies, notes)

    def _train(self, trainer: Trainer, board: _Tensorboard, progress: Progress, stop: StopRequest) -> bool:
        """Epoch after epoch; whether nobody stopped it before the end."""
        per_epoch = trainer.updates_per_epoch

        def goes_on(done: int) -> bool:
            progress.on_step(self._state.epoch * per_epoch + done)
            return not stop.requested

        progress.on_start(self._state.epoch * per_epoch)
        with stop.on_interrupt():  # a second Ctrl-C leaves at once: the last whole epoch is saved already
            while not trainer.finished:
                if not trainer.run_epoch(goes_on):
                    return False
                self._save(RUNNING)
                self._report(board, progress, per_epoch)
        return True

    def _save(self, run_state: str) -> None:
        """What resuming reads first, whole; then what people and other commands read."""
        state = self._state
        self._folder.save_resume(state.tensors())
        for name, rows in ((FINAL, state.weights), (BEST, state.best_weights)):
            self._folder.save_weights(name, stack_states(self._network_states(rows)))
        self._folder.write_text("epochs.csv", self._epochs_csv())
        self._folder.write_json("status.json", self._status(run_state))

    def _network_states(self, rows: torch.Tensor) -> dict[int, Tensors]:
        stacked = self._layout.unpack(rows)
        return {seed: {name: t[i] for name, t in stacked.items()} for i, seed in enumerate(self._seeds)}

    def _status(self, run_state: str) -> dict[str, Any]:
        state = self._state
        seeds = []
        for i, seed in enumerate(self._seeds):
            entry: dict[str, Any] = {
                "seed": seed,
                "state": _seed_state(SeedState(int(state.seed_state[i])), run_state),
                "epochs": int(state.epochs[i]),
            }
            if state.best_loss[i].isfinite():
                entry["best_validation_loss"] = float(state.best_loss[i])
            seeds.append(entry)
        return {
            "state": run_state,
            "epochs": state.epoch,
            "updates": int(state.updates),
            "weights": FINAL,
            "seeds": seeds,
        }

    def _epochs_csv(self) -> str:
        lines = [",".join(["seed", "epoch", *self._columns])]
        for i, seed in enumerate(self._seeds):
            for epoch, row in enumerate(self._state.history[i, : int(self._state.epochs[i])].tolist(), start=1):
                lines.append(",".join([str(seed), str(epoch), *(f"{value:.9g}" for value in row)]))
        return "\n".join(lines) + "\n"

    def _report(self, board: _Tensorboard, progress: Progress, updates_per_epoch: int) -> None:
        state = self._state
        last = state.history[:, -1]
        combination = self._layout.unpack(state.weights)
        for i, seed in enumerate(self._seeds):
            if not last[i].isnan().all():
                values = dict(zip(self._columns, last[i].tolist(), strict=True))
                values |= {name: float(t[i]) for name, t in combination.items() if name.startswith("combination_")}
                board.write(seed, state.epoch, values)
        done = state.history[torch.arange(len(self._seeds)), (state.epochs - 1).clamp(min=0)]  # each seed's last epoch
        means = dict(zip(self._columns, done.nanmean(0).tolist(), strict=True))
        means["seeds_training"] = len(state.training())
        progress.on_evaluation(state.epoch * updates_per_epoch, means)

    def _draw(self, board: _Tensorboard, policies: dict[int, MotorPolicy]) -> None:
        """Hand paths of what each seed does now."""
        trial = self._config.trial
        evaluator = Evaluator(self._config.task, trial, FIGURE_TRIALS, EvaluationConfig().seed)
        for seed, policy in policies.items():
            figure = hand_paths(evaluator.run(policy), trial.threshold, sum(trial.arm.link_length), FIGURE_TRIALS)
            board.draw(seed, self._state.epoch, figure)

    def _notes(self) -> list[str]:
        state = self._state
        return [
            f"Seed {seed} failed: its loss was no longer a number in epoch {int(state.epochs[i]) + 1}, batch "
            f"{int(state.failed_batch[i])}; its weights from before are kept."
            for i, seed in enumerate(self._seeds)
            if int(state.seed_state[i]) == SeedState.FAILED
        ]

    def _policies(self) -> dict[int, MotorPolicy]:
        policies: dict[int, MotorPolicy] = {}
        for seed, state in self._network_states(self._state.weights).items():
            policies[seed] = build_policy(self._config)
            policies[seed].motor_network.load_state_dict(state)
            policies[seed].set_training_mode(False)
        return policies


def _seed_state(state: SeedState, run_state: str) -> str:
    """A seed's state in words."""
    if state == SeedState.TRAINING:
        return {FINISHED: "all epochs done", INTERRUPTED: "interrupted"}.get(run_state, "training")
    return state.name.lower()


class _Tensorboard:
    """Every seed as a run of its own, ``seed_<n>``, so that its curves lie over the others'."""

    _HEADINGS = ("loss", "gradient_norm", "combination")

    def __init__(self, folder: RunFolder, seeds: list[int], epoch: int) -> None:
        self._writers = {}
        for seed in seeds:
            tensorboard_files.cut_back(folder.path / f"seed_{seed}", epoch)
            self._writers[seed] = SummaryWriter(str(folder.path / f"seed_{seed}"))

    def write(self, seed: int, epoch: int, values: dict[str, float]) -> None:
        for name, value in values.items():
            self._writers[seed].add_scalar(self._tag(name), value, epoch)

    def draw(self, seed: int, epoch: int, figure: Figure) -> None:
        self._writers[seed].add_figure("figures/hand_paths", figure, epoch, close=False)

    def close(self) -> None:
        for writer in self._writers.values():
            writer.close()

    def _tag(self, name: str) -> str:
        if name in MEASURES:
            return f"evaluation/{name}"
        for heading in self._HEADINGS:
            if name.startswith(f"{heading}_"):
                return f"{heading}/{name.removeprefix(f'{heading}_')}"
        return f"loss/{name}"
