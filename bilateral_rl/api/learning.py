"""How a run's networks learned, and adapted, as tables."""

from __future__ import annotations

import pandas as pd

from bilateral_rl.analysis.block_table import BLOCKS, read_blocks
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
    return _of_run(table, run)


def adaptation_by_blocks(run: Run) -> pd.DataFrame:
    """Read how a run adapted to a field (:meth:`Run.blocks`). Raises UserError if it does not say, or is damaged."""
    try:
        table = read_blocks(run.path / BLOCKS)
    except FileNotFoundError:
        raise UserError(
            f"{run.path} has no blocks: they are of trainings whose experiment has a field, as --task curl_field."
        ) from None
    return _of_run(table, run)


def _of_run(table: pd.DataFrame, run: Run) -> pd.DataFrame:
    """Return the rows of the run's seeds, with what it is in the first columns."""
    config = run.config
    for name, value in (("algo", config.algo), ("task", config.task), ("model", config.model)):
        table.insert(0, name, value)
    return table[table["seed"].isin(run.seeds)].reset_index(drop=True)
