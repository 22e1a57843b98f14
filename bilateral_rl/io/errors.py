"""Errors meant for the person at the command line, and how a program ends with them."""

from __future__ import annotations

import contextlib
import errno
import sys
from collections.abc import Callable
from typing import TextIO

from rich.markup import escape

from bilateral_rl.io.terminal import PatientStream, Terminal, printable

_LONGEST = 4_000
"""Longest message, in characters: what a damaged file holds is quoted, but no book of it."""


class UserError(Exception):
    """A sentence that says what was wrong, what was expected and what to do; a command prints it and exits with 2.

    The sentence may quote names and values that others chose, and stays one line that is safe to print.

    Attributes:
        on_command_line: the sentence as a command prints it, with options such as ``--out``. In Python it may have
            other words (:mod:`bilateral_rl.api.wording`).
    """

    def __init__(self, sentence: str) -> None:
        text = printable(" ".join(sentence.splitlines()))
        self.on_command_line = text if len(text) <= _LONGEST else f"{text[:_LONGEST]} …"
        super().__init__(self.on_command_line)


class Stopped(KeyboardInterrupt):
    """Somebody stopped a training or a study, and all is saved; the sentence says how to go on.

    It is a KeyboardInterrupt, so that a notebook does not run its next cells.
    """


def run_program(program: Callable[[], object]) -> None:
    """Run a program, and end the process unless it succeeds.

    Exit codes: 2 after a :class:`UserError`, which is printed as one line; 130 after Ctrl-C. Output that cannot be
    written stops nothing: the program works on to its end, and only then exits with 141, as if by SIGPIPE, if nobody
    reads the output any more (``| head -1``), or with 1 and a line that says why.
    """
    output = _patient(sys.stdout)
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(_patient(sys.stderr)):
        code = _exit_code(program)
        if output is not None:
            output.flush()
            if output.failure is not None and not code:
                code = _report(output.failure)
    if code:
        sys.exit(code)


def _patient(stream: TextIO | None) -> PatientStream | None:
    return None if stream is None else PatientStream(stream)  # there is none where it was closed


def _exit_code(program: Callable[[], object]) -> int | str | None:
    console = Terminal(stderr=True)
    try:
        program()
    except UserError as error:
        console.print(f"[red]Error:[/red] {escape(error.on_command_line)}", highlight=False, soft_wrap=True)
        return 2
    except KeyboardInterrupt:
        console.print("Interrupted.")
        return 130
    except SystemExit as end:
        return end.code
    return None


def _report(failure: OSError) -> int:
    if isinstance(failure, BrokenPipeError) or failure.errno == errno.EINVAL:  # as Windows says it
        return 141
    Terminal(stderr=True).print(f"[red]Error:[/red] Not all could be printed: {failure.strerror}.", highlight=False)
    return 1
