"""Tables in CSV files, which somebody else may have written."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from bilateral_rl.io import files
from bilateral_rl.io.errors import UserError

LARGEST_TABLE, LONGEST_HEADER = 2**25, 2**12
"""Bytes of a table and of its first line: far beyond use."""
SMALLEST_NUMBER, LARGEST_NUMBER = 1e-30, 1e30
"""Of any measure but 0, whatever its sign: statistics take powers of it."""


def read_table(path: Path, kinds: Mapping[str, type]) -> pd.DataFrame:
    """Columns of the table that a CSV file holds.

    Args:
        path: the file; links may not lead out of its folder.
        kinds: of the columns: str, bool, int (from 0 on), or float (nan where there is no finite number).

    Raises:
        FileNotFoundError: it is not there.
        UserError: it cannot be read, or is no such table.
    """
    content = files.read(path, LARGEST_TABLE, within=path.parent)
    if len(content.partition(b"\n")[0]) > LONGEST_HEADER:
        raise UserError(f"{path} is damaged: its first line is no list of columns.")
    try:
        with np.errstate(invalid="ignore"):
            table = pd.read_csv(io.BytesIO(content), dtype=kinds, usecols=kinds.__contains__, index_col=False)
        _check(table, kinds)
    except (ValueError, OverflowError) as error:
        raise UserError(f"{path} is damaged: {str(error).strip()}.") from None
    missing = [name for name in kinds if name not in table]
    if missing:
        raise UserError(f"{path} is no such table: its columns must be {', '.join(kinds)}, but it lacks {missing[0]}.")
    infinite = [name for name, kind in kinds.items() if kind is float and np.isinf(table[name]).any()]
    return table.assign(**{name: table[name].replace([np.inf, -np.inf], np.nan) for name in infinite})


def _check(table: pd.DataFrame, kinds: Mapping[str, type]) -> None:
    for name in table:
        values, kind = table[name], kinds[str(name)]
        if kind is str and values.isna().any():
            raise ValueError(f"words are missing in {name}")
        if kind is int and (values < 0).any():
            raise ValueError(f"numbers below 0 in {name}")
        if kind is float:
            sizes = values[np.isfinite(values) & (values != 0)].abs()
            if not sizes.between(SMALLEST_NUMBER, LARGEST_NUMBER).all():
                raise ValueError(f"numbers out of range in {name}")
