"""Training runs of every algorithm, from start or resume."""

from __future__ import annotations

from pathlib import Path

from bilateral_rl.config.schema import BPTTConfig, RLConfig, TrainConfig
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import IMPORTED, RunFolder
from bilateral_rl.training import rl, supervised
from bilateral_rl.training.session import UNWATCHED, Outcome, Progress


def train(config: TrainConfig, out: Path, progress: Progress = UNWATCHED) -> Outcome:
    """Train into a new folder below ``out``.

    Raises:
        UserError: a device or an initial network that is not there, a folder that cannot be written, or a training
            that diverged.
    """
    if isinstance(config, BPTTConfig):
        return supervised.train(config, out, progress)
    assert isinstance(config, RLConfig)
    return rl.train(config, out, progress)


def resume(folder: RunFolder, config: TrainConfig, progress: Progress = UNWATCHED) -> Outcome:
    """Go on with ``folder``'s training until the end that ``config`` sets.

    Raises:
        UserError: a damaged or imported run, or one that has already come that far.
    """
    if folder.status().get("state") == IMPORTED:
        raise UserError(
            f"{folder.path} was imported as it was, without what going on takes; begin a training with its network by "
            f"`bilateral-rl train --init-from {folder.path}`."
        )
    if isinstance(config, BPTTConfig):
        return supervised.resume(folder, config, progress)
    assert isinstance(config, RLConfig)
    return rl.resume(folder, config, progress)
