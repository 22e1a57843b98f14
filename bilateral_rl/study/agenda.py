"""What a study still has to do, and what that will cost: told before it begins."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from bilateral_rl.runs.folder import FINISHED
from bilateral_rl.study.costs import table_seconds, training_seconds
from bilateral_rl.study.grid import Grid, Training
from bilateral_rl.study.model_job import find_run


@dataclass(frozen=True)
class Step:
    """The trainings of the same settings, of all models and tasks that have such, and what is measured of them."""

    name: str
    """"base", or how their settings differ from the study's own."""
    networks: int
    """Number of networks."""
    to_train: int
    """Networks that are not trained yet."""
    protocols: tuple[str, ...]
    """Names of the lesion protocols, with whose combined lesions where these are not the study's."""
    tables: int
    """Number of tables of results."""
    to_measure: int
    """Tables that are not there yet."""
    seconds: float
    """What is left takes, on one core, to a factor of two (s)."""


def agenda(grid: Grid, folder: Path) -> list[Step]:
    """Return what a study comes to, and what of it is left to do in ``folder``."""
    names = dict.fromkeys(training.name for training in grid.tables)
    return [_step(name, grid, folder) for name in names]


def _step(name: str, grid: Grid, folder: Path) -> Step:
    trainings = [training for training in grid.tables if training.name == name]
    tables = [table for training in trainings for table in grid.tables[training]]
    missing = [table for table in tables if not (folder / table.path).is_file()]
    to_train = [t for t in dict.fromkeys(table.training for table in missing) if not _is_trained(t, folder)]
    seconds = sum(training_seconds(training.config) for training in to_train)
    seconds += sum(table_seconds(table.training.config, table.protocol) for table in missing)
    return Step(
        name,
        networks=sum(training.config.seeds for training in trainings),
        to_train=sum(training.config.seeds for training in to_train),
        protocols=tuple(dict.fromkeys(table.name for table in tables)),
        tables=len(tables),
        to_measure=len(missing),
        seconds=seconds,
    )


def _is_trained(training: Training, folder: Path) -> bool:
    run = find_run(folder / "runs", training.config)
    return run is not None and run.status().get("state") == FINISHED
