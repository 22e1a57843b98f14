"""What each side supplies, as commands print it: of one arm, and of each of two."""

import io

from rich.console import Console

from bilateral_rl.analysis.modulation import SideModulation
from bilateral_rl.commands.training_report import sides_line, sides_table
from bilateral_rl.vocabulary import path_names

ONE = SideModulation({"dominant": 3.0, "non_dominant": 1.0}, {"dominant": 0.5, "non_dominant": 0.25})
TWO = SideModulation(
    dict(zip(path_names(2), (3.0, 1.0, 1.0, 9.0), strict=True)),
    dict(zip(path_names(2), (0.1, 0.2, 0.3, 0.4), strict=True)),
)


def printed(table):
    console = Console(width=120, file=io.StringIO())
    console.print(table)
    return [line.split() for line in console.file.getvalue().replace("│", " ").replace("┃", " ").splitlines()]


def test_of_two_arms_each_has_a_line():
    assert sides_line({0: ONE}) == (
        "Sides: dominant 75 %, non-dominant 25 % of the commands' modulation; constant parts 0.50 and 0.25."
    )
    assert sides_line({0: TWO}).splitlines() == [
        "Sides, dominant arm: dominant 75 %, non-dominant 25 % of the commands' modulation; constant parts 0.10 and "
        "0.20.",
        "Sides, non-dominant arm: dominant 10 %, non-dominant 90 % of the commands' modulation; constant parts 0.30 "
        "and 0.40.",
    ]


def test_of_two_arms_the_table_has_two_rows_for_each():
    rows = printed(sides_table({4: ONE}))
    assert ["4", "dominant", "75.0", "%", "3.00", "0.50"] in rows
    rows = printed(sides_table({4: TWO, 5: TWO}))
    for expected in (
        ["4", "dominant", "dominant", "75.0", "%", "3.00", "0.10"],
        ["non-dominant", "25.0", "%", "1.00", "0.20"],
        ["non-dominant", "dominant", "10.0", "%", "1.00", "0.30"],
        ["non-dominant", "90.0", "%", "9.00", "0.40"],
    ):
        assert expected in rows
    assert sum(row[:1] == ["all"] for row in rows) == 1
