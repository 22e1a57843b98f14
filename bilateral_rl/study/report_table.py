"""A table of a study's report."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd


@dataclass(frozen=True)
class ReportTable:
    """Text in rows and columns."""

    name: str
    """Name of its file, without the suffix."""
    title: str
    columns: list[str]
    rows: list[list[str]]
    note: str = ""
    """What readers must know, a paragraph a line."""
    of_words: tuple[int, ...] = ()
    """Columns that hold sentences, not numbers, by their index from 0."""

    def frame(self) -> pd.DataFrame:
        """Return the same as a data frame."""
        return pd.DataFrame(self.rows, columns=self.columns)
