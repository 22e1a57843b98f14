"""Trainings of every algorithm, from their start or resume to their end: first refused, then run.

Everything that can be refused before a folder is made or a training announced is refused by :func:`prepare` and
:func:`prepare_resume`; :func:`run` checks none of it again.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import torch

from bilateral_rl.config.bounds import check_updates
from bilateral_rl.config.schema import BPTTConfig, RLConfig, TrainConfig
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.files import removed_if_it_fails
from bilateral_rl.io.tensors import Tensors
from bilateral_rl.runs.folder import IMPORTED, RunFolder
from bilateral_rl.runs.policies import initial_states
from bilateral_rl.training.adaptation_figure import draw_adaptation
from bilateral_rl.training.learner import Learner
from bilateral_rl.training.progress import UNWATCHED, Outcome, Progress
from bilateral_rl.training.rl import RLLearner
from bilateral_rl.training.session import Session, explaining_write_failures
from bilateral_rl.training.side_by_side import SideBySideLearner
from bilateral_rl.training.supervised import SupervisedLearner
from bilateral_rl.training.tracking import check_tracking


@dataclass(frozen=True)
class Prepared:
    """A training that nothing stands against."""

    config: TrainConfig
    folder: RunFolder | None = None
    """The run to go on with; None for a new one."""
    initial: dict[int, Tensors] | None = None
    """``state_dict()`` of the network that each seed begins with; None for fresh ones."""


def prepare(config: TrainConfig) -> Prepared:
    """Refuse a new training that cannot be.

    Raises:
        UserError: a training that would update nothing, or a device, a tracking service or an initial network that is
            not there.
    """
    check_updates(config)
    _check_surroundings(config)
    return Prepared(config, initial=initial_states(config))


def prepare_resume(folder: RunFolder, config: TrainConfig) -> Prepared:
    """Refuse to go on with ``folder``'s training until the end that ``config`` sets, if that cannot be.

    Raises:
        UserError: an imported run, or a device or a tracking service that is not there.
    """
    if folder.status().get("state") == IMPORTED:
        raise UserError(
            f"{folder.path} was imported as it was, without what going on takes; begin a training with its network by "
            f"`bilateral-rl train --init-from {folder.path}`."
        )
    _check_surroundings(config)
    return Prepared(config, folder)


def run(prepared: Prepared, out: Path, progress: Progress = UNWATCHED, at_once: int | None = None) -> Outcome:
    """Train into a new folder below ``out``, or go on in the prepared one.

    Going on, everything continues: on the same machine, with the same total, it ends with the bits of a training that
    was never stopped. A larger total stretches the schedules of a reinforcement learning.

    Args:
        prepared: the training.
        out: the folder of all runs.
        progress: who is told.
        at_once: how many seeds of a reinforcement learning train at a time; None for as many as there are cores.

    Raises:
        UserError: a folder that cannot be written or that another process is at; a training that diverged; going on, a
            damaged run, one of an older version, or one that has come to its end.
    """
    config, folder = prepared.config, prepared.folder
    if folder is None:
        return _begin(RunFolder.create(out, config), prepared, progress, at_once)
    with folder.locked(), explaining_write_failures(folder):
        session = Session(folder, config, _make_learner(config, folder, at_once=at_once), progress)
        session.restore()
        return _go(session)


def _begin(folder: RunFolder, prepared: Prepared, progress: Progress, at_once: int | None = None) -> Outcome:
    config = prepared.config
    with folder.locked(), explaining_write_failures(folder):
        with removed_if_it_fails(folder.path):
            learner = _make_learner(config, folder, prepared.initial, at_once)
        return _go(Session(folder, config, learner, progress))


def _go(session: Session) -> Outcome:
    outcome = session.go()
    draw_adaptation(outcome.folder)
    return outcome


def train(config: TrainConfig, out: Path, progress: Progress = UNWATCHED, at_once: int | None = None) -> Outcome:
    """Prepare and run a new training below ``out``. Raises UserError as :func:`prepare` and :func:`run` do."""
    return run(prepare(config), out, progress, at_once)


def resume(
    folder: RunFolder, config: TrainConfig, progress: Progress = UNWATCHED, at_once: int | None = None
) -> Outcome:
    """Prepare and run the rest of a training. Raises UserError as :func:`prepare_resume` and :func:`run` do."""
    return run(prepare_resume(folder, config), folder.path.parent.parent, progress, at_once)


def train_in(folder: RunFolder, progress: Progress = UNWATCHED) -> Outcome:
    """Begin, or go on with, the training whose configuration lies in ``folder``; it raises what the others raise."""
    config = folder.config()
    if folder.is_saved:
        return resume(folder, config, progress)
    return _begin(folder, prepare(config), progress)


def _make_learner(
    config: TrainConfig,
    folder: RunFolder,
    initial: dict[int, Tensors] | None = None,
    at_once: int | None = None,
) -> Learner:
    if isinstance(config, BPTTConfig):
        return SupervisedLearner(config, folder, initial)
    assert isinstance(config, RLConfig)
    if config.seeds > 1:
        return SideBySideLearner(config, folder, at_once)
    return RLLearner(config, folder, initial[config.seed] if initial else None)


def _check_surroundings(config: TrainConfig) -> None:
    check_device(config.device)
    if isinstance(config, RLConfig) and config.track:
        check_tracking()


def check_device(device: str) -> None:
    """Raise a UserError if ``device``, "cpu", "cuda" or "cuda:N", is not there."""
    if device == "cpu":
        return
    n_devices = torch.cuda.device_count() if torch.cuda.is_available() else 0
    _, _, number = device.partition(":")
    if not n_devices:
        raise UserError("There is no CUDA device here; use --device cpu.")
    if number and int(number) >= n_devices:
        raise UserError(f"There is no device {device} here; the last one is cuda:{n_devices - 1}.")
