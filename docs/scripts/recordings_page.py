"""Write the data dictionary at the end of docs/recordings.md from the definition of what is recorded.

Run it after a change there: ``python docs/scripts/recordings_page.py``. A test compares the page with the code.
"""

from __future__ import annotations

from pathlib import Path

from bilateral_rl.analysis.recording_fields import EVERY_FIELD, LABEL_FIELDS, LABELS, OF_TWO_ARMS, Field

PAGE = Path(__file__).parents[1] / "recordings.md"
MARK = "<!-- made by docs/scripts/recordings_page.py from the code: change that, and run it again -->\n"
CLOCK = (
    "| `step` | – | | `step` | number of the moment and of the step that begins at it, from 0 |\n"
    "| `time` | time | s | `time_s` | time since the start of the trial |\n"
)
"""What counts the rows of a table; in NetCDF both are coordinates, and NPZ has the second."""


def page() -> str:
    """Return the page as it stands, with the table anew."""
    written, _, _ = PAGE.read_text(encoding="utf-8").partition(MARK)
    rows = [_row(field.of_two_arms if field in OF_TWO_ARMS else field) for field in EVERY_FIELD]
    rows.insert(len(LABEL_FIELDS), CLOCK)  # after the labels, as in tables
    head = "| array | dimensions | unit | columns | what it is |\n|---|---|---|---|---|\n"
    return f"{written}{MARK}\n{head}{''.join(rows)}"


def _row(field: Field) -> str:
    sizes = tuple(len(LABELS.get(dim, "ab")) for dim in field.places)
    columns = [f"`{column}`" for column in field.columns(sizes)]
    shown = columns if len(columns) <= 2 else [columns[0], "…", columns[-1]] if field.name != "hidden" else columns[:1]
    dims = ", ".join(field.dims) or "–"
    what = field.description.replace(
        "the shoulder at the origin", "the shoulder at the origin (of two arms, the midline)"
    )
    return f"| `{field.name}` | {dims} | {field.unit} | {', '.join(shown)} | {what} |\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
