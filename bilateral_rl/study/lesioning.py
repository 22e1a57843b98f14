"""Lesion studies of a run: every state of its networks, without and with an epoch of retraining (paper section 6)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import pandas as pd

from bilateral_rl.analysis.goals import STUDY_RADII, distinct_radii
from bilateral_rl.analysis.metrics import Metric, measure, metrics_of
from bilateral_rl.analysis.results import COLUMNS
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.config.schema import BPTTConfig, SupervisedConfig, TrainConfig
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.tensors import Tensors
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.policies.lesions import INTACT, LESIONS, RELEASED_LESIONS, Lesion, find_lesion
from bilateral_rl.runs.folder import FINAL, RunFolder
from bilateral_rl.runs.policies import build_network, load_policies
from bilateral_rl.study.retraining import Retraining
from bilateral_rl.vocabulary import PENALTIES, PROFILES, TEST_SEED, TEST_TRIALS

OnState = Callable[[int, int, str], None]
"""Told how many states of how many are done, and which one comes next."""


@dataclass(frozen=True)
class LesionSettings:
    """How a lesion study is made."""

    lesions: tuple[str, ...] | None = None
    """Names; None for all that the architecture has. The intact network always comes first."""
    retrain: bool = True
    """Whether the output layer also adapts for one epoch in each state."""
    profile: str | None = None
    """Whose combined lesions: "paper" or "released"; None for the run's profile."""
    trials: int = TEST_TRIALS
    """Of each test."""
    seed: int = TEST_SEED
    """Of the test trials; trial i is the first one of seed + i."""
    threads: int = 0
    """CPU threads of the retraining; 0 for as many as there are."""
    retraining_trials: int | None = None
    """Of the epoch; None for the run's own number, or the paper's."""


class LesionStudy:
    """The states of a run's networks, and what each does in the same trials. The run is only read.

    Args:
        folder: the run.
        settings: how.
        only: the one seed wanted; None for all.
        weights: which of the run's weights.

    Attributes:
        names: of the states, "intact" first.

    Raises:
        UserError: a lesion that is unknown or that the architecture cannot have, a seed that the run has not, or
            trials by which nothing can be retrained.
    """

    def __init__(
        self,
        folder: RunFolder,
        settings: LesionSettings = LesionSettings(),
        only: int | None = None,
        weights: str = FINAL,
    ) -> None:
        self.settings, self.config = settings, folder.config()
        self.names = state_names(self.config, settings.lesions)
        self._lesions = _lesions_of(_profile(self.config, settings.profile))
        self._policies = load_policies(folder, weights, only)
        self._layout = Layout(build_network(self.config))
        self._retraining = self._make_retraining() if settings.retrain else None
        self._evaluator = Evaluator(self.config.task, self.config.trial, settings.trials, settings.seed)
        self._metrics = measured_metrics(self.config)

    def run(self, on_state: OnState = lambda done, total, name: None) -> pd.DataFrame:
        """The long table of results (:mod:`bilateral_rl.analysis.results`)."""
        rows: list[tuple[object, ...]] = []
        for done, name in enumerate(self.names):
            on_state(done, len(self.names), name)
            for retrained, policies in self._states(name):
                rows += self._test(policies, name, retrained)
        on_state(len(self.names), len(self.names), "")
        return pd.DataFrame(rows, columns=list(COLUMNS))

    def _states(self, name: str) -> Iterator[tuple[bool, dict[int, MotorPolicy | None]]]:
        """The policies, lesioned, without and then with retraining; None where it went wrong."""
        lesion = find_lesion(name, self._lesions)
        for policy in self._policies.values():
            policy.motor_network.set_lesion(lesion)
        yield False, dict(self._policies)
        if self._retraining is None:
            return
        kept = {seed: _copy(policy) for seed, policy in self._policies.items()}
        rows = self._retraining.run(self._layout.pack(list(kept.values())), list(kept), lesion)
        adapted: dict[int, MotorPolicy | None] = {}
        for (seed, policy), row in zip(self._policies.items(), rows, strict=True):
            policy.motor_network.load_state_dict({k: t[0] for k, t in self._layout.unpack(row[None]).items()})
            adapted[seed] = policy if row.isfinite().all() else None
        yield True, adapted
        for seed, policy in self._policies.items():
            policy.motor_network.load_state_dict(kept[seed])

    def _test(self, policies: dict[int, MotorPolicy | None], lesion: str, retrained: bool) -> list[tuple[object, ...]]:
        config = self.config
        head = (config.model, config.task, config.algo)
        return [
            (*head, seed, lesion, retrained, name, value)
            for seed, policy in policies.items()
            for name, value in self._measure(policy, self._metrics).items()
        ]

    def _measure(self, policy: MotorPolicy | None, metrics: Sequence[Metric]) -> dict[str, float]:
        if policy is None:
            return {metric.name: float("nan") for metric in metrics}
        return measure(self._evaluator.run(policy), metrics)

    def _make_retraining(self) -> Retraining:
        config = self.config
        if config.trial.noisy or config.trial.feedback_delay:
            raise UserError("Retraining knows neither noise nor feedback delay, which this run has; use --no-retrain.")
        if isinstance(config, BPTTConfig):
            own, penalty, coefficient = config.bptt, config.penalty, config.penalty_coefficient
        else:
            penalty = PROFILES["paper"]
            own, coefficient = SupervisedConfig(), PENALTIES[penalty]
        if self.settings.retraining_trials is not None:
            own = dataclasses.replace(own, trials=self.settings.retraining_trials)
        if own.trials < own.batch_size:
            raise UserError(f"An epoch of {own.trials} trials is less than one batch of {own.batch_size}.")
        return Retraining(self._layout, config.task, config.trial, own, penalty, coefficient, self.settings.threads)


def measured_metrics(config: TrainConfig) -> list[Metric]:
    """What the results of a run hold: at the radii of every study and at the run's own."""
    return metrics_of(config.task, distinct_radii([*STUDY_RADII, config.trial.threshold]))


def state_names(config: TrainConfig, lesions: Sequence[str] | None) -> list[str]:
    """The states of a study: "intact", then the lesions wanted, or all of the architecture.

    Raises:
        UserError: a lesion that is unknown, or that the architecture cannot have.
    """
    network = build_network(config)
    available = network.available_lesions()
    if lesions is None:
        return [INTACT, *available]
    for name in lesions:
        if name not in {INTACT, *available}:
            have = ", ".join(available) or "none"
            known = "" if name in LESIONS else f"; the lesions there are: {', '.join(LESIONS)}"
            raise UserError(
                f"{config.model} is a {network.architecture} network and cannot have the lesion {name!r}: it can have "
                f"{have}{known}."
            )
    return [INTACT, *(name for name in dict.fromkeys(lesions) if name != INTACT)]


def _profile(config: TrainConfig, wanted: str | None) -> str:
    own = config.profile if isinstance(config, BPTTConfig) else "paper"
    profile = wanted or own
    if profile not in PROFILES:
        raise UserError(f"Unknown profile {profile!r}; choose from {', '.join(PROFILES)}.")
    return profile


def _lesions_of(profile: str) -> dict[str, Lesion]:
    return RELEASED_LESIONS if profile == "released" else LESIONS


def _copy(policy: MotorPolicy) -> Tensors:
    return {name: tensor.detach().clone() for name, tensor in policy.motor_network.state_dict().items()}
