"""Weights & Biases as one more place to which a training logs, for those who ask for it and have it installed."""

from __future__ import annotations

import os
import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3.common.logger import Figure as LoggedFigure
from stable_baselines3.common.logger import KVWriter

from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.figures import as_array
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder

PROJECT = "bilateral-rl"
"""Project of the runs, unless the environment variable WANDB_PROJECT names another."""
TRACKING = "tracking.json"
"""File in a run's folder that holds the id by which Weights & Biases knows the run."""

_FINISH_TIMEOUT = 60.0
"""Longest wait at the end for what is still to be sent (s); what is left stays on the disk for `wandb sync`."""


def check_tracking() -> None:
    """Raise a UserError unless Weights & Biases is installed and knows who the user is; a terminal is asked.

    Without a network, or with WANDB_MODE=offline, nobody needs to be known.
    """
    wandb = _wandb()
    if wandb.setup().settings.mode in ("offline", "dryrun", "disabled"):
        return
    try:
        known = wandb.login()
    except wandb.errors.UsageError:
        known = False
    except wandb.errors.CommError:
        return
    if not known:
        raise UserError("Weights & Biases does not know you: call `wandb login` first, or set WANDB_MODE=offline.")


class Tracking(KVWriter):
    """An output of SB3's logger that forwards numbers and figures to a run of Weights & Biases.

    The run has the folder's name and the whole configuration; a resumed training goes on with the same one. Whatever
    goes wrong with it while training, the training goes on, and :attr:`notes` tell of it. Nothing else is sent on
    purpose; what Weights & Biases itself adds about the machine and the code is set by its own environment variables.

    Args:
        folder: the run's folder, which keeps the id in ``tracking.json``.
        config: of the training.

    Attributes:
        notes: sentences that a person should read.

    Raises:
        UserError: as for :func:`check_tracking`, or a damaged ``tracking.json``.
    """

    def __init__(self, folder: RunFolder, config: TrainConfig) -> None:
        self.notes: list[str] = []
        self._has_failed = False
        self._wandb = _wandb()
        self._run = self._start(_arguments(folder, config))
        if self._run is not None:
            folder.write_json(TRACKING, {"id": self._run.id})

    def write(self, key_values: dict[str, Any], key_excluded: dict[str, tuple[str, ...]], step: int = 0) -> None:
        if self._run is None or self._has_failed:
            return
        try:
            values = {
                name: self._loggable(value)
                for name, value in key_values.items()
                if not {"tensorboard", "wandb"} & set(key_excluded.get(name) or ())
            }
            if step >= self._run.step:  # a resumed training repeats what came after its last saved state
                self._run.log({name: value for name, value in values.items() if value is not None}, step=step)
        except Exception as error:
            self._fail(error)

    def close(self) -> None:
        if self._run is not None:
            try:
                self._run.finish()
            except Exception as error:
                self._fail(error)
            self._run = None

    def _start(self, arguments: dict[str, Any]) -> Any:
        """Start the run; None if Weights & Biases cannot give one."""
        settings = self._wandb.Settings(console="off", quiet=True, finish_timeout=_FINISH_TIMEOUT)
        try:
            return self._wandb.init(**arguments, settings=settings)
        except self._wandb.errors.UsageError as error:
            raise UserError(f"Weights & Biases cannot track this training: {_in_one_line(error)}") from None
        except Exception as error:
            reason = _in_one_line(error)
        try:
            run = self._wandb.init(**arguments, settings=settings, mode="offline")
        except Exception as error:
            self._fail(error)
            return None
        folder = shlex.quote(str(Path(run.dir).parent))
        self.notes.append(
            f"Weights & Biases was not reached ({reason}); `wandb sync {folder}` sends what it would get."
        )
        return run

    def _loggable(self, value: Any) -> Any:
        """Return a value as Weights & Biases takes it; None for a kind that it is not sent."""
        if isinstance(value, LoggedFigure):
            return self._wandb.Image(as_array(value.figure))
        if isinstance(value, int | float | np.number):
            return float(value)
        return None

    def _fail(self, error: Exception) -> None:
        if not self._has_failed:
            self.notes.append(f"Weights & Biases failed, and the training went on without it: {_in_one_line(error)}")
        self._has_failed = True


def _wandb() -> Any:
    """Import the package. Raises UserError if it is not installed."""
    try:
        import wandb
        from wandb import errors, init  # noqa: F401 - a folder called wandb, which it leaves behind, has none
    except ImportError:
        raise UserError(
            '--track needs Weights & Biases: get it with `pip install -c constraints.txt -e ".[track]"`, or leave out '
            "--track."
        ) from None
    return wandb


def _arguments(folder: RunFolder, config: TrainConfig) -> dict[str, Any]:
    """Return the arguments of ``wandb.init``."""
    return {
        "project": os.environ.get("WANDB_PROJECT", PROJECT),
        "name": folder.path.resolve().name,
        "config": config.to_values(),
        "id": _known_id(folder),
        "resume": "allow",
        "reinit": "create_new",  # a script's own run stays its own
    }


def _known_id(folder: RunFolder) -> str | None:
    """Return the id of the run that the training has already; the file may come from somebody else."""
    values = folder.read_json(TRACKING)
    if values is None:
        return None
    known = values.get("id") if isinstance(values, dict) else None
    if not isinstance(known, str) or not re.fullmatch(r"[A-Za-z0-9_-]{1,64}", known):
        raise UserError(f"{folder.path / TRACKING} is damaged: it holds no id; remove it to track a new run.")
    return known


def _in_one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
