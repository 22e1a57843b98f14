"""Trainings that readings of the paper share, and the tables of results that are taken of each."""

from __future__ import annotations

import dataclasses
import hashlib
import re
from dataclasses import dataclass
from pathlib import Path

from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.config.parse import Values, flat
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.policies.lesions import INTACT
from bilateral_rl.runs.folder import FINISHED
from bilateral_rl.study.folder import MACHINE_SETTINGS, RUNS
from bilateral_rl.study.model_job import find_run
from bilateral_rl.study.plan import is_supervised

BASE = "base"
"""Name of the trainings by the study's own settings."""
_LONGEST_NAME = 100


@dataclass(frozen=True)
class Training:
    """A training that readings share: one model on one task, of all seeds if they are trained together."""

    name: str
    """"base", or how its settings differ from the study's own."""
    config: TrainConfig

    @property
    def label(self) -> str:
        """The model, and the seed if each is a training of its own."""
        return self.config.model + ("" if is_supervised(self.config.algo) else f"-seed-{self.config.seed}")

    @property
    def job_name(self) -> str:
        """Name of its job, unique in the study."""
        return f"{self.config.task}/{self.label}" + ("" if self.name == BASE else f"-{self.name}")

    @property
    def runs(self) -> str:
        """The folder of the study that takes its run.

        Trainings of one model on one task have folders of their own: their jobs need not agree on who takes which
        number.
        """
        parts = [RUNS]
        parts += [] if is_supervised(self.config.algo) else [f"seed-{self.config.seed}"]
        return "/".join([*parts, *([] if self.name == BASE else [self.name])])

    def is_made(self, folder: Path) -> bool:
        """Whether its run in the study's folder has ended."""
        run = find_run(folder / RUNS, self.config)
        return run is not None and run.status().get("state") == FINISHED


@dataclass(frozen=True)
class Table:
    """The results of a training by one lesion protocol."""

    training: Training
    protocol: Protocol
    lesions: str
    """Whose combined lesions."""
    of_study: str
    """Whose they are if nothing is said."""
    states: tuple[str, ...] | None = None
    """Names of its lesions, the intact network apart; None for all that the networks can have."""
    spring: float | None = None
    """Stiffness of the spring between two hands (N/m) in retraining and tests; None for that of the training."""

    @property
    def name(self) -> str:
        """The protocol's name, with whose combined lesions where these are not the study's, and with the spring."""
        lesions = "" if self.lesions == self.of_study else f"-{self.lesions}-lesions"
        return self.protocol.name + lesions + ("" if self.spring is None else f"-spring-{self.spring:g}")

    @property
    def lesions_tested(self) -> int | None:
        """How many lesions it is of; None for all that the networks can have."""
        return None if self.states is None else len([name for name in self.states if name != INTACT])

    @property
    def path(self) -> str:
        """The file that takes it, relative to the study's folder."""
        training = self.training
        return f"results/{training.name}/{training.config.task}/{training.label}/{self.name}.csv"

    @property
    def settings(self) -> Values:
        """What the networks are put through: fields of :class:`~bilateral_rl.study.lesioning.LesionSettings`."""
        changed = {
            f.name: value
            for f in dataclasses.fields(self.protocol)
            if (value := getattr(self.protocol, f.name)) != f.default or f.name == "retrain"
        }
        settings: Values = {"protocols": [changed], "profile": self.lesions}
        settings |= {} if self.states is None else {"lesions": list(self.states)}
        settings |= {} if self.spring is None else {"spring": self.spring}
        if self.training.config.spec.architecture == "unilateral":  # nothing to lesion
            settings |= {"lesions": [INTACT], "control": False}
        return settings


def training_name(config: TrainConfig, base: TrainConfig) -> str:
    """How settings differ from the study's own, as the name of a folder."""
    own = dict(flat(base.to_values()))
    changed = {name: value for name, value in flat(config.to_values()) if value != own.get(name, value)}
    text = ",".join(f"{name}={value}" for name, value in changed.items() if name not in MACHINE_SETTINGS)
    name = re.sub(r"[^\w.=,+-]", "_", text)[:_LONGEST_NAME]
    if name == text:
        return name or BASE
    return f"{name}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"  # others may come to the same letters
