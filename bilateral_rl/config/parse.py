"""Settings as nested dictionaries: read safely, merged, and turned into typed dataclasses with clear errors."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import types
import typing
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from bilateral_rl.io import files
from bilateral_rl.io.errors import UserError

Values = dict[str, Any]
LARGEST_FILE, MOST_NODES, DEEPEST, LONGEST_SCALAR = 2**20, 10_000, 20, 2_000
"""Bounds of what is read as settings, in bytes, parts, levels and characters: far beyond use, as libyaml crashes at
deep nesting and huge numbers take minutes."""
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""The safe loader, ten times faster where libyaml is there."""


def merge(base: Mapping[str, Any], over: Mapping[str, Any]) -> Values:
    """``base`` with the entries of ``over``, nested dictionaries merged."""
    merged = dict(base)
    for key, value in over.items():
        both = isinstance(value, Mapping) and isinstance(merged.get(key), Mapping)
        merged[key] = merge(merged[key], value) if both else value
    return merged


def load_file(path: Path, within: Path | None = None) -> Values:
    """Settings from a YAML or JSON file, read without executing anything in it.

    Args:
        path: the file.
        within: the folder that it belongs to, as for :func:`bilateral_rl.io.files.read`.

    Raises:
        UserError: a file that cannot be read or holds anything but settings.
    """
    try:
        values = parse(files.read(path, LARGEST_FILE, within).decode("utf-8"))
    except FileNotFoundError as error:
        raise UserError(f"Cannot read the configuration {path}: {error.strerror}.") from None
    except ValueError as error:
        raise UserError(f"The configuration {path} is neither YAML nor JSON: {_one_line(error)}.") from None
    if not isinstance(values, dict):
        raise UserError(f"The configuration {path} must hold settings by name, as `bilateral-rl train` writes them.")
    return values


def parse(text: str) -> Any:
    """What YAML or JSON says, in plain numbers, words, lists and dictionaries.

    Raises:
        ValueError: other text; or what no settings need and a trap could be made of: tags, references to other parts
            of the text, more than 10,000 parts or 20 levels, a part of more than 2,000 characters.
    """
    try:
        _refuse_traps(text)
        return yaml.load(text, Loader=_LOADER)
    except yaml.YAMLError as error:
        raise ValueError(str(error)) from None


def _refuse_traps(text: str) -> None:
    depth = 0
    for n, event in enumerate(yaml.parse(text, Loader=_LOADER)):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        anchor, tag = getattr(event, "anchor", None), getattr(event, "tag", None)
        if anchor is not None:
            raise ValueError(f"it refers to parts of itself by the name {anchor!r}")
        if tag is not None:
            raise ValueError(f"it has the tag {tag!r}")
        if len(getattr(event, "value", "")) > LONGEST_SCALAR:
            raise ValueError(f"it has a part of more than {LONGEST_SCALAR:,} characters")
        if n > MOST_NODES or depth > DEEPEST:
            raise ValueError(f"it has more than {MOST_NODES:,} parts or {DEEPEST} levels")


def parse_overrides(items: Sequence[str]) -> Values:
    """``["ppo.learning_rate=0.003"]`` as nested dictionaries. Raises UserError for text of another form."""
    values: Values = {}
    for item in items:
        key, equals, text = item.partition("=")
        if not equals or not key:
            raise UserError(f"--set takes key=value, such as ppo.learning_rate=0.003, not {item!r}.")
        try:
            value = parse(text)
        except ValueError:
            raise UserError(f"The value in --set {item!r} is neither a number, a word nor a list.") from None
        for part in reversed(key.split(".")):
            value = {part: value}
        values = merge(values, value)
    return values


def build(cls: type[Any], values: Mapping[str, Any], prefix: str = "") -> Any:
    """An instance of the dataclass ``cls``, nested dataclasses included, from nested dictionaries.

    Args:
        cls: the dataclass.
        values: its fields by name.
        prefix: where it stands in the whole configuration, for messages.

    Raises:
        UserError: an unknown name, a value of the wrong type, or one that the dataclass refuses.
    """
    if not isinstance(values, Mapping):
        raise UserError(f"{prefix.rstrip('.')} must hold settings by name, got {values!r}.")
    hints = typing.get_type_hints(cls)
    names = [f.name for f in dataclasses.fields(cls)]
    arguments = {}
    for name, value in values.items():
        if name not in names:
            place = f"in {prefix.rstrip('.')}" if prefix else "among the settings"
            raise UserError(f"Unknown setting {name!r} {place}; choose from {', '.join(names)}.")
        arguments[name] = _convert(hints[name], value, f"{prefix}{name}")
    try:
        return cls(**arguments)
    except ValueError as error:
        raise UserError(f"{prefix}{error}") from None


def _convert(hint: Any, value: Any, name: str) -> Any:
    if dataclasses.is_dataclass(hint):
        return build(typing.cast(type[Any], hint), value, f"{name}.")
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        return None if value is None else _convert(arguments[0], value, name)
    if origin is tuple:
        if not isinstance(value, (list, tuple)):
            raise UserError(f"{name} must be a list, got {value!r}.")
        return tuple(_convert(arguments[0], item, name) for item in value)
    return _convert_scalar(hint, value, name)


def _convert_scalar(hint: Any, value: Any, name: str) -> Any:
    if (hint is str and isinstance(value, str)) or (hint is bool and isinstance(value, bool)):
        return value
    number = _as_number(value) if hint in (int, float) else math.nan
    if hint is float and math.isfinite(number):
        return number
    if hint is int and math.isfinite(number) and number.is_integer():
        return int(value) if isinstance(value, int) else int(number)
    wanted = {int: "a whole number", float: "a finite number", str: "a word", bool: "true or false"}[hint]
    raise UserError(f"{name} must be {wanted}, got {value!r}.")


def _as_number(value: Any) -> float:
    """``value``, which may be a word as which YAML reads 1e-3; nan for what is no number or too large for one."""
    if isinstance(value, (int, float, str)) and not isinstance(value, bool):
        with contextlib.suppress(ValueError, OverflowError):
            return float(value)
    return math.nan


def plain(value: Any) -> Any:
    """``value`` with lists for tuples, all the way down."""
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, (tuple, list)):
        return [plain(v) for v in value]
    return value


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
