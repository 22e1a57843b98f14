"""Tables in CSV files, which somebody else may have written."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from bilateral_rl.io import files
from bilateral_rl.io.errors import UserError

_LARGEST_TABLE, _LONGEST_HEADER = 2**25, 2**12
"""Largest table and longest first line that are read, in bytes: far beyond use."""
_SMALLEST_NUMBER, _LARGEST_NUMBER = 1e-30, 1e30
"""The magnitudes accepted, beside 0: statistics take powers of them."""


def read_table(path: Path, kinds: Mapping[str, type]) -> pd.DataFrame:
    """Read a table from a CSV file, as much of it as ``kinds`` names.

    Args:
        path: the file; no link may lead out of its folder.
        kinds: the type of each column: str, bool, int (0 or more), or float (NaN where there is no finite number).

    Returns:
        The table, with exactly these columns.

    Raises:
        FileNotFoundError: the file does not exist.
        UserError: it cannot be read, or holds no such table.
    """
    content = files.read(path, _LARGEST_TABLE, within=path.parent)
    if len(content.partition(b"\n")[0]) > _LONGEST_HEADER:
        raise UserError(f"{path} is damaged: its first line is no list of columns.")
    try:
        with np.errstate(invalid="ignore"):
            table = pd.read_csv(io.BytesIO(content), dtype=kinds, usecols=kinds.__contains__, index_col=False)
        for name in table:
            _check_column(str(name), table[name], kinds[str(name)])
    except (ValueError, OverflowError) as error:
        raise UserError(f"{path} is damaged: {str(error).strip()}.") from None
    missing = [name for name in kinds if name not in table]
    if missing:
        raise UserError(f"{path} is no such table: its columns must be {', '.join(kinds)}, but it lacks {missing[0]}.")
    infinite = [name for name, kind in kinds.items() if kind is float and np.isinf(table[name]).any()]
    return table.assign(**{name: table[name].replace([np.inf, -np.inf], np.nan) for name in infinite})


def column_names(path: Path) -> list[str]:
    """Return the words of a CSV file's first line, which may be none.

    Raises:
        FileNotFoundError: the file does not exist.
        UserError: it cannot be read.
    """
    first, _, _ = files.read(path, _LARGEST_TABLE, within=path.parent).partition(b"\n")
    return first[:_LONGEST_HEADER].decode(errors="replace").strip().split(",")


def _check_column(name: str, values: pd.Series, kind: type) -> None:
    """Raise a ValueError for values that pandas reads as this type but nobody can compute with."""
    if kind is str and values.isna().any():
        raise ValueError(f"words are missing in {name}")
    if kind is int and (values < 0).any():
        raise ValueError(f"numbers below 0 in {name}")
    if kind is float:
        magnitudes = values[np.isfinite(values) & (values != 0)].abs()
        if not magnitudes.between(_SMALLEST_NUMBER, _LARGEST_NUMBER).all():
            raise ValueError(f"numbers out of range in {name}")
