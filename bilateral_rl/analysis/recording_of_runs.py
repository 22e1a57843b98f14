"""Recordings of a run: its networks, with lesions, under conditions, and where all that came from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from bilateral_rl.analysis.both_ways import trial_seeds
from bilateral_rl.analysis.conditions import Conditions, conditions
from bilateral_rl.analysis.recording import Recording
from bilateral_rl.analysis.recording_of_trials import record
from bilateral_rl.config.parse import flat, plain
from bilateral_rl.config.tasks import TaskWords
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.policies.lesions import INTACT, Lesion
from bilateral_rl.runs.folder import FINAL, RunFolder
from bilateral_rl.runs.lesions import lesion_of
from bilateral_rl.runs.policies import load_policies
from bilateral_rl.runs.versions import versions
from bilateral_rl.vocabulary import TEST_SEED


@dataclass(frozen=True)
class Recorder:
    """Trials of a run's networks that are to be recorded; :meth:`of_run` checks and loads what they take."""

    policies: Mapping[int, MotorPolicy]
    """By the seed of their network."""
    lesions: Mapping[str, Lesion]
    """By name; every network does all trials with each."""
    conditions: Conditions
    """Task and settings."""
    trials: int
    """Number of trials of each network with each lesion."""
    seed: int
    """Seed of the first trial; trial i is the first one of ``seed + i``."""
    metadata: Mapping[str, Any]
    """What files say of where the recording comes from."""

    @classmethod
    def of_run(
        cls,
        folder: RunFolder,
        only: int | None = None,
        *,
        trials: int,
        seed: int = TEST_SEED,
        lesions: Sequence[str] = (INTACT,),
        task: TaskWords | None = None,
        settings: Mapping[str, Any] | None = None,
        weights: str = FINAL,
    ) -> Recorder:
        """Return what records trials of a run.

        Args:
            folder: the run.
            only: seed of the only network to record; None for all of the run.
            trials: number of trials of each network with each lesion.
            seed: seed of the first trial.
            lesions: names, "intact" among them where networks are to act without one too.
            task: another task than the run's.
            settings: other settings of trials, as for :func:`~bilateral_rl.analysis.conditions.conditions`.
            weights: which of the run's weights.

        Raises:
            UserError: a run, seed, lesion, task or setting that cannot be had.
        """
        config = folder.config()
        under = conditions(config, task, settings)
        if "trial.threshold" in dict(flat(settings or {})):
            raise UserError("trial.threshold changes nothing in a recording, which knows of no goal: leave it out.")
        trial_seeds(under.config.make_task(), under.settings, trials, seed)  # pairs of two arms, before the first part
        policies = load_policies(folder, weights, only)
        network = next(iter(policies.values())).motor_network
        by_name = {name: lesion_of(folder, config, network, name) for name in lesions}
        metadata = {
            "run": str(folder.path),
            "model": config.model,
            "algo": config.algo,
            "weights": weights,
            "weights_hash": folder.weights_hash(weights),
            "seeds": list(policies),
            "lesions": list(by_name),
            "task": under.task,
            "trials": trials,
            "trial_seed": seed,
            "changed": dict(under.changed),
            "settings": plain(asdict(under.settings)),
            "versions": versions(),
        }
        return cls(policies, by_name, under, trials, seed, metadata)

    @property
    def total(self) -> int:
        """Number of trials over all networks and lesions."""
        return len(self.policies) * len(self.lesions) * self.trials

    def parts(self) -> Iterator[Recording]:
        """Do the trials, and yield them part by part. Raises NotFiniteError if they cannot be measured."""
        return record(self.policies, self.lesions, self.conditions, self.trials, self.seed, self.metadata)
