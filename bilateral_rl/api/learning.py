"""How a run's networks learned, as a table."""

from __future__ import annotations

import pandas as pd

from bilateral_rl.api.run import Run
from bilateral_rl.io.csv_tables import column_names, read_table
from bilateral_rl.io.errors import UserError
from bilateral_rl.study.plan import is_supervised

_COUNTS = ("seed", "timesteps", "epoch")
"""Columns of whole numbers."""


def learning_curves(run: Run) -> pd.DataFrame:
    """Read how a run learned (:meth:`Run.curves`). Raises UserError if it does not say, or is damaged."""
    config = run.config
    path = run.path / ("epochs.csv" if is_supervised(config.algo) else "evaluations.csv")
    try:
        names = column_names(path)
        table = read_table(path, {name: int if name in _COUNTS else float for name in names})
    except FileNotFoundError:
        raise UserError(f"{run.path} does not say how it learned: it has no {path.name}.") from None
    if "seed" not in table:
        table.insert(0, "seed", config.seed)
    for name, value in (("algo", config.algo), ("task", config.task), ("model", config.model)):
        table.insert(0, name, value)
    return table[table["seed"].isin(run.seeds)].reset_index(drop=True)
