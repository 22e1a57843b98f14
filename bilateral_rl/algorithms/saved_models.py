"""Which algorithm saved a model: SB3 takes any for its own, and goes on with the defaults of what the file lacks."""

from __future__ import annotations

import io
import json
import pathlib
import zipfile
from collections.abc import Container

from stable_baselines3.common.save_util import open_path

_TELLING = {"clip_range": "PPO", "target_entropy": "SAC", "target_policy_noise": "TD3"}
"""An attribute that every model of an algorithm has, and no model of the others; A2C has none of them."""


def check_saved_by(path: str | pathlib.Path | io.BufferedIOBase, name: str, attributes: Container[str]) -> None:
    """Refuse a file that another algorithm has saved. Only names are read: nothing in the file is executed.

    Args:
        path: as SB3 takes it, with or without ".zip", or an open file, which stands where it stood afterwards.
        name: of the class that is to load it.
        attributes: those of any model of that class.

    Raises:
        ValueError: it was saved by another algorithm. What is no saved model at all is left to SB3 to refuse.
    """
    found = _attributes_in(path)
    if found is None:
        return
    in_file, expected = algorithm_of(found), algorithm_of(attributes)
    if in_file != expected:
        raise ValueError(f"{name} loads models of {expected}, and this one was saved by {in_file}.")


def algorithm_of(names: Container[str]) -> str:
    """Return which of PPO, A2C, SAC and TD3 a model with attributes of these names is of."""
    return next((algorithm for attribute, algorithm in _TELLING.items() if attribute in names), "A2C")


def _attributes_in(path: str | pathlib.Path | io.BufferedIOBase) -> set[str] | None:
    """Return the names of a saved model's attributes; None for what is no saved model."""
    file = open_path(path, "r", verbose=0, suffix="zip")
    begin = file.tell()
    try:
        with zipfile.ZipFile(file) as archive:
            data = json.loads(archive.read("data"))
            return set(data) if isinstance(data, dict) else None
    except (zipfile.BadZipFile, KeyError, ValueError):
        return None
    finally:
        if file is path:
            file.seek(begin)
        else:
            file.close()
