"""Results of studies as one long table: a row a value, so that tables, tests and figures all read the same."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from bilateral_rl.config.catalogue import ALGORITHMS, MAX_SEEDS, MODELS
from bilateral_rl.envs.tasks import TASKS
from bilateral_rl.io.csv_tables import read_table
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import INTACT, LESIONS

COLUMNS = ("model", "task", "algo", "seed", "lesion", "retrained", "metric", "value")
"""Columns of the table: ``lesion`` is "intact" or a lesion's name, ``retrained`` whether the output layer was trained
for one epoch after it, ``metric`` a name that :mod:`bilateral_rl.analysis.metrics` knows, ``value`` the mean over a
seed's trials in the metric's unit (NaN where no trial has one)."""

_KINDS = dict(zip(COLUMNS, (str, str, str, int, str, bool, str, float), strict=True))

RETRAINING: dict[bool, str] = {False: "without retraining", True: "retrained"}
"""What may follow a lesion, in words, in the order of tables and figures."""


@dataclass(frozen=True)
class State:
    """The networks of one model that learned one task, one a seed: intact or lesioned, and retrained or not."""

    task: str
    """Id of the task."""
    model: str
    """Label in the ``model`` column."""
    lesion: str = INTACT
    """Name of the lesion, or "intact"."""
    retrained: bool = False
    """Whether the output layer was trained for an epoch after the lesion; the intact network can be, too."""

    def after(self, lesion: str) -> State:
        """The same networks with ``lesion``, or "intact", in place of the one they have."""
        return replace(self, lesion=lesion)

    def __str__(self) -> str:
        return f"{self.model} ({self.lesion}, {RETRAINING[self.retrained]})"


def read_results(path: Path) -> pd.DataFrame:
    """Read a table of results from a CSV file.

    Raises:
        UserError: the file cannot be read or holds no such table.
    """
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


def by_seed(results: pd.DataFrame, metric: str, state: State) -> pd.Series:
    """Return the values of a metric of the networks in a state, by seed in rising order; empty if there are none.

    Raises:
        UserError: the results hold several values of one seed.
    """
    rows = results[
        (results["metric"] == metric)
        & (results["task"] == state.task)
        & (results["model"] == state.model)
        & (results["lesion"] == state.lesion)
        & (results["retrained"] == state.retrained)
    ]
    values = rows.set_index("seed")["value"].sort_index()
    if values.index.has_duplicates:
        raise UserError(
            f"The results hold several values of {metric} in {state.task} for seed "
            f"{values.index[values.index.duplicated()][0]} of {state}; compare one algorithm and one run at a time, "
            "or give every run a label of its own."
        )
    return values
