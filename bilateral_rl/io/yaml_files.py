"""Settings in YAML or JSON, read as plain numbers, words, lists and dictionaries; nothing in them is executed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from bilateral_rl.io import files
from bilateral_rl.io.errors import UserError

LARGEST_SETTINGS = 2**16
"""Bytes, far beyond use: in a megabyte, there are numbers that take YAML minutes to read."""
DEEPEST_LEVEL = 20
"""Far beyond use: libyaml overflows the stack, and Python with it, at ten thousand levels."""
LONGEST_SCALAR = 2_000
"""Characters, far beyond use: Python refuses to print whole numbers of more than 4,300 digits."""
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""The safe loader, ten times faster where libyaml is there."""


def read_settings(path: Path, within: Path | None = None) -> dict[str, Any]:
    """Read settings by name from a YAML or JSON file.

    Args:
        path: the file.
        within: the folder that it belongs to, as for :func:`bilateral_rl.io.files.read`.

    Raises:
        UserError: the file cannot be read or holds anything but settings.
    """
    try:
        values = parse_yaml(files.read(path, LARGEST_SETTINGS, within).decode("utf-8"))
    except FileNotFoundError as error:
        raise UserError(f"Cannot read the configuration {path}: {error.strerror}.") from None
    except ValueError as error:
        raise UserError(f"The configuration {path} is neither YAML nor JSON: {error}.") from None
    if not isinstance(values, dict):
        raise UserError(f"The configuration {path} must hold settings by name, as `bilateral-rl train` writes them.")
    return values


def parse_yaml(text: str) -> Any:
    """Parse YAML, of which JSON is a part.

    Raises:
        ValueError: the text is neither, or it is a trap for who reads it: one that refers to parts of itself, has
            tags, is nested too deeply, or holds a number too long to print.
    """
    try:
        _refuse_traps(text)
        return yaml.load(text, Loader=_LOADER)
    except yaml.YAMLError as error:
        raise ValueError(" ".join(str(error).split())) from None


class Lines:
    """The lines, from 1, at which the settings of a YAML text stand."""

    def __init__(self) -> None:
        self._lines: dict[tuple[str | int, ...], int] = {}

    def of(self, path: Sequence[str | int]) -> int:
        """Return the line of a setting, or, if the text does not have it, of what is around it."""
        while path and tuple(path) not in self._lines:
            path = path[:-1]
        return self._lines.get(tuple(path), 1)

    def within(self, name: str) -> Lines:
        """Return the lines of what stands within one setting at the top."""
        inner = Lines()
        inner._lines = {path[1:]: line for path, line in self._lines.items() if path[0] == name}
        return inner

    def note(self, path: tuple[str | int, ...], node: yaml.Node) -> None:
        """Note where a node and all in it stand. Raises ValueError for a name that is there twice."""
        if isinstance(node, yaml.SequenceNode):
            for i, item in enumerate(node.value):
                self._lines[*path, i] = item.start_mark.line + 1
                self.note((*path, i), item)
        if isinstance(node, yaml.MappingNode):
            for key, value in node.value:
                inner, line = (*path, str(key.value)), key.start_mark.line + 1
                if inner in self._lines:
                    name = ".".join(map(str, inner))
                    raise ValueError(f"line {line}: {name} is there twice, first in line {self._lines[inner]}")
                self._lines[inner] = line
                self.note(inner, value)


def parse_with_lines(text: str) -> tuple[Any, Lines]:
    """Parse YAML as :func:`parse_yaml` does, and say where everything stands.

    Raises:
        ValueError: as there, and for a name that is there twice; the sentence begins with "line" and its number.
    """
    lines = Lines()
    try:
        _refuse_traps(text, with_line=True)
        node = yaml.compose(text, Loader=_LOADER)
        if node is not None:
            lines.note((), node)
        return yaml.load(text, Loader=_LOADER), lines
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        raise ValueError(f"line {mark.line + 1 if mark else 1}: it is no YAML: {error.problem}") from None
    except yaml.YAMLError as error:  # a character that YAML does not know
        line = text.count("\n", 0, getattr(error, "position", 0)) + 1
        raise ValueError(f"line {line}: it is no YAML: {getattr(error, 'reason', error)}") from None


def _refuse_traps(text: str, with_line: bool = False) -> None:
    depth = 0
    for event in yaml.parse(text, Loader=_LOADER):
        at = f"line {event.start_mark.line + 1}: " if with_line and event.start_mark else ""
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if isinstance(event, yaml.AliasEvent):
            raise ValueError(f"{at}it refers to parts of itself by the name {event.anchor!r}")
        if (tag := getattr(event, "tag", None)) is not None:
            raise ValueError(f"{at}it has the tag {tag!r}")
        if depth > DEEPEST_LEVEL:
            raise ValueError(f"{at}it has more than {DEEPEST_LEVEL} levels")
        if isinstance(event, yaml.ScalarEvent) and len(event.value) > LONGEST_SCALAR:
            raise ValueError(f"{at}it has a part of more than {LONGEST_SCALAR:,} characters")
