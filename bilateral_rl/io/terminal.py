"""What is printed: names that others chose do not steer the terminal, and a reader who leaves stops nothing."""

from __future__ import annotations

import contextlib
import io
import os
from typing import Any, TextIO

from rich.console import Console
from rich.text import Text


def printable(text: str) -> str:
    """Spell characters that do not show, such as those of escape sequences, as Python does; lines stay lines."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text)


class Terminal(Console):
    """A console on which text can have markup, but no escape sequences of its own."""

    def render_str(self, text: str, **options: Any) -> Text:  # type: ignore[override]
        return super().render_str(printable(text), **options)


class PatientStream:
    """A text stream whose failures are kept instead of raised, so that what a program computes is never lost to them.

    After a failure (a pipe whose reader has left, a full device) the rest of the output goes nowhere. Characters that
    its encoding lacks become question marks.

    Args:
        stream: standard output or standard error.

    Attributes:
        failure: the first error, or None.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.failure: OSError | None = None
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")

    def write(self, text: str) -> int:
        try:
            return self._stream.write(text)
        except OSError as error:
            self._give_up(error)
        return len(text)

    def flush(self) -> None:
        try:
            self._stream.flush()
        except OSError as error:
            self._give_up(error)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _give_up(self, error: OSError) -> None:
        self.failure = self.failure or error
        # What the stream still buffers, and will try to write when Python ends, goes nowhere as well.
        with contextlib.suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)
