"""What reproducing the paper takes: a study's description, and the jobs that it comes to."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from bilateral_rl import settings
from bilateral_rl.catalogue import ALGORITHMS, MODELS, check_choice
from bilateral_rl.config import PROFILES, TrainConfig
from bilateral_rl.envs.tasks import TASKS
from bilateral_rl.errors import UserError
from bilateral_rl.resolve import resolve
from bilateral_rl.run_folder import replacing
from bilateral_rl.settings import Values, merge
from bilateral_rl.study.jobs import Job, make_study_folder
from bilateral_rl.study.model_job import job_name, results_file

STUDY_FILE = "study.yaml"
QUICK_SEEDS = 3
_QUICK: dict[str, Values] = {
    "bptt": {"epochs": 10},
    "ppo": {"timesteps": 600_000, "evaluation": {"every": 150_000}},
}
RADII = {"random_reach": 0.05, "hold_position": 0.01}
"""Of each task's goal, by which claims are judged (m)."""
CALIBRATED: dict[str, Values] = {
    "random_reach": {"bptt": {"penalty": "weights", "penalty_coefficient": 1e-3}},
    "hold_position": {"bptt": {"penalty": "weights", "penalty_coefficient": 3e-5}},
}
"""What the paper leaves open, in profile ``paper``. Radii and penalty were chosen for claims C1 to C3, on unilateral
models only, from the grid in ``benchmarks/README.md``; C4 to C14 are tests of what was chosen."""
_QUICK_TESTS = {"trials": 256, "retraining_trials": 640}
_SPECIALIZED_COST = 1.25
"""Of a training with two losses, against one."""


@dataclass(frozen=True)
class Study:
    """Which trainings a study makes: every model on every task.

    Raises:
        UserError: an unknown algorithm or profile, or less than one seed.
    """

    algo: str = "bptt"
    profile: str = "paper"
    seeds: int = 10
    quick: bool = False
    """A preview: few seeds, short trainings, few test trials."""
    overrides: Values = field(default_factory=dict)
    """Settings of every training, as ``--set`` gives them."""

    def __post_init__(self) -> None:
        check_choice("algorithm", self.algo, ALGORITHMS)
        check_choice("profile", self.profile, PROFILES)
        if self.seeds < 1:
            raise UserError(f"--seeds must be at least 1, got {self.seeds}.")

    @property
    def name(self) -> str:
        """Of its folder."""
        return "-".join(["reproduce", self.algo, self.profile, *(["quick"] if self.quick else [])])

    def configs(self, threads: int = 1) -> list[TrainConfig]:
        """Every training: of all seeds at once where the algorithm can, else one a seed."""
        own: Values = {"seeds": self.seeds, "profile": self.profile} if self.algo == "bptt" else {}
        layers = [_QUICK[self.algo] if self.quick else {}, own, {"threads": threads}]
        configs = [
            resolve(self.algo, task, [*layers, self._calibrated(task), self.overrides], model=model)
            for task in TASKS
            for model in MODELS
        ]
        if self.algo == "bptt":
            return configs
        return [dataclasses.replace(config, seed=config.seed + i) for config in configs for i in range(self.seeds)]

    def jobs(self, threads: int = 1) -> list[Job]:
        """One for each training."""
        tests: dict[str, Any] = {"profile": self.profile} | (_QUICK_TESTS if self.quick else {})
        return [_job(config, tests, threads) for config in self.configs(threads)]

    def _calibrated(self, task: str) -> Values:
        return CALIBRATED[task] if (self.algo, self.profile) == ("bptt", "paper") else {}

    def to_values(self) -> Values:
        """What ``study.yaml`` holds."""
        return dataclasses.asdict(self)

    def claim(self, folder: Path) -> None:
        """Make ``folder`` this study's.

        Raises:
            UserError: a folder that cannot be written, or that holds another study.
        """
        make_study_folder(folder)
        path = folder / STUDY_FILE
        if path.is_file():
            _check_same(path, settings.load_file(path), self.to_values())
            return
        if any(folder.iterdir()):
            raise UserError(f"{folder} is not empty and holds no study; choose another --out.")
        with replacing(path) as temporary:
            temporary.write_text(yaml.safe_dump(self.to_values(), sort_keys=False), encoding="utf-8")


def _job(config: TrainConfig, tests: Mapping[str, Any], threads: int) -> Job:
    specialized = MODELS[config.model].loss == "specialized"
    return Job(
        name=job_name(config),
        work="bilateral_rl.study.model_job:train_and_measure",
        result=results_file(config),
        arguments={"config": config.to_values(), "lesions": dict(tests)},
        cost=_SPECIALIZED_COST if specialized else 1.0,
        threads=threads,
    )


def _check_same(path: Path, there: Values, wanted: Values) -> None:
    for name, value in merge(there, wanted).items():
        if there.get(name) != value:
            raise UserError(
                f"{path.parent} holds a study with {name} = {there.get(name)!r}, not {value!r}: "
                "go on with it as it was begun, or choose another --out."
            )


def threads_for(n_jobs: int, n_cpus: int) -> int:
    """CPU threads of each of so many jobs at a time."""
    return max(1, n_cpus // n_jobs)
