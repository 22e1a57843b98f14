"""Training runs of every algorithm, from start or resume."""

from __future__ import annotations

from pathlib import Path

from bilateral_rl import rl_training
from bilateral_rl.bptt import training as bptt_training
from bilateral_rl.config import BPTTConfig, RLConfig, TrainConfig
from bilateral_rl.errors import UserError
from bilateral_rl.progress import IMPORTED, UNWATCHED, Outcome, Progress
from bilateral_rl.run_folder import RunFolder


def train(config: TrainConfig, out: Path, progress: Progress = UNWATCHED) -> Outcome:
    """Train into a new folder below ``out``.

    Raises:
        UserError: a device or an initial network that is not there, a folder that cannot be written, or a training
            that diverged.
    """
    if isinstance(config, BPTTConfig):
        return bptt_training.train(config, out, progress)
    assert isinstance(config, RLConfig)
    return rl_training.train(config, out, progress)


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
        return bptt_training.resume(folder, config, progress)
    assert isinstance(config, RLConfig)
    return rl_training.resume(folder, config, progress)
