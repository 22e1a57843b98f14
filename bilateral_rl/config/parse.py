"""Settings as nested dictionaries: merged, and turned into typed dataclasses with clear errors."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from bilateral_rl.envs.refusals import refusal
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


def flat(values: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every entry of nested dictionaries with its dotted name, such as ``"bptt.patience"``."""
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{path}{name}.")
        else:
            yield f"{path}{name}", value


def nested(values: Mapping[str, Any]) -> Values:
    """Return nested dictionaries of settings whose names may be dotted, such as ``{"bptt.patience": 3}``."""
    result: Values = {}
    for name, value in values.items():
        inner = nested(value) if isinstance(value, Mapping) else value
        for part in reversed(name.split(".") if isinstance(name, str) else [name]):  # anything else is refused later
            inner = {part: inner}
        result = merge(result, inner)
    return result


def parse_overrides(items: Sequence[str], example: str = "ppo.learning_rate=0.003") -> Values:
    """Turn ``["ppo.learning_rate=0.003"]`` into nested dictionaries.

    Args:
        items: as ``--set`` takes them.
        example: one that the command takes, for the sentence of an error.

    Raises:
        UserError: an item is not of the form key=value, or its value is no YAML.
    """
    values: Values = {}
    for item in items:
        key, equals, text = item.partition("=")
        if not equals or not key:
            raise UserError(f"--set takes key=value, such as {example}, not {item!r}.")
        try:
            value = parse_yaml(text)
        except ValueError:
            raise UserError(f"The value in --set {item!r} is neither a number, a word nor a list.") from None
        values = merge(values, nested({key: value}))
    return values


T = TypeVar("T")


def build(cls: type[T], values: Mapping[str, Any], within: str = "") -> T:
    """Return an instance of the dataclass ``cls``, nested dataclasses included, from nested dictionaries.

    Args:
        cls: the dataclass.
        values: its fields.
        within: the setting that holds it, for the sentence of an error.

    Raises:
        UserError: an unknown name, a value of the wrong type or outside its bounds, or one that the dataclass refuses.
    """
    try:
        return TypeAdapter(cls).validate_python(values)
    except ValidationError as error:
        raise UserError(refusal(cls, error, within)) from None


def plain_values(settings: Any) -> Values:
    """Return the nested dictionaries of a dataclass of settings, with lists in place of tuples."""
    return typing.cast(Values, plain(dataclasses.asdict(settings)))


def plain(value: Any) -> Any:
    """Return ``value`` with lists in place of tuples, all the way down."""
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, (tuple, list)):
        return [plain(v) for v in value]
    return value
