"""Logs: text files that a training appends to, cut back where it goes on from an earlier state."""

from __future__ import annotations

import os
from pathlib import Path

from bilateral_rl.io.errors import UserError


class TrainingLog:
    """A text file of whole lines under a header, open only while lines are added.

    Args:
        path: the file, which need not exist yet.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @property
    def size(self) -> int:
        """The file's size in bytes; 0 if it is missing."""
        return self.path.stat().st_size if self.path.exists() else 0

    def append(self, lines: str, header: str) -> None:
        """Add ``lines``, each with its line break; a new file begins with ``header``. Raises OSError."""
        with self.path.open("a", newline="", encoding="utf-8") as file:
            file.write(lines if file.tell() else header + lines)

    def check(self, size: int) -> None:
        """Raise a UserError unless the file is missing, or can be cut back to whole lines of ``size`` bytes."""
        if not self.path.exists():
            return
        with self.path.open("rb") as file:
            file.seek(max(size - 1, 0))
            is_whole = 0 <= size <= self.size and (size == 0 or file.read(1) == b"\n")
        if not is_whole:
            raise UserError(f"{self.path} is damaged; move it away to go on without it.")

    def cut(self, size: int) -> None:
        """Cut the file back to its first ``size`` bytes, if it exists."""
        if self.path.exists():
            os.truncate(self.path, size)
