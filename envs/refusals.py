"""Why settings are refused, in one sentence instead of pydantic's report."""

from __future__ import annotations

import dataclasses
import difflib
import functools
import types
import typing
from collections.abc import Sequence
from typing import Any, TypeVar

from pydantic import ValidationError

T = TypeVar("T")
_UNKNOWN = ("unexpected_keyword_argument", "invalid_key")
"""What pydantic calls a name that there is not."""
_LONGEST = 100
"""Letters of a value that a sentence shows."""


def refusing_in_a_sentence(cls: type[T]) -> type[T]:
    """Let the constructor of a pydantic dataclass raise a plain ValueError of one sentence."""
    validate = cls.__init__

    @functools.wraps(validate)
    def init(self: T, *args: Any, **kwargs: Any) -> None:
        try:
            validate(self, *args, **kwargs)
        except ValidationError as error:
            raise ValueError(refusal(cls, error)) from None

    cls.__init__ = init  # type: ignore[method-assign, assignment]
    return cls


def first_error(errors: ValidationError) -> Any:
    """Return what is to be said first: an unknown name, since what is then missing is often what it was meant for."""
    found = errors.errors(include_url=False)
    return next((error for error in found if error["type"] in _UNKNOWN), found[0])


def refusal(cls: type[Any], errors: ValidationError, within: str = "") -> str:
    """Say the first thing that pydantic found wrong with settings of the dataclass ``cls``, in one sentence.

    It says where, ``within`` which setting if need be, what was expected, and what there is.
    """
    error = first_error(errors)
    path = place(error["loc"])
    name, kind, value = ".".join([*filter(None, [within]), *path]), error["type"], error["input"]
    if kind in ("missing", "missing_argument") and isinstance(error["loc"][-1], str):
        return f"{name} must be given."
    if kind in _UNKNOWN:
        around = ".".join([*filter(None, [within]), *path[:-1]])
        where = f"in {around}" if around else "among the settings"
        inside = _field_type(cls, path[:-1])
        names = [f.name for f in dataclasses.fields(inside)]
        unknown = path[-1] if path else error["loc"][-1]
        if deeper := _deeper(inside, str(unknown)):
            paths = " or ".join(".".join([*filter(None, [around]), *path]) for path in deeper)
            return f"Unknown setting {unknown!r} {where}; it is {paths}."
        near = difflib.get_close_matches(str(unknown), names, n=1)
        hint = f"; you may have meant {near[0]}" if near else ""
        return f"Unknown setting {unknown!r} {where}; choose from {', '.join(names)}{hint}."
    if kind == "value_error":
        reason = str(error["ctx"]["error"])
        return f"{name}{_separator(reason, _names(_field_type(cls, path))) if name else ''}{reason}."
    if kind == "literal_error":
        choices = error["ctx"]["expected"].replace("'", "").replace(" or ", ", ")
        return f"Unknown {name} {shown(value)}; choose from {choices}."
    context: dict[str, object] = {"length": len(typing.get_args(_field_type(cls, path)))}
    context |= {key: shown(bound) for key, bound in error.get("ctx", {}).items()}
    for beginning, expected in _EXPECTED.items():
        if kind.startswith(beginning):
            return f"{name} must be {expected.format_map(context)}, got {shown(value)}."
    return f"{name} cannot be {shown(value)}: {error['msg']}."


_EXPECTED = {
    "dataclass": "settings by name",
    "dict": "settings by name",
    "union_tag": "numbers or settings by name",
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


def _separator(reason: str, names: Sequence[str]) -> str:
    """Return what stands between a setting and the reason why it is refused, which may begin with one inside it."""
    if reason.partition(" ")[0].partition(".")[0] in names:
        return "."
    return " " if reason.startswith("must") else ": "


def place(loc: Sequence[int | str]) -> list[str]:
    """Return the names of the settings that lead to where pydantic found something wrong.

    Places in lists are left out, and so are the names, as ``<list>``, of the forms that a setting may have.
    """
    return [part for part in loc if isinstance(part, str) and not part.startswith("<")]


def _field_type(cls: type[Any], path: Sequence[str]) -> type[Any]:
    """Return the type of the field that ``path`` leads to from the dataclass ``cls``; object inside a dictionary.

    Of a field that may have several forms, it is the dataclass among them.
    """
    for part in path:
        cls = _settings_in(typing.get_type_hints(cls)[part]) if dataclasses.is_dataclass(cls) else object
    return cls


def _deeper(cls: type[Any], name: str) -> list[list[str]]:
    """Return the paths to settings of this name below those of the dataclass ``cls``.

    An experiment's are left out where there are others: it says in a file of its own what few trainings have at all.
    """
    paths = [[field] for field in _names(cls)]
    for path in paths:  # which grows meanwhile
        paths += [[*path, field] for field in _names(_field_type(cls, path))]
    found = [path for path in paths if path[-1] == name and len(path) > 1]
    return [path for path in found if path[0] != "experiment"] or found


def _settings_in(hint: Any) -> Any:
    if not isinstance(hint, types.UnionType) and typing.get_origin(hint) is not typing.Union:
        return hint
    forms = [_settings_in(form) for form in typing.get_args(hint)]
    return next((form for form in forms if dataclasses.is_dataclass(form)), hint)


def _names(cls: type[Any]) -> list[str]:
    """Return the names of a dataclass's fields; none of another type."""
    return [f.name for f in dataclasses.fields(cls)] if dataclasses.is_dataclass(cls) else []


def shown(value: object) -> str:
    """Return what was given as it stands in a sentence: numbers with their thousands apart, and nothing too long."""
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    text = f"{value:,}" if type(value) in (int, float) else " ".join(repr(value).split())
    if len(text) <= _LONGEST:
        return text
    shape = f" of shape {value.shape}" if hasattr(value, "shape") else ""
    return f"{type(value).__name__}{shape}, {text[:_LONGEST]}…"
