"""What a study still has to do, and what that will cost: told before it begins."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from bilateral_rl.study.grid import Grid


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
    to_train = [t for t in dict.fromkeys(table.training for table in missing) if not t.is_made(folder)]
    return Step(
        name,
        networks=sum(training.config.seeds for training in trainings),
        to_train=sum(training.config.seeds for training in to_train),
        protocols=tuple(dict.fromkeys(table.name for table in tables)),
        tables=len(tables),
        to_measure=len(missing),
        seconds=sum(grid.seconds_left(training, folder) for training in trainings),
    )
