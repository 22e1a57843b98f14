"""What people give the Python face, as the rooms below take it: whole numbers, names, seeds and settings."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from bilateral_rl.config.parse import Values, nested
from bilateral_rl.io.errors import UserError

Names = str | Iterable[str] | None
"""One name, several, or None for the usual ones."""
SeedsLike = int | str | Iterable[int] | None
"""How many seeds, or which: ``range(100, 130)``, ``[100, 101]`` or "100..129"."""


def check_tests(trials: int, seed: int = 0) -> tuple[int, int]:
    """Return the number of test trials and the seed of the first as plain numbers.

    Raises:
        UserError: no whole numbers, less than one trial, or a negative seed.
    """
    return whole("--trials", trials, least=1), whole("--seed", seed)


def whole(option: str, value: Any, least: int = 0) -> int:
    """Return a whole number, be it NumPy's. Raises UserError for anything else, and for one below ``least``."""
    try:
        number = operator.index(value)
    except TypeError:
        raise UserError(f"{option} must be a whole number, got {value!r}.") from None
    if isinstance(value, bool):
        raise UserError(f"{option} must be a whole number, got {value!r}.")
    if number < least:
        raise UserError(f"{option} must be at least {least}, got {number}.")
    return number


def flag(option: str, value: Any) -> bool:
    """Return True or False, be it NumPy's. Raises UserError for anything else."""
    if type(value).__name__ not in ("bool", "bool_"):  # by its name: who lists runs does not want NumPy
        raise UserError(f"{option} must be True or False, got {value!r}.")
    return bool(value)


def names(option: str, value: Names) -> list[str] | None:
    """Return one name or several as a list; None for None or none. Raises UserError for anything but names."""
    if value is None:
        return None
    try:
        listed = [value] if isinstance(value, str) else list(value)
    except TypeError:
        listed = [value]  # type: ignore[list-item] # which is refused
    for name in listed:
        if not isinstance(name, str):
            raise UserError(f"{option} takes a name or a list of names, not {name!r}.")
    return listed or None


def as_path(option: str, value: str | Path) -> Path:
    """Return a path. Raises UserError for what is none."""
    try:
        return Path(value).expanduser()
    except TypeError:
        raise UserError(f"{option} takes a path, not {value!r}.") from None


def seeds_text(value: SeedsLike) -> str | None:
    """Return seeds as ``--seeds`` takes them. Raises UserError for what are none, or not consecutive ones."""
    if value is None or isinstance(value, str):
        return value
    if not isinstance(value, Iterable):
        return str(whole("--seeds", value, least=1))
    listed = [whole("--seeds", seed) for seed in value]
    if not listed or listed != list(range(listed[0], listed[0] + len(listed))):
        raise UserError(f"--seeds takes consecutive seeds, such as range(100, 130), not {listed}.")
    return f"{listed[0]}..{listed[-1]}"


def settings_by_name(option: str, values: Mapping[str, Any] | None) -> Values:
    """Return settings as nested dictionaries, of dotted names such as ``"ppo.gamma"`` too.

    Raises:
        UserError: anything but settings by name.
    """
    if values is None:
        return {}
    if not isinstance(values, Mapping) or not all(isinstance(name, str) for name in values):
        raise UserError(f'{option} takes settings by name, such as {{"trial.sensory_noise": 0.01}}, not {values!r}.')
    return nested(values)
