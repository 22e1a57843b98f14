"""What a person should know of a call that succeeded: on the command line a note, in Python a warning."""

from __future__ import annotations

import warnings
from collections.abc import Iterable

_CALLER = 4
"""Where a warning is shown: past :func:`tell`, the public function, and the wrapper that words its errors."""


def tell(notes: Iterable[str]) -> None:
    """Warn of each note, at the line that called the public function that this is called in."""
    for note in notes:
        warnings.warn(note, stacklevel=_CALLER)
