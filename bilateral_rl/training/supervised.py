"""Supervised learning of one network or of several at once, by back-propagation through time."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from typing import Any

import torch
from matplotlib.figure import Figure
from torch.utils.tensorboard import SummaryWriter

from bilateral_rl.analysis.modulation import TAGS, SideModulation
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.bptt.history import MEASURES, history_columns, read_state
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.state import SeedState, TrainingState
from bilateral_rl.bptt.trainer import Trainer
from bilateral_rl.config.schema import BPTTConfig, EvaluationConfig
from bilateral_rl.figures import hand_paths
from bilateral_rl.io import event_files
from bilateral_rl.io.tensors import Tensors
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.runs.folder import BEST, FINAL, FINISHED, INTERRUPTED, RunFolder
from bilateral_rl.runs.policies import build_network, build_policy, stack_states
from bilateral_rl.training.blocks import blocks_of_run
from bilateral_rl.training.fresh_networks import fresh_network
from bilateral_rl.training.learner import Diverged, Learner, Moment, Watcher
from bilateral_rl.training.silence import silence_notes
from bilateral_rl.vocabulary import SIDES, path_names

_BLOCKS = "blocks."
"""Prefix, in the state, of the blocks' part."""
FIGURE_TRIALS = 12
"""Number of hand paths drawn at the end, for each seed."""
_FIGURE_REACHES = 64
"""The same where all reach for a few targets, each of which is to come several times."""


class SupervisedLearner(Learner):
    """Learns by the gradient of the losses through network and arm; a stretch is an epoch.

    It may be stopped within an epoch too, and goes on from the last whole one.

    Args:
        config: of the training.
        folder: where logs go.
        initial: ``state_dict()`` of the network that each seed begins with; None for fresh ones.
    """

    def __init__(self, config: BPTTConfig, folder: RunFolder, initial: dict[int, Tensors] | None = None) -> None:
        self._config = config
        self._seeds = config.all_seeds
        self.evaluation_every = self.checkpoint_every = config.updates_per_epoch
        self._layout = Layout(build_network(config))
        self._columns = history_columns(config, self._layout)
        networks = initial or {seed: fresh_network(config, seed) for seed in self._seeds}
        self._state = TrainingState.start(self._layout.pack(list(networks.values())), len(self._columns))
        self._blocks = blocks_of_run(config, folder)
        self.logs = {self._blocks.log.path.name: self._blocks.log} if self._blocks else {}
        self._resources = contextlib.ExitStack()

    @property
    def done(self) -> int:
        return self._state.epoch * self._config.updates_per_epoch

    @property
    def finished(self) -> bool:
        return self._state.epoch >= self._config.epochs or not self._state.training()

    def why_finished(self) -> str:
        if not self._state.training():
            return "is complete: every seed has stopped by itself, or failed"
        return f"has done its {self._state.epoch} epochs; give a larger --epochs to train it further"

    def state(self) -> Tensors:
        of_blocks = {f"{_BLOCKS}{name}": t for name, t in self._blocks.tensors().items()} if self._blocks else {}
        return self._state.tensors() | of_blocks

    def load(self, state: Tensors) -> None:
        if self._blocks:
            of_blocks = {name: t for name, t in state.items() if name.startswith(_BLOCKS)}
            self._blocks.restore({name.removeprefix(_BLOCKS): t for name, t in of_blocks.items()})
            state = {name: t for name, t in state.items() if name not in of_blocks}
        self._state = read_state(state, self._config, self._layout)

    def status(self, run_state: str) -> dict[str, Any]:
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
        return {"epochs": state.epoch, "updates": int(state.updates), "seeds": seeds}

    def weights(self, moment: Moment) -> dict[str, Tensors]:
        return {FINAL: stack_states(self._networks(self._state.weights)), BEST: self.best()}

    def best(self) -> Tensors:
        return stack_states(self._networks(self._state.best_weights))

    def write_tables(self, folder: RunFolder) -> None:
        """Write ``epochs.csv``, a row a seed and epoch."""
        lines = [",".join(["seed", "epoch", *self._columns])]
        for i, seed in enumerate(self._seeds):
            for epoch, row in enumerate(self._state.history[i, : int(self._state.epochs[i])].tolist(), start=1):
                lines.append(",".join([str(seed), str(epoch), *(f"{value:.9g}" for value in row)]))
        folder.write_text("epochs.csv", "\n".join(lines) + "\n")

    def open(self, folder: RunFolder) -> None:
        """Open tensorboard's files, cut back to the present epoch."""
        self._board = _Tensorboard(folder, self._seeds, self._state.epoch)
        self._resources.callback(self._board.close)

    def close(self) -> None:
        self._resources.close()

    def learn(self, watcher: Watcher) -> bool:
        trainer = Trainer(self._config, self._layout, self._state)
        blocks = self._blocks

        def goes_on(updates: int) -> bool:
            done = self.done + updates
            if blocks and blocks.is_due(done):
                blocks.test(self._policies(trainer.weights, trainer.state.training()), done)
            return watcher.step(done)

        with contextlib.closing(trainer):
            if blocks:
                blocks.begin(self.done)
                if blocks.is_due(self.done):
                    blocks.test(self._policies(self._state.weights, self._state.training()), self.done)
                    blocks.commit()
            while watcher.between() and not trainer.finished:
                if not trainer.run_epoch(goes_on):
                    break
                if blocks:
                    if trainer.finished and not blocks.is_tested(self.done):
                        blocks.test(self._policies(self._state.weights, self._newest()), self.done)
                    blocks.commit()
        if bool((self._state.seed_state == SeedState.FAILED).all()):
            raise Diverged(" ".join([*self._failures(), "Try a smaller bptt.learning_rate."]))
        return trainer.finished

    def evaluate(self) -> tuple[dict[str, float], bool]:
        """Log the epoch that has just ended, which included its validation; nothing before the first one."""
        state = self._state
        if not state.epoch:
            return {}, False
        last = state.history[:, -1]
        combination = self._combination()
        for i, seed in enumerate(self._seeds):
            if not last[i].isnan().all():
                values = dict(zip(self._columns, last[i].tolist(), strict=True))
                if self._config.n_arms == 1 or self._config.network.trained_combination:  # what is fixed is no news
                    values |= {f"combination_{path}": weight for path, weight in combination[i].items()}
                self._board.write(seed, state.epoch, values)
        means = dict(zip(self._columns, self._latest().nanmean(0).tolist(), strict=True))
        # The state itself keeps each seed's best weights.
        return means | {"epoch": state.epoch, "seeds_training": len(state.training())}, False

    def finish(self) -> None:
        """Draw hand paths of what each seed does now."""
        trial = self._config.trial
        evaluator = Evaluator(self._config.make_task(), trial, _FIGURE_REACHES, EvaluationConfig().seed)
        for seed, policy in self.policies().items():
            figure = hand_paths(evaluator.run(policy), trial.threshold, sum(trial.arm.link_length), FIGURE_TRIALS)
            self._board.draw(seed, self._state.epoch, figure)

    def notes(self) -> list[str]:
        return self._failures() + (self._silence() if self.finished and self._state.epoch else [])

    def _failures(self) -> list[str]:
        """Return a sentence for each seed that failed."""
        state = self._state
        return [
            f"Seed {seed} failed: its loss was no longer a number in epoch {int(state.epochs[i]) + 1}, batch "
            f"{int(state.failed_batch[i])}; its weights from before are kept."
            for i, seed in enumerate(self._seeds)
            if int(state.seed_state[i]) == SeedState.FAILED
        ]

    def policies(self) -> dict[int, MotorPolicy]:
        return dict(self._policies(self._state.weights))

    def _policies(self, rows: torch.Tensor, which: Sequence[int] | None = None) -> Iterator[tuple[int, MotorPolicy]]:
        """Yield each seed with its policy, from rows of parameters (S, width); of all seeds, or of those indices."""
        networks = self._networks(rows)
        for i, (seed, network) in enumerate(networks.items()):
            if which is None or i in which:
                policy = build_policy(self._config)
                policy.motor_network.load_state_dict(network)
                policy.set_training_mode(False)
                yield seed, policy

    def _silence(self) -> list[str]:
        """Return a sentence for each side of each seed that is silent."""
        if self._layout.shape.sides == 1:
            return []
        sentences = []
        for seed, weights, row in zip(self._seeds, self._combination(), self._latest().tolist(), strict=True):
            modulation = SideModulation.from_measures(dict(zip(self._columns, row, strict=True)))
            notes = silence_notes(modulation, weights, self._config)
            sentences += [f"Seed {seed}: {note}" if len(self._seeds) > 1 else note for note in notes]
        return sentences

    def _combination(self) -> list[dict[str, float]]:
        """Return the combination weights of each seed, as ``MotorNetwork.combination_weights`` names them."""
        n_arms, seeds = self._layout.shape.arms, len(self._seeds)
        if self._layout.shape.sides == 1:
            return [{} for _ in range(seeds)]
        weights = self._layout.region(self._state.weights, "combination").reshape(seeds, len(SIDES), n_arms).tolist()
        paths = path_names(n_arms).items()
        return [{path: of_seed[SIDES.index(side)][arm] for path, (arm, side) in paths} for of_seed in weights]

    def _newest(self) -> list[int]:
        """Return the indices of the seeds that were in the last epoch."""
        return (self._state.epochs == self._state.epoch).nonzero().flatten().tolist()

    def _latest(self) -> torch.Tensor:
        """Return what each seed's last epoch brought, even if that was long ago, (S, columns); there was one."""
        state = self._state
        return state.history[torch.arange(len(self._seeds)), (state.epochs - 1).clamp(min=0)]

    def _networks(self, rows: torch.Tensor) -> dict[int, Tensors]:
        """Return the ``state_dict()`` of each seed's network from rows of parameters, (S, width)."""
        stacked = self._layout.unpack(rows)
        return {seed: {name: t[i] for name, t in stacked.items()} for i, seed in enumerate(self._seeds)}


def _seed_state(state: SeedState, run_state: str) -> str:
    """Return a seed's state in words."""
    if state == SeedState.TRAINING:
        return {FINISHED: "all epochs done", INTERRUPTED: "interrupted"}.get(run_state, "training")
    return state.name.lower()


class _Tensorboard:
    """Shows every seed as a run of its own, ``seed_<n>``, so that its curves lie over the others'."""

    _HEADINGS = ("loss", "gradient_norm", "combination")

    def __init__(self, folder: RunFolder, seeds: list[int], epoch: int) -> None:
        self._writers = {}
        for seed in seeds:
            event_files.cut_back(folder.path / f"seed_{seed}", epoch)
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
        if name.startswith(MEASURES):
            return f"evaluation/{name}"
        if name in TAGS:
            return TAGS[name]
        for heading in self._HEADINGS:
            if name.startswith(f"{heading}_"):
                return f"{heading}/{name.removeprefix(f'{heading}_')}"
        return f"loss/{name}"
