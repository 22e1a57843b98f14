"""Trainings over a grid of settings, measured side by side."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from bilateral_rl.analysis.results import TREATMENT
from bilateral_rl.config.code_tasks import is_allowed
from bilateral_rl.config.parse import Values, merge, parse_overrides, plain_values
from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.envs.experiments.files import find_experiment, is_file
from bilateral_rl.io.errors import UserError
from bilateral_rl.study.jobs import Job
from bilateral_rl.study.outcome import read_result
from bilateral_rl.study.plan import TRAIN_AND_MEASURE, cost_of
from bilateral_rl.vocabulary import TEST_TRIALS

MAX_POINTS = 1_000
"""Largest number of points of a grid: more is a slip of the finger."""


@dataclass(frozen=True)
class Sweep:
    """A training at every point of a grid.

    Raises:
        UserError: no grid, one of too many points, or settings that name the algorithm.
    """

    algo: str
    grid: Mapping[str, Sequence[str]]
    """Values, as ``--set`` takes them, by the name of the setting; models and tasks are settings too."""
    overrides: Values = field(default_factory=dict)
    """Settings of every training, as ``--set`` gives them."""
    trials: int = TEST_TRIALS
    """Trials of each test."""

    def __post_init__(self) -> None:
        n = math.prod(map(len, self.grid.values()))
        if "algo" in {**self.grid, **self.overrides}:
            raise UserError("The algorithm of a sweep is that of --algo; leave algo out of --grid and --set.")
        if not self.grid or not 1 <= n <= MAX_POINTS:
            raise UserError(f"A sweep needs a --grid of 1 to {MAX_POINTS:,} points, got {n if self.grid else 'none'}.")

    def points(self) -> list[dict[str, str]]:
        """Every combination: a value, as text, by setting."""
        return [dict(zip(self.grid, values, strict=True)) for values in itertools.product(*self.grid.values())]

    def config(self, point: Mapping[str, str], threads: int = 1) -> TrainConfig:
        """The configuration of the training at a point. Raises UserError for settings that cannot be."""
        layers = [{"threads": threads}, self.overrides, parse_overrides([f"{k}={v}" for k, v in point.items()])]
        values: Values = {}
        for layer in layers:
            values = merge(values, layer)
        return resolve(self.algo, values.get("task"), [values])

    def jobs(self, threads: int = 1) -> list[Job]:
        """One job for each point. Raises UserError for settings that cannot be, and for two points that are one."""
        jobs: dict[str, Job] = {}
        trainings: dict[str, str] = {}
        for point in self.points():
            name, config = point_name(point), self.config(point, threads)
            same = trainings.setdefault(repr(config), name)
            if name in jobs or same != name:
                raise UserError(f"The grid holds {same} more than once; give every value once.")
            jobs[name] = self._job(point, config, threads)
        return list(jobs.values())

    def to_values(self) -> Values:
        """The contents of ``study.yaml``."""
        grid = {name: list(values) for name, values in self.grid.items()}
        values = {"sweep": grid, "algo": self.algo, "overrides": self.overrides, "trials": self.trials}
        return values | ({"experiments": experiments} if (experiments := self._experiments()) else {})

    def _experiments(self) -> Values:
        """What the experiments are whose files are tasks, so that with another content it is another sweep."""
        tasks = [*self.grid.get("task", ()), self.overrides.get("task", "")]
        return {task: plain_values(find_experiment(task)) for task in tasks if isinstance(task, str) and is_file(task)}

    def _job(self, point: Mapping[str, str], config: TrainConfig, threads: int) -> Job:
        name, result = point_name(point), result_file(point)
        lesions: dict[str, Any] = {
            "lesions": ["intact"], "protocols": [{"retrain": "none"}], "control": False, "trials": self.trials
        }  # fmt: skip
        tables = [{"lesions": lesions, "result": result}]
        arguments = {"config": config.to_values(), "tables": tables, "runs": f"runs/{name}"}
        arguments |= {"code": [config.task]} if is_allowed(config.task) else {}
        cost = cost_of(config) * len(config.all_seeds)
        return Job(name, TRAIN_AND_MEASURE, result, arguments, cost, threads)


_COMMA = re.compile(r",(?![^\[]*\])")
"""A comma that is not within brackets."""


def parse_grid(items: Sequence[str]) -> dict[str, list[str]]:
    """Read ``["bptt.penalty=weights,activity"]`` as values by setting, of which one may be a list in brackets.

    Raises:
        UserError: text of another form.
    """
    grid: dict[str, list[str]] = {}
    for item in items:
        name, equals, values = item.partition("=")
        texts = [text.strip() for text in _COMMA.split(values)]
        if not name or not equals or not all(text and text.count("[") == text.count("]") for text in texts):
            raise UserError(
                "--grid takes key=value,value,…, such as bptt.penalty=weights,activity or "
                f"network.critic_arch=[32,32],[64], not {item!r}."
            )
        if name in grid:
            raise UserError(f"--grid has {name} twice; give all its values at once.")
        grid[name] = texts
    return grid


def point_name(point: Mapping[str, str]) -> str:
    """The name of a point's job and folder: the last part of each setting's name with its value."""
    parts = [f"{name.rpartition('.')[2]}={value}" for name, value in point.items()]
    return re.sub(r"[^\w.=,+-]", "_", ",".join(parts))


def result_file(point: Mapping[str, str]) -> str:
    """The file of the results of a point, relative to the sweep's folder."""
    return f"results/{point_name(point)}.csv"


def read_sweep(sweep: Sweep, folder: Path) -> pd.DataFrame:
    """Read the long table of the points that are done.

    It has its own columns but for those on what followed a lesion, and ``point``, the point's name, and one for each
    setting of the grid that is not among them already.

    Raises:
        UserError: a table is damaged, or of weights that its run no longer has.
    """
    tables = []
    for point in sweep.points():
        path = folder / result_file(point)
        if path.is_file():
            table = read_result(path).drop(columns=list(TREATMENT))  # which settings may share a name with
            settings = {name: value for name, value in point.items() if name not in table}
            tables.append(table.assign(point=point_name(point), **settings))
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()
