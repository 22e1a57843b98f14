"""What a study's jobs left in its folder: the table of results, runs, learning curves."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from bilateral_rl.analysis import results
from bilateral_rl.analysis.results import COLUMNS
from bilateral_rl.figures.curves import FINAL_ERROR, PREFERRED, VALIDATION_LOSS
from bilateral_rl.io.csv_tables import read_table
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.study.folder import RUNS
from bilateral_rl.study.model_job import find_run, is_run_of
from bilateral_rl.study.plan import is_supervised
from bilateral_rl.study.provenance import is_stale, read_source, source_path
from bilateral_rl.study.trainings import Table

_MOST_POINTS, _MOST_VALUES = 10**5, 10**7
"""Largest number of points of a learning curve, in time and over all seeds: far more than can be seen."""


def read_result(path: Path) -> pd.DataFrame:
    """Read the long table (:mod:`bilateral_rl.analysis.results`) of one training.

    Raises:
        UserError: it is damaged, or of weights that its run no longer has.
    """
    try:
        table, source = results.read_results(path), read_source(path)
        run_path = source_path(source, path.parent)
        if run_path is not None and run_path.is_dir() and is_stale(source, RunFolder(run_path)):
            raise UserError(f"{path} is of weights that {run_path} no longer has.")
    except UserError as error:
        raise UserError(f"{str(error).rstrip('.')}; remove it and call the command again.") from None
    return table


def refuse_other_settings(folder: Path, tables: Iterable[Table]) -> None:
    """Refuse to go on with a study whose trainings had other settings, as defaults change from version to version.

    Args:
        folder: of the study.
        tables: those that it has or will have; of those that do not say which run they are of, nobody knows.

    Raises:
        UserError: a table that is there is of a run by other settings than those of its training.
    """
    for table in tables:
        path = folder / table.path
        source = read_source(path) if path.is_file() else {}
        run_path = source_path(source, path.parent)
        if run_path is not None and run_path.is_dir() and not is_run_of(RunFolder(run_path), table.training.config):
            raise UserError(
                f"{path} is of {run_path}, which version {source.get('version', '0.1.0')} made by other settings than "
                "this study would now; choose another --out, or go on with that version."
            )


def unsourced(results_paths: Iterable[Path]) -> list[Path]:
    """The tables of trainings that do not say which weights they are of, as those of version 0.1.0."""
    return [path for path in results_paths if path.is_file() and "weights_hash" not in read_source(path)]


class StudyResults:
    """The tables of results in a study's folder, each read once.

    Args:
        folder: the study's.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._read: dict[Table, pd.DataFrame] = {}

    def of(self, tables: Iterable[Table]) -> pd.DataFrame:
        """Return one long table of those that are there. Raises UserError as :func:`read_result`."""
        there = [self._one(table) for table in tables if (self._folder / table.path).is_file()]
        return pd.concat(there, ignore_index=True) if there else pd.DataFrame(columns=list(COLUMNS))

    def named(self, tables: Iterable[Table]) -> pd.DataFrame:
        """Return the same with columns that tell trainings, combined lesions and springs between hands apart."""
        tables = list(tables)
        named = [self.of([table]).assign(**_apart(table)) for table in tables]
        with_spring = any(table.spring is not None for table in tables)
        columns = ["training", "lesions_of", *(["spring"] if with_spring else []), *COLUMNS]
        there = [table for table in named if len(table)]
        return pd.concat(there, ignore_index=True)[columns] if there else pd.DataFrame(columns=columns)

    def _one(self, table: Table) -> pd.DataFrame:
        if table not in self._read:
            self._read[table] = read_result(self._folder / table.path)
        return self._read[table]


def _apart(table: Table) -> dict[str, Any]:
    """What tells results of one state apart, by column."""
    return {"training": table.training.name, "lesions_of": table.lesions, "spring": table.spring}


def runs_of(folder: Path, tables: Iterable[Table]) -> dict[str, list[RunFolder]]:
    """Find the runs of the trainings of which there are results, by model."""
    trainings = dict.fromkeys(table.training for table in tables if (folder / table.path).is_file())
    runs: dict[str, list[RunFolder]] = {}
    for training in trainings:
        run = find_run(folder / RUNS, training.config)
        if run is not None:
            runs.setdefault(training.config.model, []).append(run)
    return runs


def learning_history(runs: Mapping[str, list[RunFolder]]) -> pd.DataFrame:
    """Read how the networks learned: a row a model, seed and epoch, or evaluation. Raises UserError if damaged."""
    tables = [_history(run).assign(model=model) for model, of_model in runs.items() for run in of_model]
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()


def _history(run: RunFolder) -> pd.DataFrame:
    config = run.config()
    supervised = is_supervised(config.algo)
    name, counts = ("epochs.csv", ("seed", "epoch")) if supervised else ("evaluations.csv", ("timesteps",))
    measures = [measure.name for measure in (VALIDATION_LOSS if supervised else FINAL_ERROR, *PREFERRED.values())]
    try:
        table = read_table(run.path / name, dict.fromkeys(counts, int) | dict.fromkeys(measures, float))
    except FileNotFoundError:
        raise UserError(f"{run.path} does not say how it learned: it has no {name}.") from None
    table = table if supervised else table.assign(seed=config.seed)
    points, seeds = table[counts[-1]].nunique(), set(table["seed"])
    if not seeds <= set(config.all_seeds) or points > _MOST_POINTS or points * len(seeds) > _MOST_VALUES:
        raise UserError(f"{run.path / name} is damaged: it is not about the seeds of its run, or far too long.")
    return table
