"""One stretch of a training in its folder, whatever learns: state, checkpoints, evaluations, and a clean end."""

from __future__ import annotations

import contextlib
import shlex
import threading
import time
from collections.abc import Iterator

import torch

from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.tensors import Tensors
from bilateral_rl.runs.folder import BEST, FAILED, FINISHED, INTERRUPTED, RESUME, RUNNING, RunFolder
from bilateral_rl.training.learner import Diverged, Learner, Moment
from bilateral_rl.training.progress import UNWATCHED, Outcome, Progress, StopRequest
from bilateral_rl.training.schedule import Schedule

_EARLY = "torch_random_state"
"""Name of a tensor in what early runs of version 0.1.0 saved for resuming: weights apart, and no environment."""
_LOG_SIZES = "file."
"""Prefix, in the resume file, of the number of bytes of each log: what is behind them will be written again."""


class Session:
    """Lets a learner learn in a run folder.

    Args:
        folder: where everything is written; this process holds its lock.
        config: of the training.
        learner: what learns.
        progress: who is told.
    """

    def __init__(
        self, folder: RunFolder, config: TrainConfig, learner: Learner, progress: Progress = UNWATCHED
    ) -> None:
        self._folder, self._config, self._learner, self._progress = folder, config, learner, progress
        self._stop = StopRequest()
        self._is_saved = self._resumes = self._stop_is_told = False
        self._evaluated_at: int | None = None

    def restore(self) -> None:
        """Go on from what was saved.

        Raises:
            UserError: nothing was saved, it is damaged, or there is nothing left to do; the folder is as it was.
        """
        folder, learner = self._folder, self._learner
        if not folder.is_saved and "weights" not in folder.status():
            again = f"bilateral-rl train --config {folder.path / 'config.yaml'}"
            raise UserError(f"{folder.path} stopped before it was first saved; start anew with `{again}`.")
        tensors = folder.load_resume()
        if _EARLY in tensors:
            raise UserError(
                f"{folder.path} was trained by an early version 0.1.0, which did not save all that resuming needs; "
                f"begin a new training with its network: `bilateral-rl train --init-from {folder.path}` and the same "
                "settings."
            )
        try:
            sizes = self._log_sizes(tensors)
            learner.load({name: t for name, t in tensors.items() if not name.startswith(_LOG_SIZES)})
        except ValueError as error:
            raise UserError(f"{folder.path / RESUME} is damaged: {error}.") from None
        if learner.finished and not self._was_killed_at_its_end():
            raise UserError(f"{folder.path} {learner.why_finished()}.")
        for name, log in learner.logs.items():
            log.check(sizes[name])
        for name, log in learner.logs.items():
            log.cut(sizes[name])
        folder.write_config(self._config)
        self._resumes = self._is_saved = True

    def go(self) -> Outcome:
        """Learn until the end, or until somebody stops it.

        Raises:
            UserError: the training diverged, or did not come to its end though nobody stopped it; what was saved stays.
        """
        began = time.monotonic()
        folder, learner = self._folder, self._learner
        self._progress.on_start(learner.done)
        self._evaluation = Schedule(learner.evaluation_every, learner.done, at_once=not self._resumes)
        self._checkpoint = Schedule(learner.checkpoint_every, learner.done)
        with contextlib.closing(learner), self._stop.on_interrupt():
            learner.open(folder)
            folder.write_json("status.json", self._status(RUNNING))
            if self._resumes and (best := learner.best()):
                folder.save_weights(BEST, best)  # those in the folder may be of a later evaluation
            try:
                completed = self._learn()
                self._save(FINISHED if completed else INTERRUPTED, "end")
            except Diverged as error:
                folder.write_json("status.json", self._status(FAILED))
                raise UserError(f"{error} What was saved before is in {folder.path}.") from error
            learner.finish()
        if not completed and not self._stop.requested:
            again = f"bilateral-rl train --resume {shlex.quote(str(folder.path))}"
            raise UserError(f"{' '.join(learner.notes())} What was saved goes on with `{again}`.")
        seconds = time.monotonic() - began
        stopped_by = None if completed else self._stop.signal
        return Outcome(folder, learner.done, stopped_by, seconds, learner.policies(), learner.notes())

    def _learn(self) -> bool:
        """Learn to the end, where there is one more evaluation; False if the training was stopped before."""
        learner = self._learner
        if learner.finished:  # it was killed after its last save
            return True
        if not learner.learn(self):
            return False
        if self._evaluated_at != learner.done:
            self._evaluate()
        return True

    # --- what the learner calls ---------------------------------------------------------------------------------------

    def step(self, done: int) -> bool:
        """Pass on how far it is; whether to go on."""
        self._progress.on_step(done)
        if self._stop.requested and not self._stop_is_told:
            self._stop_is_told = True
            self._progress.on_stop()
        return not self._stop.requested

    def between(self) -> bool:
        """Evaluate, save, and stop if somebody asks for it: each when it is due."""
        done = self._learner.done
        if self._evaluation.is_due(done):
            self._evaluate()
        if self._checkpoint.is_due(done):
            self._save(RUNNING, "checkpoint")
        elif not self._is_saved:  # killed at any time, a training goes on
            self._save(RUNNING, "start")
        return not self._stop.requested

    # --- what happens in between --------------------------------------------------------------------------------------

    def _evaluate(self) -> None:
        measures, is_best = self._learner.evaluate()
        if is_best:
            self._folder.save_weights(BEST, self._learner.best())
        if measures:
            self._evaluated_at = self._learner.done
            self._progress.on_evaluation(self._learner.done, measures)

    def _save(self, run_state: str, moment: Moment) -> None:
        """Write what is only read first; then, whole and in one file, from where a killed training does the rest."""
        folder, learner = self._folder, self._learner
        state = learner.state()
        weights = learner.weights(moment)
        for name, tensors in weights.items():
            folder.save_weights(name, tensors)
        learner.write_tables(folder)
        sizes = {f"{_LOG_SIZES}{name}": torch.tensor(log.size) for name, log in learner.logs.items()}
        folder.save_resume({**state, **sizes})
        folder.write_json("status.json", self._status(run_state, next(iter(weights), None)))
        self._is_saved = True

    def _status(self, run_state: str, weights: str | None = None) -> dict[str, object]:
        weights = weights or self._folder.status().get("weights")
        status = {"state": run_state, **self._learner.status(run_state)}
        return status | ({"weights": weights} if weights else {})

    def _log_sizes(self, tensors: Tensors) -> dict[str, int]:
        """Return the bytes of each log by name. Raises ValueError if they are not those of the learner's logs."""
        stored = {name.removeprefix(_LOG_SIZES): t for name, t in tensors.items() if name.startswith(_LOG_SIZES)}
        if wrong := sorted({*stored} ^ {*self._learner.logs}):
            raise ValueError(f"it {'holds an unknown' if wrong[0] in stored else 'lacks'} {_LOG_SIZES}{wrong[0]}")
        for name, size in stored.items():
            if size.shape != () or size.dtype != torch.int64:
                raise ValueError(f"its {_LOG_SIZES}{name} is not a whole number")
        return {name: int(size) for name, size in stored.items()}

    def _was_killed_at_its_end(self) -> bool:
        """Whether it was killed between the state after the last step and the word that it is finished."""
        return self._folder.status().get("state") == RUNNING and self._config.total >= self._folder.config().total


@contextlib.contextmanager
def explaining_write_failures(folder: RunFolder) -> Iterator[None]:
    """A context in which what cannot be written raises a UserError: why, what is saved, and how to go on."""
    with _quiet_writers():
        try:
            yield
        except OSError as error:
            raise UserError(
                f"Cannot write {folder.path}: {error.strerror or error}. The training stopped. {_what_is_saved(folder)}"
            ) from error


def _what_is_saved(folder: RunFolder) -> str:
    if not folder.is_saved:
        return "Nothing was saved yet; start anew once there is room, or with another --out."
    status = folder.status()
    done = f"{status['epochs']:,} epochs" if "epochs" in status else f"{status.get('timesteps', 0):,} steps"
    return (
        f"Its state after {done} is saved; once the folder can be written, go on with "
        f"`bilateral-rl train --resume {shlex.quote(str(folder.path))}`."
    )


@contextlib.contextmanager
def _quiet_writers() -> Iterator[None]:
    """Tensorboard's thread prints no traceback where it cannot write: its next caller is told anyway."""
    before = threading.excepthook

    def hook(failure: threading.ExceptHookArgs) -> None:
        if not issubclass(failure.exc_type, OSError):
            before(failure)

    threading.excepthook = hook
    try:
        yield
    finally:
        threading.excepthook = before
