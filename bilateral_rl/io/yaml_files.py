"""Settings in YAML or JSON, read as plain numbers, words, lists and dictionaries; nothing in them is executed."""

from __future__ import annotations

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


def _refuse_traps(text: str) -> None:
    depth = 0
    for event in yaml.parse(text, Loader=_LOADER):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if isinstance(event, yaml.AliasEvent):
            raise ValueError(f"it refers to parts of itself by the name {event.anchor!r}")
        if (tag := getattr(event, "tag", None)) is not None:
            raise ValueError(f"it has the tag {tag!r}")
        if depth > DEEPEST_LEVEL:
            raise ValueError(f"it has more than {DEEPEST_LEVEL} levels")
        if isinstance(event, yaml.ScalarEvent) and len(event.value) > LONGEST_SCALAR:
            raise ValueError(f"it has a part of more than {LONGEST_SCALAR:,} characters")
