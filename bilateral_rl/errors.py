"""Errors meant for the person at the command line."""

from bilateral_rl.terminal import printable

_LONGEST = 4_000
"""Characters: what a damaged file holds is quoted, but no book of it."""


class UserError(Exception):
    """What was wrong, what was expected and what to do, in one sentence; the CLI prints it and exits with 2.

    It may quote names and values that others chose, and stays one line that is safe to print.
    """

    def __init__(self, sentence: str) -> None:
        text = printable(" ".join(sentence.splitlines()))
        super().__init__(text if len(text) <= _LONGEST else f"{text[:_LONGEST]} …")
