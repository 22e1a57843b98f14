"""What reproducing the paper takes: a study's description, and the trainings that it comes to."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, cast

from bilateral_rl.analysis.goals import JUDGED_RADII
from bilateral_rl.config.catalogue import ALGORITHMS, MODELS, check_choice
from bilateral_rl.config.parse import Values
from bilateral_rl.config.resolve import quick_settings, resolve
from bilateral_rl.config.schema import RLConfig, TrainConfig
from bilateral_rl.config.seeds import FIRST_CONFIRMING_SEED
from bilateral_rl.io.cpus import usable_cpus
from bilateral_rl.io.errors import UserError
from bilateral_rl.study.calibration import calibrated_settings, is_calibrated
from bilateral_rl.vocabulary import PROFILES

Subject = Literal["paper", "two_arms"]
TASKS_OF: dict[Subject, tuple[str, ...]] = {
    "paper": tuple(JUDGED_RADII),
    "two_arms": ("reach_and_hold", "two_reaches", "two_holds"),
}
"""What a study can be about, with the tasks of its trainings; claims on two arms are about the first one."""
TRAIN_AND_MEASURE = "bilateral_rl.study.model_job:train_and_measure"
QUICK_SEEDS = 3
_QUICK_TESTS = {"trials": 256, "retraining_trials": 640}
SET_BY_STUDY = ("algo", "model", "task", "seeds", "profile")
"""Settings that tell a study's trainings apart, or that it has options for."""
PROBED, PROBES = ("bi_s", "cc_s"), 12
"""Models whose sides are tested while reinforcement learning specializes them, and how often."""
_OF_HEMISPHERES = ("ipsilateral_share", "trained_combination")
"""Settings of networks that have hemispheres."""
_SPECIALIZED_COST = 1.25
"""Cost of a training with two losses, against that of one."""


@dataclass(frozen=True)
class Study:
    """Which trainings a study makes: every model, or some, on each of its tasks, or some.

    Raises:
        UserError: an unknown subject, algorithm, profile, model or task, no model, less than one seed, or overrides of
            what a study itself sets.
    """

    algo: str = "bptt"
    profile: str = "paper"
    first_seed: int = 0
    seeds: int = 10
    """How many networks of each model: of ``first_seed``, ``first_seed + 1``, …"""
    quick: bool = False
    """A preview: few seeds, short trainings, few test trials."""
    overrides: Values = field(default_factory=dict)
    """Settings of every training, as ``--set`` gives them."""
    models: tuple[str, ...] = tuple(MODELS)
    """Names of models; claims that need others stay undecided."""
    subject: Subject = "paper"
    """What it is about: the paper, or two arms that one brain controls."""
    tasks: tuple[str, ...] = ()
    """Names of tasks; empty for all of the subject's."""

    def __post_init__(self) -> None:
        of_subject = TASKS_OF[self.subject]
        for task in self.tasks:
            check_choice(f"task of the study {self.subject}", task, of_subject)
        in_order = tuple(task for task in of_subject if task in (self.tasks or of_subject))
        object.__setattr__(self, "tasks", in_order)
        check_choice("algorithm", self.algo, ALGORITHMS)
        check_choice("profile", self.profile, PROFILES)
        for model in self.models:
            check_choice("model", model, MODELS)
        if not self.models or len(set(self.models)) < len(self.models):
            raise UserError(f"A study is of one model or more, each once, not of {list(self.models)}.")
        if self.seeds < 1:
            raise UserError(f"--seeds must be at least 1, got {self.seeds}.")
        fixed = [name for name in SET_BY_STUDY if name in self.overrides]
        if fixed:
            raise UserError(f"--set cannot change {fixed[0]}, which the study itself sets; leave it out.")

    @property
    def name(self) -> str:
        """Name of its folder."""
        quick = ["quick"] if self.quick else []
        seeds = [f"seeds-{self.first_seed}-{self.first_seed + self.seeds - 1}"] if self.first_seed else []
        models = [] if set(self.models) == set(MODELS) else self.models
        subject = [] if self.subject == "paper" else [self.subject]
        tasks = [] if self.tasks == TASKS_OF[self.subject] else self.tasks
        return "-".join(["reproduce", *subject, self.algo, self.profile, *models, *tasks, *quick, *seeds])

    @property
    def purpose(self) -> Literal["exploration", "confirmation"]:
        """What it is for: to confirm, if no seed is below 100 (0 to 34 were looked at) and it is no preview."""
        first = self.overrides.get("seed", self.first_seed)
        return "confirmation" if first >= FIRST_CONFIRMING_SEED and not self.quick else "exploration"

    def configs(self, threads: int = 1, training: Mapping[str, Values] = {}) -> list[TrainConfig]:
        """The configuration of every training: of all seeds at once if supervised, else one a seed.

        Args:
            threads: CPU threads of each.
            training: settings on top of the study's, by task.

        Raises:
            UserError: settings that cannot be.
        """
        of_study: Values = {"seed": self.first_seed, "seeds": self.seeds, "threads": threads}
        if is_supervised(self.algo):
            of_study["profile"] = self.profile
        layers = [quick_settings(self.algo) if self.quick else {}, of_study]
        configs = [
            self._config(task, model, [*layers, self.overrides, _of_model(model, training.get(task, {}))])
            for task in self.tasks
            for model in self.models
        ]
        if is_supervised(self.algo):
            return configs
        return [dataclasses.replace(config, seed=seed, seeds=1) for config in configs for seed in config.all_seeds]

    @property
    def tests(self) -> Values:
        """Settings of every test of its networks (:class:`~bilateral_rl.study.lesioning.LesionSettings`)."""
        return dict(_QUICK_TESTS) if self.quick else {}

    @property
    def is_calibrated(self) -> bool:
        """Whether its weight penalty was chosen for some of the claims."""
        return self.subject == "paper" and is_calibrated(self.algo, self.profile, self.overrides)

    def to_values(self) -> Values:
        """The contents of ``study.yaml``."""
        return dataclasses.asdict(self) | {"models": list(self.models), "tasks": list(self.tasks)}

    def _config(self, task: str, model: str, layers: Sequence[Values]) -> TrainConfig:
        """The training of a model: by the calibrated penalty and with its probes, where ``layers`` say nothing else."""
        calibrated = calibrated_settings(self.algo, self.profile, task)
        config = resolve(self.algo, task, [calibrated, *layers], model=model)
        if model not in PROBED or not isinstance(config, RLConfig) or self.subject != "paper":
            return config
        probes: Values = {"evaluation": {"lesion_probe_every": -(-config.timesteps // PROBES)}}
        return resolve(self.algo, task, [probes, calibrated, *layers], model=model)


def as_subject(name: str) -> Subject:
    """Return what a study is about. Raises UserError for anything that there is no study of."""
    check_choice("study", name, TASKS_OF)
    return cast(Subject, name)


def _of_model(model: str, training: Values) -> Values:
    """What a reading sets that a model can have: a network without hemispheres divides nothing among them."""
    network = training.get("network")
    if MODELS[model].architecture != "unilateral" or not isinstance(network, Mapping):
        return training
    return training | {"network": {name: value for name, value in network.items() if name not in _OF_HEMISPHERES}}


def cost_of(config: TrainConfig) -> float:
    """The cost of a training, against others of the same study."""
    return _SPECIALIZED_COST if MODELS[config.model].loss == "specialized" else 1.0


def is_supervised(algo: str) -> bool:
    """Whether all seeds of a model are one training, and so one job; otherwise each is a job, for more at a time."""
    return algo == "bptt"


def side_by_side(requested: int | None, n_jobs: int, algo: str) -> tuple[int, int]:
    """Share the CPUs of this machine among jobs.

    Args:
        requested: number of jobs at a time; None for one a CPU.
        n_jobs: number of jobs.
        algo: the algorithm of their trainings.

    Returns:
        The number of jobs to run at a time, and the number of CPU threads of each: one by reinforcement learning, which
        a second one slows down tenfold where other programs want the same CPU.

    Raises:
        UserError: less than one at a time.
    """
    if requested is not None and requested < 1:
        raise UserError(f"--jobs must be at least 1, got {requested}.")
    n_cpus = usable_cpus()
    at_once = min(requested or n_cpus, n_jobs)
    return at_once, max(1, n_cpus // at_once) if is_supervised(algo) else 1
