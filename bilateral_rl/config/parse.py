"""Settings as nested dictionaries: merged, and turned into typed dataclasses with clear errors."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import types
import typing
from collections.abc import Mapping, Sequence
from typing import Any

from bilateral_rl.io.errors import UserError
from bilateral_rl.io.yaml_files import parse_yaml

Values = dict[str, Any]


def merge(base: Mapping[str, Any], over: Mapping[str, Any]) -> Values:
    """``base`` with the entries of ``over``, nested dictionaries merged."""
    merged = dict(base)
    for key, value in over.items():
        both = isinstance(value, Mapping) and isinstance(merged.get(key), Mapping)
        merged[key] = merge(merged[key], value) if both else value
    return merged


def parse_overrides(items: Sequence[str]) -> Values:
    """``["ppo.learning_rate=0.003"]`` as nested dictionaries. Raises UserError for text of another form."""
    values: Values = {}
    for item in items:
        key, equals, text = item.partition("=")
        if not equals or not key:
            raise UserError(f"--set takes key=value, such as ppo.learning_rate=0.003, not {item!r}.")
        try:
            value = parse_yaml(text)
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
