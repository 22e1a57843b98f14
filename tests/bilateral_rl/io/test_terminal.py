"""What is printed: names that others chose do not steer the terminal."""

import io

from rich.table import Table

from bilateral_rl.io.errors import UserError
from bilateral_rl.io.terminal import Terminal, printable


def test_characters_that_are_not_to_be_seen_are_spelled():
    for text, shown in (
        ("5 cm², naïve – ✓", "5 cm², naïve – ✓"),
        ("\x1b[31mred", "\\x1b[31mred"),
        ("\x9b31m\x07\x00", "\\x9b31m\\x07\\x00"),
        ("\u202etfel", "\\u202etfel"),
        ("\udce4", "\\udce4"),
        ("two\nlines", "two\nlines"),
    ):
        assert printable(text) == shown


def test_markup_colors_and_escape_sequences_do_not():
    shown = io.StringIO()
    console = Terminal(file=shown, force_terminal=True, color_system="standard", width=60)
    table = Table("head", title="\x1b[2Jtitle")
    table.add_row("[bold]\x1b[2Jcell")
    console.print("[red]\x1b[2Jline", highlight=False)
    console.print(table)
    assert "\x1b[31m" in shown.getvalue()
    assert "\x1b[2J" not in shown.getvalue()
    assert shown.getvalue().count("\\x1b[2J") == 3


def test_an_error_is_one_line_of_bounded_length():
    assert str(UserError("first\r\nsecond\x1b")) == "first second\\x1b"
    assert len(str(UserError("x" * 10**6))) < 5_000
