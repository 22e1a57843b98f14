"""What reproducing the paper takes: a study's description, and the jobs that it comes to."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from bilateral_rl.config.catalogue import ALGORITHMS, MODELS, check_choice
from bilateral_rl.config.parse import Values
from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import BPTTConfig, TrainConfig
from bilateral_rl.envs.tasks import TASKS
from bilateral_rl.io.cpus import usable_cpus
from bilateral_rl.io.errors import UserError
from bilateral_rl.study.jobs import Job
from bilateral_rl.vocabulary import PROFILES

TRAIN_AND_MEASURE = "bilateral_rl.study.model_job:train_and_measure"
QUICK_SEEDS = 3
_QUICK: dict[str, Values] = {
    "bptt": {"epochs": 10},
    "ppo": {"timesteps": 600_000, "evaluation": {"every": 150_000}},
    "a2c": {"timesteps": 1_200_000, "evaluation": {"every": 300_000}},
    "sac": {"timesteps": 80_000, "evaluation": {"every": 20_000}},
    "td3": {"timesteps": 80_000, "evaluation": {"every": 20_000}},
}
RADII = {"random_reach": 0.05, "hold_position": 0.01}
"""Of each task's goal, by which claims are judged (m)."""
CALIBRATED: dict[str, Values] = {
    "random_reach": {"bptt": {"penalty": "weights", "penalty_coefficient": 1e-3}},
    "hold_position": {"bptt": {"penalty": "weights", "penalty_coefficient": 3e-5}},
}
"""What the paper leaves open, in profile ``paper``. Radii and penalty were chosen for claims C1 to C3, on unilateral
models only, from the grid in ``docs/paper.md``; C4 to C14 are tests of what was chosen."""
_QUICK_TESTS = {"trials": 256, "retraining_trials": 640}
_OWN = ("algo", "model", "task", "seeds", "profile")
"""Settings that tell a study's trainings apart, or that it has options for."""
_SPECIALIZED_COST = 1.25
"""Of a training with two losses, against one."""


@dataclass(frozen=True)
class Study:
    """Which trainings a study makes: every model on every task.

    Raises:
        UserError: an unknown algorithm or profile, less than one seed, or overrides of what a study itself sets.
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
        own = [name for name in _OWN if name in self.overrides]
        if own:
            raise UserError(f"--set cannot change {own[0]}, which the study itself sets; leave it out.")

    @property
    def name(self) -> str:
        """Of its folder."""
        return "-".join(["reproduce", self.algo, self.profile, *(["quick"] if self.quick else [])])

    @property
    def n_jobs(self) -> int:
        """Number of jobs that the study comes to."""
        return len(TASKS) * len(MODELS) * (1 if self.algo == "bptt" else self.seeds)

    def configs(self, threads: int = 1) -> list[TrainConfig]:
        """Every training: of all seeds at once where the algorithm can, else one a seed.

        Raises UserError for settings that cannot be.
        """
        own: Values = {"seeds": self.seeds, "profile": self.profile} if self.algo == "bptt" else {}
        layers = [_QUICK[self.algo] if self.quick else {}, own, {"threads": threads}]
        configs = [
            resolve(self.algo, task, [*layers, self._calibrated(task), self.overrides], model=model)
            for task in TASKS
            for model in MODELS
        ]
        if any(config.trial.noisy or config.trial.feedback_delay for config in configs):
            raise UserError("After a lesion networks are retrained without noise or delay; leave both out of --set.")
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


def job_name(config: TrainConfig) -> str:
    """Of the job that trains ``config``."""
    seed = "" if isinstance(config, BPTTConfig) else f"-seed-{config.seed}"
    return f"{config.task}/{config.model}{seed}"


def results_file(config: TrainConfig) -> str:
    """Where in the study's folder the results of ``config`` lie."""
    return f"results/{job_name(config)}.csv"


def runs_folder(config: TrainConfig) -> str:
    """Where in the study's folder the run of ``config`` lies.

    Seeds that are runs of their own lie in folders of their own: the jobs need not agree on who takes which number.
    """
    return "runs" if isinstance(config, BPTTConfig) else f"runs/seed-{config.seed}"


def cost_of(config: TrainConfig) -> float:
    """Of a training, against others of the same study."""
    return _SPECIALIZED_COST if MODELS[config.model].loss == "specialized" else 1.0


def _job(config: TrainConfig, tests: Mapping[str, Any], threads: int) -> Job:
    return Job(
        name=job_name(config),
        work=TRAIN_AND_MEASURE,
        result=results_file(config),
        arguments={
            "config": config.to_values(),
            "lesions": dict(tests),
            "runs": runs_folder(config),
            "result": results_file(config),
        },
        cost=cost_of(config),
        threads=threads,
    )


def side_by_side(wanted: int | None, n_jobs: int) -> tuple[int, int]:
    """How many of ``n_jobs`` jobs to run at a time on this machine, and with how many CPU threads each.

    Args:
        wanted: how many at a time; None for one a CPU.
        n_jobs: how many there are.

    Raises:
        UserError: less than one at a time.
    """
    if wanted is not None and wanted < 1:
        raise UserError(f"--jobs must be at least 1, got {wanted}.")
    n_cpus = usable_cpus()
    at_once = min(wanted or n_cpus, n_jobs)
    return at_once, max(1, n_cpus // at_once)
