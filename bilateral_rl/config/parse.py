"""Settings as nested dictionaries: merged, and turned into typed dataclasses with clear errors."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from bilateral_rl.io.errors import UserError
from bilateral_rl.io.yaml_files import parse_yaml

Values = dict[str, Any]


def merge(base: Mapping[str, Any], over: Mapping[str, Any]) -> Values:
    """Return ``base`` with the entries of ``over`` in it, nested dictionaries merged."""
    merged = dict(base)
    for key, value in over.items():
        both = isinstance(value, Mapping) and isinstance(merged.get(key), Mapping)
        merged[key] = merge(merged[key], value) if both else value
    return merged


def parse_overrides(items: Sequence[str]) -> Values:
    """Turn ``["ppo.learning_rate=0.003"]`` into nested dictionaries.

    Raises:
        UserError: an item is not of the form key=value, or its value is no YAML.
    """
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


T = TypeVar("T")


def build(cls: type[T], values: Mapping[str, Any]) -> T:
    """Return an instance of the dataclass ``cls``, nested dataclasses included, from nested dictionaries.

    Raises:
        UserError: an unknown name, a value of the wrong type or outside its bounds, or one that the dataclass refuses.
    """
    try:
        return TypeAdapter(cls).validate_python(values)
    except ValidationError as error:
        raise UserError(_sentence(cls, error.errors(include_url=False)[0])) from None


def _sentence(cls: type[Any], error: ErrorDetails) -> str:
    """Say what pydantic found wrong: where, what was expected, and what there is."""
    path = [str(part) for part in error["loc"] if not isinstance(part, int)]
    name, kind, value = ".".join(path), error["type"], error["input"]
    if kind in ("unexpected_keyword_argument", "invalid_key"):
        where = f"in {'.'.join(path[:-1])}" if path[:-1] else "among the settings"
        names = [f.name for f in dataclasses.fields(_field_type(cls, path[:-1]))]
        return f"Unknown setting {path[-1] if path else error['loc'][-1]!r} {where}; choose from {', '.join(names)}."
    if kind == "value_error":
        separator = "." if dataclasses.is_dataclass(_field_type(cls, path)) else " "
        return f"{name}{separator if name else ''}{error['ctx']['error']}."
    if kind == "literal_error":
        choices = error["ctx"]["expected"].replace("'", "").replace(" or ", ", ")
        return f"Unknown {name} {value!r}; choose from {choices}."
    context: dict[str, object] = {"length": len(typing.get_args(_field_type(cls, path)))}
    context |= {key: _shown(bound) for key, bound in error.get("ctx", {}).items()}
    for beginning, expected in _EXPECTED.items():
        if kind.startswith(beginning):
            return f"{name} must be {expected.format_map(context)}, got {_shown(value)}."
    return f"{name} cannot be {_shown(value)}: {error['msg']}."


_EXPECTED = {
    "dataclass": "settings by name",
    "int": "a whole number",
    "float": "a finite number",
    "finite": "a finite number",
    "bool": "true or false",
    "string": "a word",
    "tuple": "a list",
    "missing": "a list of {length} numbers",
    "too_short": "a list of at least {min_length} number",
    "too_long": "a list of at most {max_length} numbers",
    "greater_than_equal": "at least {ge}",
    "greater_than": "above {gt}",
    "less_than_equal": "at most {le}",
    "less_than": "below {lt}",
}
"""What each of pydantic's kinds of error expects, by the beginning of its name; longer beginnings come first."""


def _field_type(cls: type[Any], path: Sequence[str]) -> type[Any]:
    """Return the type of the field that ``path`` leads to from the dataclass ``cls``."""
    for part in path:
        cls = typing.get_type_hints(cls)[part]
    return cls


def _shown(value: object) -> str:
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    return f"{value:,}" if type(value) in (int, float) else repr(value)


def plain(value: Any) -> Any:
    """Return ``value`` with lists in place of tuples, all the way down."""
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, (tuple, list)):
        return [plain(v) for v in value]
    return value
