"""Results of studies as one long table: a row a value, so that tables, tests and figures all read the same."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from bilateral_rl.analysis.protocols import RETRAINED, Protocol
from bilateral_rl.config.catalogue import ALGORITHMS, MAX_SEEDS, MODELS
from bilateral_rl.io.csv_tables import column_names, read_table
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import INTACT, LESIONS
from bilateral_rl.vocabulary import PENALTIES

TRAINED, FRESH = "trained", "fresh"
"""The networks of a run, and their control: freshly initialized ones of the same model, seed, lesion and trials."""
NETWORKS = (TRAINED, FRESH)

COLUMNS = (
    "model", "task", "algo", "seed", "lesion", "network", "protocol", "retrain", "epochs", "learning_rate",
    "penalty", "penalty_coefficient", "optimizer", "trials", "metric", "value",
)  # fmt: skip
"""Columns of the table: ``lesion`` is "intact" or a lesion's name, ``network`` one of :data:`NETWORKS`, ``protocol``
the name of what followed the lesion (:class:`~bilateral_rl.analysis.protocols.Protocol`), and the columns from
``retrain`` to ``trials`` what was really done then; ``metric`` is a name that :mod:`bilateral_rl.analysis.metrics`
knows, ``value`` the mean over a seed's trials in the metric's unit (NaN where no trial has one)."""
TREATMENT = COLUMNS[COLUMNS.index("network") : COLUMNS.index("metric")]
"""Columns that say which networks, and what followed the lesion."""
KEY = ("model", "task", "algo", "seed", "lesion", "network", "protocol", "metric")
"""Columns that together name a value."""

_NUMBERS = {"seed": int, "epochs": int, "learning_rate": float, "penalty_coefficient": float, "value": float}
_KINDS: dict[str, type] = dict.fromkeys(COLUMNS, str) | _NUMBERS
_OLD_KINDS: dict[str, type] = {
    "model": str, "task": str, "algo": str, "seed": int, "lesion": str, "retrained": bool,
    "metric": str, "value": float,
}  # fmt: skip
"""Columns of version 0.1.0, which knew one protocol and no control."""
_NOTHING, _UNKNOWN = "none", "unknown"
_WORDS: dict[str, tuple[str, ...]] = {
    "model": tuple(MODELS),
    "algo": tuple(ALGORITHMS),
    "lesion": (INTACT, *LESIONS),
    "network": NETWORKS,
    "retrain": tuple(RETRAINED),
    "penalty": (*PENALTIES, _NOTHING, _UNKNOWN),
    "optimizer": ("fresh", "continued", _NOTHING),
    "trials": ("new", "training", _NOTHING),
}
"""What each column may hold."""


@dataclass(frozen=True)
class State:
    """The networks of one model that learned one task, one a seed: intact or lesioned, and what followed."""

    task: str
    """Id of the task."""
    model: str
    """Label in the ``model`` column."""
    lesion: str = INTACT
    """Name of the lesion, or "intact"."""
    protocol: str = Protocol("none").name
    """Name of the protocol that followed the lesion; the intact network can be retrained, too."""
    network: str = TRAINED
    """One of :data:`NETWORKS`."""

    def after(self, lesion: str) -> State:
        """The same networks with ``lesion``, or "intact", in place of the one they have."""
        return replace(self, lesion=lesion)

    @property
    def control(self) -> State:
        """The same of networks that were freshly initialized: what a protocol brings where nothing was learned."""
        return replace(self, network=FRESH)

    def __str__(self) -> str:
        fresh = "fresh, " if self.network == FRESH else ""
        return f"{self.model} ({fresh}{self.lesion}, {protocol_words(self.protocol)})"


def treatment(protocol: Protocol, network: str = TRAINED, used: Protocol | None = None) -> tuple[object, ...]:
    """Return the values of the columns from ``network`` to ``trials``.

    Args:
        protocol: what follows the lesion.
        network: one of :data:`NETWORKS`.
        used: the same with the numbers that are really used; None where they are not known.
    """
    if protocol.retrain == "none":
        return network, protocol.name, "none", 0, float("nan"), _NOTHING, float("nan"), _NOTHING, _NOTHING
    used = used or protocol
    rate, coefficient = (float("nan") if x is None else x for x in (used.learning_rate, used.penalty_coefficient))
    numbers = (used.epochs, rate, used.penalty or _UNKNOWN, coefficient)
    return network, protocol.name, used.retrain, *numbers, used.optimizer, used.trials


def protocols_in(results: pd.DataFrame) -> list[str]:
    """Return the names of the protocols in a table: the plain ones in the order of their kinds, then all others."""
    present = list(dict.fromkeys(results["protocol"]))
    return [*(name for name in RETRAINED if name in present), *(name for name in present if name not in RETRAINED)]


def as_trained(results: pd.DataFrame) -> pd.Series:
    """Return which rows of a table are of networks as they were trained: not of the control, and not retrained."""
    return (results["network"] == TRAINED) & (results["retrain"] == "none")


def protocol_words(name: str) -> str:
    """Return a protocol's name in words, such as "everything retrained, 3 epochs"."""
    return Protocol.parse(name).words


def read_results(path: Path) -> pd.DataFrame:
    """Read a table of results from a CSV file; that of version 0.1.0 gets the columns that it lacks.

    Raises:
        UserError: the file cannot be read or holds no such table.
    """
    try:
        table = _read(path)
    except FileNotFoundError as error:
        raise UserError(f"Cannot read {path}: {error.strerror}.") from None
    for name, known in _WORDS.items():
        unknown = set(table[name]) - {*known}
        if unknown:
            raise UserError(f"{path} is no table of results: there is no {name} {min(unknown)!r}.")
    for name in set(table["protocol"]):
        try:
            Protocol.parse(name)
        except UserError as error:
            raise UserError(f"{path} is no table of results. {error}") from None
    if table["seed"].nunique() > MAX_SEEDS:
        raise UserError(f"{path} is no table of results: it holds more than {MAX_SEEDS:,} seeds.")
    if table.duplicated(list(KEY)).any():
        raise UserError(f"{path} is no table of results: it holds one value more than once.")
    return table


def _read(path: Path) -> pd.DataFrame:
    names = column_names(path)
    if "retrained" not in names or "protocol" in names:
        return read_table(path, _KINDS)[list(COLUMNS)]
    table = read_table(path, _OLD_KINDS)
    rows = [treatment(Protocol("output") if retrained else Protocol("none")) for retrained in table.pop("retrained")]
    treatments = pd.DataFrame(rows, columns=list(TREATMENT), index=table.index)
    kinds = {name: _KINDS[name] for name in TREATMENT}
    return pd.concat([table, treatments.astype(kinds)], axis=1)[list(COLUMNS)]


def by_seed(results: pd.DataFrame, metric: str, state: State) -> pd.Series:
    """Return the values of a metric of the networks in a state, by seed in rising order; empty if there are none.

    Raises:
        UserError: the results hold several values of one seed.
    """
    rows = np.arange(len(results))
    wanted = {"metric": metric, "protocol": state.protocol, "model": state.model, "task": state.task,
              "lesion": state.lesion, "network": state.network}  # fmt: skip
    for column, value in wanted.items():  # one after the other: what is left is soon a small part of a large table
        rows = rows[np.asarray(results[column].array[rows] == value)]
    seeds = pd.Index(results["seed"].array[rows], name="seed")
    values = pd.Series(results["value"].array[rows], index=seeds, name="value").sort_index()
    if values.index.has_duplicates:
        raise UserError(
            f"The results hold several values of {metric} in {state.task} for seed "
            f"{values.index[values.index.duplicated()][0]} of {state}; compare one algorithm and one run at a time, "
            "or give every run a label of its own."
        )
    return values
