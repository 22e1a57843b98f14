"""What a program that goes wrong prints, and its exit code; what becomes of output is in test_lost_output.py."""

import errno
import io
import os
import sys

import pytest

from bilateral_rl.io.errors import UserError, run_program


def ended(program):
    """The exit code."""
    try:
        run_program(program)
    except SystemExit as end:
        return end.code
    return 0


def failing(error):
    def program():
        raise error

    return program


@pytest.mark.parametrize(
    ("program", "code", "printed"),
    [
        (lambda: None, 0, ""),
        (failing(SystemExit(0)), 0, ""),
        (failing(SystemExit(3)), 3, ""),
        (failing(KeyboardInterrupt()), 130, "Interrupted.\n"),
        (failing(UserError("[bold]No[/bold] such\nthing.")), 2, "Error: [bold]No[/bold] such thing.\n"),
    ],
)
def test_a_program_ends_with_its_exit_code_and_at_most_a_line(capsys, program, code, printed):
    assert ended(program) == code
    assert capsys.readouterr() == ("", printed)


class Failing(io.StringIO):
    def __init__(self, error):
        super().__init__()
        self.error = error

    def write(self, text):
        raise OSError(self.error, os.strerror(self.error))


@pytest.mark.parametrize(("error", "code"), [(errno.EPIPE, 141), (errno.EINVAL, 141), (errno.EIO, 1)])
def test_a_program_works_on_whatever_becomes_of_its_output(capsys, monkeypatch, error, code):
    done = []

    def program():
        print("lost")
        done.append("work")

    monkeypatch.setattr(sys, "stdout", Failing(error))
    assert ended(program) == code
    assert done == ["work"]
    assert sys.stdout.error == error  # it is back
    assert capsys.readouterr().err.count("\n") == (code == 1)


def test_a_refusal_keeps_its_exit_code_whatever_becomes_of_the_output(monkeypatch):
    def program():
        print("lost")
        raise UserError("No.")

    monkeypatch.setattr(sys, "stdout", Failing(errno.ENOSPC))
    assert ended(program) == 2


def test_a_program_works_without_any_output(monkeypatch):
    monkeypatch.setattr(sys, "stdout", None)
    monkeypatch.setattr(sys, "stderr", None)
    assert ended(lambda: print("lost")) == 0
    assert ended(failing(UserError("No."))) == 2


def test_characters_that_the_encoding_lacks_are_no_error(monkeypatch):
    output = io.TextIOWrapper(io.BytesIO(), encoding="cp1252")
    monkeypatch.setattr(sys, "stdout", output)
    assert ended(lambda: print("5 ± λ")) == 0
    assert output.buffer.getvalue().decode("cp1252") == "5 ± ?\n"
