"""Errors meant for the person at the command line."""


class UserError(Exception):
    """What was wrong, what was expected and what to do, in one sentence; the CLI prints it and exits with 2."""
