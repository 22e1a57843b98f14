"""The table of a lesion probe: what a network and its control do in every state as the network learns."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from bilateral_rl.analysis.metric import ROLES
from bilateral_rl.analysis.results import FRESH, NETWORKS, TRAINED
from bilateral_rl.analysis.specialization import ALONE
from bilateral_rl.analysis.trial_records import OF_REACHES
from bilateral_rl.io.csv_tables import column_names, read_table
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import INTACT
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.vocabulary import SIDES

PROBE = "lesion_probe.csv"
"""File in a run's folder with a row a step and state, the control's first, and a column a measure."""
MEASURES = (
    "goal_completion_percent", "speed_to_goal_cm_per_step", "time_in_goal_steps", "final_error_cm",
    "return_dominant", "return_non_dominant",
)  # fmt: skip
"""Measures of :meth:`~bilateral_rl.analysis.trials.TrialRecord.summary` that are kept."""
OF_HANDS = frozenset(
    f"{name}_of_{hand}_{role}"
    for name, hand, role in itertools.product(MEASURES[:4], SIDES, ROLES)
    if role == "reach" or name not in OF_REACHES
)
"""Those that tables of two arms have beside them, by hand and role."""

_OLD_KINDS: dict[str, type] = {"timesteps": int, "lesion": str} | dict.fromkeys(MEASURES, float)
"""Columns of version 0.1.0, which had no control."""
_KINDS = {"network": str, **_OLD_KINDS}
COLUMNS = tuple(_KINDS)
"""Columns of the table; ``network`` is one of :data:`~bilateral_rl.analysis.results.NETWORKS`."""
_STATES_NEEDED = {INTACT, *ALONE.values()}
"""States that every step must have, whatever the network."""


def read_probe(path: Path) -> pd.DataFrame:
    """Read the table in a ``lesion_probe.csv``, which may be somebody else's; those of version 0.1.0 have no control.

    Raises:
        FileNotFoundError: it is not there.
        UserError: it is damaged.
    """
    names = column_names(path)
    kinds = _KINDS | {name: float for name in names if name in OF_HANDS}
    table = read_table(path, kinds) if "network" in names else read_table(path, _OLD_KINDS).assign(network=TRAINED)
    at = ["network", "timesteps"]
    states = table.groupby(at)["lesion"].agg(frozenset)
    fresh = table.loc[table["network"] == FRESH, "timesteps"]
    wrong = bool(set(table["network"]) - {*NETWORKS}) or bool(set(fresh) - {0})
    if wrong or table.duplicated([*at, "lesion"]).any() or any(_STATES_NEEDED - of_one for of_one in states):
        raise UserError(f"{path} is damaged: it must have each state once at each step.")
    return table[[*_KINDS, *(name for name in table if name not in _KINDS)]]


def read_probes(runs: Iterable[RunFolder]) -> pd.DataFrame:
    """Read the tables of those of ``runs`` that were probed, with columns ``model`` and ``seed``; empty if none was.

    Raises:
        UserError: a damaged table, or a seed of a model that is there twice.
    """
    tables: dict[tuple[str, int], pd.DataFrame] = {}
    for run in runs:
        if (run.path / PROBE).exists():
            config = run.config()
            if (config.model, config.seed) in tables:
                raise UserError(f"{run.path} is seed {config.seed} of {config.model} once more; give each seed once.")
            table = read_probe(run.path / PROBE).assign(model=config.model, seed=config.seed)
            tables[config.model, config.seed] = table
    return pd.concat(tables.values(), ignore_index=True) if tables else pd.DataFrame()
