"""What readings of the paper come to: the distinct trainings, and the tables of results that are taken of each.

Readings that differ only after the training share it, and those that differ only in how results are judged share the
results, too. Each table is a file of its own, so that a study goes on with more readings where it was.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from bilateral_rl.config.parse import Values
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.io.errors import UserError
from bilateral_rl.study.costs import table_seconds, training_seconds
from bilateral_rl.study.fit import check_fits
from bilateral_rl.study.folder import RUNS
from bilateral_rl.study.jobs import Job
from bilateral_rl.study.plan import TRAIN_AND_MEASURE, Study
from bilateral_rl.study.reading_tables import AnyReading, tables_of
from bilateral_rl.study.trainings import Table, Training, training_name


class Grid:
    """The trainings and tables of a study under several readings, each once.

    Args:
        study: the study.
        readings: readings of what it is about; their names differ.
        threads: CPU threads of each training.

    Attributes:
        study, readings: as given.
        tables: all tables by training.

    Raises:
        UserError: settings that cannot be, or a reading that the study's profile or algorithm leaves no room for.
    """

    def __init__(self, study: Study, readings: Sequence[AnyReading], threads: int = 1) -> None:
        self.study, self.readings = study, list(readings)
        for reading in readings:
            check_fits(reading, study)
        self._threads = threads
        self._base = {_key(config): config for config in study.configs(threads)}
        self._trainings: dict[str, list[Training]] = {}
        self._of = {reading.name: list(self._tables_of(reading)) for reading in readings}
        self.tables: dict[Training, list[Table]] = {}
        for table in dict.fromkeys(table for tables in self._of.values() for table in tables):
            self.tables.setdefault(table.training, []).append(table)

    @property
    def all_tables(self) -> list[Table]:
        """Every table, each once."""
        return [table for tables in self.tables.values() for table in tables]

    def tables_of(self, reading: AnyReading) -> list[Table]:
        """The tables by which a reading judges: after its protocol, and without retraining."""
        return self._of[reading.name]

    def seconds_left(self, training: Training, folder: Path) -> float:
        """Return what a training and its tables still take, on one core and to a factor of two (s)."""
        missing = [table for table in self.tables[training] if not (folder / table.path).is_file()]
        if not missing:
            return 0.0
        to_train = 0.0 if training.is_made(folder) else training_seconds(training.config)
        return to_train + sum(table_seconds(training.config, table.protocol, table.lesions_tested) for table in missing)

    def jobs(self, folder: Path) -> list[Job]:
        """One job for each training, which trains and makes the tables that are not in ``folder`` yet."""
        return [self._job(training, tables, folder) for training, tables in self.tables.items()]

    def _job(self, training: Training, tables: Sequence[Table], folder: Path) -> Job:
        missing = [table for table in tables if not (folder / table.path).is_file()]
        arguments: dict[str, Any] = {
            "config": training.config.to_values(),
            "tables": [{"lesions": table.settings | self.study.tests, "result": table.path} for table in missing],
            "runs": training.runs,
            "known_runs": RUNS,
        }
        cost = self.seconds_left(training, folder)
        result = [*tables, *missing][-1].path  # the one that is written last, if any is
        return Job(training.job_name, TRAIN_AND_MEASURE, result, arguments, max(cost, 1.0), self._threads)

    def _tables_of(self, reading: AnyReading) -> Iterator[Table]:
        for training in self._trainings_of(reading):
            yield from tables_of(reading, training, self.study.profile)

    def _trainings_of(self, reading: AnyReading) -> list[Training]:
        settings = {task: reading.training_of(task) for task in self.study.tasks}
        key = repr(settings)
        if key not in self._trainings:
            self._trainings[key] = self._new_trainings(reading, settings)
        return self._trainings[key]

    def _new_trainings(self, reading: AnyReading, settings: Mapping[str, Values]) -> list[Training]:
        try:
            configs = self.study.configs(self._threads, settings)
        except UserError as error:
            raise UserError(f"The reading {reading.name} cannot be trained. {error}") from None
        return [Training(training_name(config, self._base[_key(config)]), config) for config in configs]


def _key(config: TrainConfig) -> tuple[str, str, int]:
    return config.task, config.model, config.seed
