"""Files that commands write: whole or not at all; ``-`` is the terminal."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

from rich.console import Console

from bilateral_rl.io.errors import UserError
from bilateral_rl.io.files import replacing
from bilateral_rl.io.terminal import Terminal


def apart_from(console: Console, *paths: Path | None) -> Console:
    """The console for people: standard error where data go to the terminal, so that these can be piped on."""
    return Terminal(stderr=True) if any(str(path) == "-" for path in paths) else console


def write(path: Path, text: str) -> None:
    """Write ``text`` into ``path``, or to the terminal if it is ``-``. Raises UserError if it cannot be written."""
    if str(path) == "-":
        sys.stdout.write(text)
        return
    try:
        path = path.resolve()
        if path.exists() and not path.is_file():
            path.write_text(text, encoding="utf-8")  # a device or a pipe: nothing to replace
            return
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise UserError(f"Cannot write {path}: {error.strerror}.") from None


def json_ready(value: Any) -> Any:
    """Put None in the place of numbers that JSON cannot hold, in ``value`` and in dictionaries and lists in it."""
    if isinstance(value, dict):
        return {key: json_ready(item) for key, item in value.items()}
    if isinstance(value, list):
        return [json_ready(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
