"""The networks that act in a video, and their trials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import shorten
from typing import Any

from bilateral_rl.analysis.conditions import Conditions, conditions
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.config.parse import flat, plain_values
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.config.tasks import TaskWords
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.terminal import printable
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.policies.lesions import INTACT, Lesion, lesion_words
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.lesions import lesion_of
from bilateral_rl.runs.policies import load_policies, parse_run
from bilateral_rl.video.film import Performance

_WIDTH = 64
"""Characters that a picture of one arm has room for in a line."""


@dataclass(frozen=True)
class Actor:
    """One trained network; :meth:`load` finds it."""

    folder: RunFolder
    config: TrainConfig
    named_seed: int | None
    """The seed in RUN:SEED."""
    policy: MotorPolicy
    """The policy with the network, intact."""

    @classmethod
    def load(cls, run: str, weights: str) -> Actor:
        """Return the network that RUN or RUN:SEED names: without a seed, the run's first.

        Raises:
            UserError: there is no such run or seed, or its weights are missing or damaged.
        """
        folder, seed = parse_run(run)
        config = folder.config()
        (policy,) = load_policies(folder, weights, config.seed if seed is None else seed).values()
        return cls(folder, config, seed, policy)

    @property
    def seed(self) -> int:
        """Seed of the network."""
        return self.config.seed if self.named_seed is None else self.named_seed

    @property
    def is_one_of_several(self) -> bool:
        """Whether the run has more seeds and none was named."""
        return self.named_seed is None and len(self.config.all_seeds) > 1

    @property
    def path(self) -> Path:
        """Path of the run's folder that ends in the folder's name."""
        path = self.folder.path
        return path if path.name not in ("", "..") else path.resolve()

    def check_lesion(self, lesion: str) -> None:
        """Raise a UserError if the network cannot have ``lesion``."""
        self._find_lesion(lesion)

    def perform(self, evaluator: Evaluator, lesion: str, radius: float, label: str) -> Performance:
        """Do the trials with a lesion, that of the run's profile as in ``bilateral-rl lesion``, without exploration."""
        with self.policy.motor_network.lesioned(self._find_lesion(lesion)):
            record = evaluator.run(self.policy)
        return Performance(label, record, radius)

    def _find_lesion(self, name: str) -> Lesion:
        return lesion_of(self.folder, self.config, self.policy.motor_network, name)


def labels(actors: Sequence[Actor], lesion: str, under: Conditions) -> list[str]:
    """Name each actor by model, algorithm, seed and lesion, and by its folder where that is not enough.

    A second line says what is unusual in the trials, where anything is.
    """
    plain = [f"{actor.config.model} · {actor.config.algo} · seed {actor.seed}" for actor in actors]
    if len(set(plain)) < len(plain):
        plain = [f"{label} ({printable(name)})" for label, name in zip(plain, told_apart(actors), strict=True)]
    lesioned = "" if lesion == INTACT else f" · lesion: {lesion_words(lesion)}"
    unusual = ", ".join(unusual_trials(actors, under))
    tested = f"\n{shorten(unusual, _WIDTH, placeholder=' …')}" if unusual else ""
    return [f"{label}{lesioned}{printable(tested)}" for label in plain]


def unusual_trials(actors: Sequence[Actor], under: Conditions) -> list[str]:
    """Return the task, where not all learned it, and each setting that is another one, as ``name=value``."""
    task = [under.task] if any(actor.config.task != under.task for actor in actors) else []
    return task + [f"{name.partition('.')[2]}={value}" for name, value in under.changed.items() if name != "task"]


def told_apart(actors: Sequence[Actor]) -> list[str]:
    """Return each run's folder, after as many of the folders above it as are needed to tell the runs apart."""
    paths = [actor.path.absolute() for actor in actors]
    names = [path.name for path in paths]
    for depth in range(2, max(len(path.parts) for path in paths)):
        if len(set(names)) == len(set(paths)):
            break
        names = ["/".join(path.parts[-depth:]) for path in paths]
    return names


def common_trials(
    actors: Sequence[Actor], task: TaskWords | None = None, settings: Mapping[str, Any] | None = None
) -> tuple[Conditions, list[str]]:
    """Return the conditions of the trials that all do, and notes on what they mean for runs that learned otherwise.

    Args:
        actors: the networks. What is not said here is as the first one's run has it.
        task: another task than that of the runs, which may then be several.
        settings: other settings of trials, as for :func:`~bilateral_rl.analysis.conditions.conditions`.

    Raises:
        UserError: the runs learned different tasks, and no other is given, or these conditions cannot be.
    """
    first, notes = actors[0], []
    for actor in actors[1:]:
        if actor.config.n_arms != first.config.n_arms:
            raise UserError(
                f"{first.folder.path} and {actor.folder.path} have learned to move {first.config.n_arms} and "
                f"{actor.config.n_arms} arms: choose runs of as many."
            )
    common, *others = (conditions(actor.config, task, settings) for actor in actors)
    for actor, under in zip(actors[1:], others, strict=True):
        if under.task != common.task:
            raise UserError(
                f"{actor.folder.path} learned {under.task} and {first.folder.path} {common.task}, but runs side by "
                "side do the same trials: choose runs of one task, or give --task."
            )
        other = _differences(common.settings, under.settings)
        other += ["experiment"] if under.config.experiment != common.config.experiment else []
        if other:
            notes.append(f"{actor.folder.path} learned with another {', '.join(other)}; all do the first run's trials.")
    return common, [*notes, *common.notes]


def _differences(first: TrialSettings, second: TrialSettings) -> list[str]:
    known = dict(flat(plain_values(first)))
    return [name for name, value in flat(plain_values(second)) if name not in known or value != known[name]]
