"""Results of studies as one long table: a row a value, so that tables, tests and figures all read the same."""

from __future__ import annotations

import pandas as pd

COLUMNS = ("model", "task", "algo", "seed", "lesion", "retrained", "metric", "value")
"""Of the table: ``lesion`` is "intact" or a lesion's name, ``retrained`` whether the output layer was trained for one
epoch after it, ``metric`` a name that :mod:`bilateral_rl.analysis.metrics` knows, ``value`` the mean over a seed's
trials in the metric's unit (nan where no trial has one)."""

INTACT = "intact"


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
