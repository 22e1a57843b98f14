"""Text files that a training appends to, and that are cut back where it goes on from an earlier state."""

from __future__ import annotations

import os
from pathlib import Path

from bilateral_rl.io.errors import UserError


class TrainingLog:
    """A file of lines, open only while some are added."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @property
    def size(self) -> int:
        """Bytes; 0 if it is missing."""
        return self.path.stat().st_size if self.path.exists() else 0

    def append(self, lines: str, header: str) -> None:
        """Add whole lines; the file begins with ``header``."""
        with self.path.open("a", newline="", encoding="utf-8") as file:
            file.write(lines if file.tell() else header + lines)

    def check(self, size: int) -> None:
        """Raise a UserError unless the file is missing, or can be cut back to ``size``."""
        if not self.path.exists():
            return
        with self.path.open("rb") as file:
            file.seek(max(size - 1, 0))
            is_whole = 0 <= size <= self.size and (size == 0 or file.read(1) == b"\n")
        if not is_whole:
            raise UserError(f"{self.path} is damaged; move it away to go on without it.")

    def cut(self, size: int) -> None:
        """Leave the first ``size`` bytes."""
        if self.path.exists():
            os.truncate(self.path, size)
