"""Who acts in a video, and in which trials."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.config.schema import BPTTConfig, TrainConfig
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.terminal import printable
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.policies.lesions import INTACT, LESIONS, RELEASED_LESIONS, lesion_words
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import load_policies, parse_run
from bilateral_rl.video.film import Take


@dataclass(frozen=True)
class Actor:
    """One trained controller; :meth:`load` finds it."""

    folder: RunFolder
    config: TrainConfig
    named_seed: int | None
    """The seed in RUN:SEED."""
    policy: MotorPolicy
    """Its network, intact."""

    @classmethod
    def load(cls, run: str, weights: str) -> Actor:
        """The controller that RUN or RUN:SEED names: of several seeds the first if none is named.

        Raises:
            UserError: what is no run, a seed that it has not, or weights that are missing or damaged.
        """
        folder, seed = parse_run(run)
        config = folder.config()
        (policy,) = load_policies(folder, weights, config.seed if seed is None else seed).values()
        return cls(folder, config, seed, policy)

    @property
    def seed(self) -> int:
        """Of its network."""
        return self.config.seed if self.named_seed is None else self.named_seed

    @property
    def is_one_of_several(self) -> bool:
        """Whether the run has more seeds and none was named."""
        return self.named_seed is None and len(self.config.all_seeds) > 1

    @property
    def path(self) -> Path:
        """Of the run's folder, so that it ends in the folder's name."""
        path = self.folder.path
        return path if path.name not in ("", "..") else path.resolve()

    @property
    def name(self) -> str:
        """Of the run's folder, with the seed if one was named."""
        return self.path.name if self.named_seed is None else f"{self.path.name}-seed{self.named_seed}"

    def check_lesion(self, lesion: str) -> None:
        """Raise a UserError if the network cannot have ``lesion``."""
        network = self.policy.motor_network
        have = (INTACT, *network.available_lesions())
        if lesion not in have:
            raise UserError(
                f"{self.folder.path} is {network.architecture} and cannot have the lesion {lesion}, only "
                f"{', '.join(have)}: choose another --lesion or leave the run out."
            )

    def perform(self, evaluator: Evaluator, lesion: str, threshold: float, label: str) -> Take:
        """The trials under a lesion, of the run's profile as in ``bilateral-rl lesion``, acting by the mean."""
        released = isinstance(self.config, BPTTConfig) and self.config.profile == "released"
        lesions = RELEASED_LESIONS if released else LESIONS
        with self.policy.motor_network.lesioned(lesions.get(lesion, lesion)):
            record = evaluator.run(self.policy)
        return Take(label, record, threshold)


def labels(actors: Sequence[Actor], lesion: str) -> list[str]:
    """What each is called: model, algorithm, seed and lesion, and the folder where that is not enough."""
    plain = [f"{actor.config.model} · {actor.config.algo} · seed {actor.seed}" for actor in actors]
    if len(set(plain)) < len(plain):
        plain = [f"{label} ({printable(actor.path.name)})" for label, actor in zip(plain, actors, strict=True)]
    if lesion == INTACT:
        return plain
    return [f"{label} · lesion: {lesion_words(lesion)}" for label in plain]


def common_trials(actors: Sequence[Actor]) -> tuple[TrialSettings, list[str]]:
    """How the trials run for all, namely as in the first run; and notes on runs that learned under other settings.

    Raises:
        UserError: runs of different tasks.
    """
    first, notes = actors[0], []
    for actor in actors[1:]:
        if actor.config.task != first.config.task:
            raise UserError(
                f"{actor.folder.path} learned {actor.config.task} and {first.folder.path} {first.config.task}, but "
                "runs side by side do the same trials: choose runs of one task."
            )
        other = _differences(first.config.trial, actor.config.trial)
        if other:
            notes.append(f"{actor.folder.path} learned with another {', '.join(other)}; all do the first run's trials.")
    return first.config.trial, notes


def _differences(first: TrialSettings, second: TrialSettings) -> list[str]:
    names = [field.name for field in dataclasses.fields(TrialSettings)]
    return [name for name in names if getattr(first, name) != getattr(second, name)]
