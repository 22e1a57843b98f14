"""Bars on a terminal, in a notebook, and nowhere else."""

import io
import sys
import types

import pytest
from rich.console import Console

from bilateral_rl.io.bars import Bars, draws


class Cell:
    """The output of a notebook's cell: every picture that it shows, one in place of the other."""

    def __init__(self):
        self.pictures, self.outputs = [], 0

    def display(self, picture, *, raw, display_id):
        assert (raw, display_id) == (True, True)
        self.outputs += 1
        self.pictures.append(picture)
        return self

    def update(self, picture, *, raw):
        assert raw
        self.pictures.append(picture)


@pytest.fixture
def cell(monkeypatch):
    cell = Cell()
    module = types.ModuleType("IPython.display")
    module.display = cell.display
    monkeypatch.setitem(sys.modules, "IPython", types.ModuleType("IPython"))
    monkeypatch.setitem(sys.modules, "IPython.display", module)
    return cell


def notebook():
    return Console(force_jupyter=True, file=io.StringIO())


def advance(console, transient=False):
    with Bars("{task.description}", "{task.percentage:.0f} %", console=console, transient=transient) as bars:
        task = bars.add_task("lesioning", total=8)
        for done in range(9):
            bars.update(task, completed=done)


def test_in_a_notebook_one_output_is_replaced_and_ends_with_the_last_state(cell, monkeypatch):
    monkeypatch.setattr("bilateral_rl.io.bars._INTERVAL", 0)
    advance(notebook())
    assert cell.outputs == 1
    assert len(cell.pictures) >= 9
    assert cell.pictures[-1]["text/plain"].strip() == "lesioning 100 %"
    assert "<pre" in cell.pictures[-1]["text/html"]
    assert "\x1b" not in cell.pictures[-1]["text/plain"]


def test_a_notebook_is_not_drawn_for_every_step(cell):
    advance(notebook())
    assert len(cell.pictures) <= 3
    assert cell.pictures[-1]["text/plain"].strip() == "lesioning 100 %"


def test_what_is_transient_leaves_nothing(cell):
    advance(notebook(), transient=True)
    assert cell.pictures[-1] == {"text/html": "", "text/plain": ""}


def test_a_file_gets_no_bar():
    console = Console(file=io.StringIO(), force_jupyter=False)
    assert not draws(console)
    advance(console, transient=True)
    assert console.file.getvalue().strip() == ""


def test_a_terminal_gets_one():
    console = Console(file=io.StringIO(), force_terminal=True, force_jupyter=False, _environ={"TERM": "xterm"})
    assert draws(console)
    advance(console)
    assert "lesioning" in console.file.getvalue()
