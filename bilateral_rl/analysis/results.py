"""Results of studies as one long table: a row a value, so that tables, tests and figures all read the same."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from bilateral_rl.errors import UserError

COLUMNS = ("model", "task", "algo", "seed", "lesion", "retrained", "metric", "value")
"""Of the table: ``lesion`` is "intact" or a lesion's name, ``retrained`` whether the output layer was trained for one
epoch after it, ``metric`` a name that :mod:`bilateral_rl.analysis.metrics` knows, ``value`` the mean over a seed's
trials in the metric's unit (nan where no trial has one)."""

INTACT = "intact"


def read_results(path: Path) -> pd.DataFrame:
    """The table that a CSV file holds. Raises UserError if it cannot be read or is no such table."""
    try:
        table = pd.read_csv(path)
    except OSError as error:
        raise UserError(f"Cannot read {path}: {error.strerror}.") from None
    except ValueError as error:
        raise UserError(f"{path} is damaged: {str(error).strip()}.") from None
    missing = [name for name in COLUMNS if name not in table]
    if missing or table["retrained"].dtype != bool:
        raise UserError(f"{path} is no table of results: its columns must be {', '.join(COLUMNS)}.")
    return table


def by_seed(
    results: pd.DataFrame, metric: str, task: str, model: str, lesion: str = INTACT, retrained: bool = False
) -> pd.Series:
    """The values of one metric of one model in one state, by seed in rising order; empty if there are none."""
    rows = results[
        (results["metric"] == metric)
        & (results["task"] == task)
        & (results["model"] == model)
        & (results["lesion"] == lesion)
        & (results["retrained"] == retrained)
    ]
    return rows.set_index("seed")["value"].sort_index()
