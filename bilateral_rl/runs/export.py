"""A run as a folder to publish: what acts and how it learned, without pickles and what only this machine knows."""

from __future__ import annotations

import dataclasses
import os
import secrets
from pathlib import Path
from typing import Any

from bilateral_rl.algorithms import ALGORITHM_CLASSES
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.files import read, removed_if_it_fails
from bilateral_rl.runs.folder import FINAL, RunFolder
from bilateral_rl.runs.policies import load_policies, stack_states

CARD = "README.md"
"""Name of the model card."""
LEARNING = ("epochs.csv", "evaluations.csv")
"""Names of the tables of how a run learned: of supervised training, and of reinforcement learning."""
_LARGEST_TABLE = 2**25
"""Largest table that is read, in bytes."""


def check_free(path: Path) -> None:
    """Raise a UserError unless ``path`` is free, or an empty folder."""
    try:
        taken = os.path.lexists(path) and not (path.is_dir() and not any(path.iterdir()))
    except OSError as error:
        raise UserError(f"Cannot write {path}: {error.strerror}; choose another --out.") from None
    if taken:
        raise UserError(f"{path} exists: choose another --out, or remove it.")


def exported_config(folder: RunFolder, only: int | None) -> TrainConfig:
    """Return the configuration of an exported run: of one seed if one is named, without the path of another run."""
    config = folder.config()
    changes: dict[str, Any] = {"init_from": None}
    if only is not None:
        changes |= {"seed": only, "seeds": 1}
    return dataclasses.replace(config, **changes)


def write_export(folder: RunFolder, only: int | None, weights: str, path: Path, card: str) -> RunFolder:
    """Write a run that every command takes, whole or not at all.

    Args:
        folder: the run that it is made of.
        only: the seed whose network it holds; None for all.
        weights: which of the run's weights become its final ones.
        path: a folder that :func:`check_free` allows.
        card: text of the model card.

    Raises:
        UserError: weights that are missing or damaged, or a folder that cannot be written.
    """
    check_free(path)
    config = exported_config(folder, only)
    states = {
        seed: (policy if config.algo in ALGORITHM_CLASSES else policy.motor_network).state_dict()
        for seed, policy in load_policies(folder, weights, only).items()
    }
    stacked = len(states) > 1 or config.algo not in ALGORITHM_CLASSES
    status = _status(folder, only) | {"weights": FINAL, "exported_from": f"{folder.path.name}, {weights}"}
    temporary = RunFolder(path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp"))
    try:
        with removed_if_it_fails(temporary.path):
            (temporary.path / "weights").mkdir(parents=True)
            temporary.write_config(config)
            temporary.save_weights(FINAL, stack_states(states) if stacked else states[config.seed])
            temporary.write_json("status.json", status)
            temporary.write_json("versions.json", folder.read_json("versions.json", default={}))
            for name in LEARNING:
                _write_table(folder, only, name, temporary)
            temporary.write_text(CARD, card)
            load_policies(temporary)  # as whoever gets it will
            if path.exists():
                path.rmdir()  # empty, which not every system replaces
            temporary.path.rename(path)
    except OSError as error:
        raise UserError(f"Cannot write {path}: {error.strerror}; choose another --out.") from None
    return RunFolder(path)


def _status(folder: RunFolder, only: int | None) -> dict[str, Any]:
    """Return how far the training came, of one seed or of all."""
    status = folder.status()
    if only is None or "seeds" not in status:
        return status
    of_seed = [one for one in status["seeds"] if isinstance(one, dict) and one.get("seed") == only]
    counts = {name: one[name] for one in of_seed for name in ("timesteps", "epochs") if name in one}
    return status | counts | {"seeds": of_seed}


def _write_table(folder: RunFolder, only: int | None, name: str, to: RunFolder) -> None:
    """Write the table ``name`` of a run, if it has one; of one seed, where it has rows of several."""
    try:
        text = read(folder.path / name, _LARGEST_TABLE, within=folder.path).decode("utf-8", "replace")
    except FileNotFoundError:
        return
    header, *rows = text.splitlines() or [""]
    if only is not None and header.startswith("seed,"):
        rows = [row for row in rows if row.startswith(f"{only},")]
    to.write_text(name, "\n".join([header, *rows]) + "\n")
