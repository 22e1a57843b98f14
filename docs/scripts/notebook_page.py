"""Write examples/recordings.ipynb, a notebook, from the tutorial whose blocks are its cells.

Run it after a change of the tutorial: ``python docs/scripts/notebook_page.py``. A test compares the two.
"""

from __future__ import annotations

import json
import posixpath
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
SOURCE, PAGE = "docs/tutorials/recordings.md", ROOT / "examples" / "recordings.ipynb"


def page() -> str:
    """Return the whole notebook, without outputs."""
    text = (ROOT / SOURCE).read_text(encoding="utf-8")
    parts = re.split(r"```python\n(.*?)```\n", text, flags=re.DOTALL)
    # Text and code take turns.
    cells = [_cell(number, "code" if number % 2 else "markdown", part) for number, part in enumerate(parts)]
    notebook = {
        "cells": [cell for cell in cells if cell["source"]],
        "metadata": {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    return json.dumps(notebook, indent=1, ensure_ascii=False) + "\n"


def _cell(number: int, kind: str, text: str) -> dict[str, Any]:
    if kind == "markdown":
        text = re.sub(r"\]\((?!\w+:)([^)#]+)", lambda link: f"]({_from_examples(link[1])}", text)
    cell: dict[str, Any] = {
        "cell_type": kind,
        "id": f"cell-{number}",
        "metadata": {},
        "source": text.strip().splitlines(keepends=True),
    }
    return cell | {"execution_count": None, "outputs": []} if kind == "code" else cell


def _from_examples(link: str) -> str:
    return posixpath.relpath(posixpath.join(posixpath.dirname(SOURCE), link), "examples")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
