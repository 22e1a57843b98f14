"""Errors meant for the person at the command line."""

import sys
from collections.abc import Callable

from rich.markup import escape

from bilateral_rl.io.terminal import Terminal, printable

_LONGEST = 4_000
"""Characters: what a damaged file holds is quoted, but no book of it."""


class UserError(Exception):
    """What was wrong, what was expected and what to do, in one sentence; the CLI prints it and exits with 2.

    It may quote names and values that others chose, and stays one line that is safe to print.
    """

    def __init__(self, sentence: str) -> None:
        text = printable(" ".join(sentence.splitlines()))
        super().__init__(text if len(text) <= _LONGEST else f"{text[:_LONGEST]} …")


def run_program(program: Callable[[], object]) -> None:
    """Run a program; a :class:`UserError` is printed as one line and ends it with exit code 2, Ctrl-C with 130."""
    console = Terminal(stderr=True)
    try:
        program()
    except UserError as error:
        console.print(f"[red]Error:[/red] {escape(str(error))}", highlight=False, soft_wrap=True)
        sys.exit(2)
    except KeyboardInterrupt:
        console.print("Interrupted.")
        sys.exit(130)
