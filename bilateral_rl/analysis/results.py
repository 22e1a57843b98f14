"""Results of studies as one long table: a row a value, so that tables, tests and figures all read the same."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from bilateral_rl.config.catalogue import ALGORITHMS, MAX_SEEDS, MODELS
from bilateral_rl.envs.tasks import TASKS
from bilateral_rl.io.csv_tables import read_table
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import INTACT, LESIONS

COLUMNS = ("model", "task", "algo", "seed", "lesion", "retrained", "metric", "value")
"""Of the table: ``lesion`` is "intact" or a lesion's name, ``retrained`` whether the output layer was trained for one
epoch after it, ``metric`` a name that :mod:`bilateral_rl.analysis.metrics` knows, ``value`` the mean over a seed's
trials in the metric's unit (nan where no trial has one)."""

_KINDS = dict(zip(COLUMNS, (str, str, str, int, str, bool, str, float), strict=True))


def read_results(path: Path) -> pd.DataFrame:
    """The table that a CSV file holds. Raises UserError if it cannot be read or is no such table."""
    try:
        table = read_table(path, _KINDS)
    except FileNotFoundError as error:
        raise UserError(f"Cannot read {path}: {error.strerror}.") from None
    for name, known in (("model", MODELS), ("task", TASKS), ("algo", ALGORITHMS), ("lesion", (INTACT, *LESIONS))):
        unknown = set(table[name]) - {*known}
        if unknown:
            raise UserError(f"{path} is no table of results: there is no {name} {min(unknown)!r}.")
    if table["seed"].nunique() > MAX_SEEDS:
        raise UserError(f"{path} is no table of results: it holds more than {MAX_SEEDS:,} seeds.")
    if table.duplicated(list(COLUMNS[:-1])).any():
        raise UserError(f"{path} is no table of results: it holds one value more than once.")
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
