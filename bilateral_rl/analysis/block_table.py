"""The table of an adaptation by blocks: what networks do with a field, without it and in a channel as they learn."""

from __future__ import annotations

import itertools
from pathlib import Path

import pandas as pd

from bilateral_rl.analysis.metric import OF
from bilateral_rl.envs.experiments.assignment import Condition
from bilateral_rl.envs.experiments.experiment import Experiment
from bilateral_rl.io.csv_tables import column_names, read_table
from bilateral_rl.io.errors import UserError
from bilateral_rl.vocabulary import SIDES, Side

BLOCKS = "blocks.csv"
"""File in a run's folder with a row a seed, block and condition, and a column a measure."""
BLOCK_CONDITIONS: dict[str, Condition] = {"field": "field", "null_field": "null", "channel": "channel"}
"""The conditions of every test: in the field, without it (the after-effect), and in a channel in place of it.

By their words in the file, as many readers of CSV take the word "null" for a value that is missing.
"""
MEASURES = (
    "goal_completion", "final_error", "perpendicular_deviation", "signed_deviation", "deviation_at_peak_speed",
    "channel_compensation", "channel_peak_force",
)  # fmt: skip
"""Metrics that are kept (:mod:`bilateral_rl.analysis.metrics`), that of the goal at the run's own radius."""
OF_HANDS: dict[str, tuple[str, Side]] = {
    f"{name}{OF}{hand}": (name, hand) for hand, name in itertools.product(SIDES, MEASURES)
}
"""The measures of each hand alone, by the columns that tables of two arms have for them."""

_KINDS = {"seed": int, "block": int, "done": int, "condition": str} | dict.fromkeys(MEASURES, float)
COLUMNS = tuple(_KINDS)
"""Columns of every table: ``block`` counts from 0, before any learning, ``done`` in updates or environment steps."""


def in_conditions(experiment: Experiment) -> dict[str, Experiment]:
    """Return an experiment with a field in each condition, by its word in the file; a hold has no channel."""
    names = [name for name in BLOCK_CONDITIONS if name != "channel" or not experiment.stays]
    return {name: experiment.with_condition(BLOCK_CONDITIONS[name]) for name in names}


def read_blocks(path: Path) -> pd.DataFrame:
    """Read the table in a ``blocks.csv``, which may be somebody else's; conditions are "field", "null" and "channel".

    Raises:
        FileNotFoundError: it is not there.
        UserError: it is damaged.
    """
    of_hands = [name for name in column_names(path) if name in OF_HANDS]
    table = read_table(path, _KINDS | dict.fromkeys(of_hands, float))
    at = ["seed", "block", "condition"]
    if set(table["condition"]) - {*BLOCK_CONDITIONS} or table.duplicated(at).any():
        raise UserError(f"{path} is damaged: it must have each condition once in each block of a seed.")
    return table[[*COLUMNS, *of_hands]].assign(condition=table["condition"].map(BLOCK_CONDITIONS))
