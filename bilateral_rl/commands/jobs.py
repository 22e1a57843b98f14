"""What commands print of the jobs of a study."""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from bilateral_rl.api.jobs import failures, unsourced_in_words
from bilateral_rl.io.errors import Stopped
from bilateral_rl.study.jobs import JobOutcome

INTERRUPTED_EXIT = 128 + signal.SIGINT


@contextlib.contextmanager
def ending_if_stopped(console: Console) -> Iterator[None]:
    """A context in which the command ends if somebody stops its jobs, and says how to go on."""
    try:
        yield
    except Stopped as stop:
        console.print(str(stop), highlight=False)
        sys.exit(INTERRUPTED_EXIT)


def print_failures(outcomes: Sequence[JobOutcome], console: Console) -> None:
    """Print a line for each job that failed, with the reason."""
    for failure in failures(outcomes):
        console.print(f"[red]Failed:[/red] {escape(failure)}", soft_wrap=True)


def print_unsourced(paths: Sequence[Path], console: Console) -> None:
    """Print a note on results that do not say which weights they are of."""
    if note := unsourced_in_words(paths):
        console.print(f"[yellow]Note:[/yellow] {escape(note)}", soft_wrap=True, highlight=False)
