"""Lesion studies: a run's networks intact and after each lesion, without and with retraining (paper section 6)."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from bilateral_rl.analysis.goals import STUDY_RADII, distinct_radii
from bilateral_rl.analysis.metrics import Metric, measure, metrics_of
from bilateral_rl.analysis.results import COLUMNS
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.tensors import Tensors
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.policies.lesions import INTACT, LESIONS, LESIONS_OF, Lesion, find_lesion
from bilateral_rl.runs.folder import FINAL, RunFolder
from bilateral_rl.runs.policies import build_network, load_policies
from bilateral_rl.training.retraining import Retraining
from bilateral_rl.vocabulary import TEST_SEED, TEST_TRIALS

OnState = Callable[[int, int, str], None]
"""Called with how many states of how many are done, and the name of the next one."""


@dataclass(frozen=True)
class LesionSettings:
    """How the networks of a run are lesioned, retrained and tested."""

    lesions: tuple[str, ...] | None = None
    """Names of the lesions; None for all that the architecture can have. The intact network always comes first."""
    retrain: bool = True
    """Whether each state is also tested after an epoch in which the output layer adapts to it."""
    profile: str | None = None
    """Whose combined lesions: "paper" or "released"; None for the run's profile."""
    trials: int = TEST_TRIALS
    """Number of trials of each test."""
    seed: int = TEST_SEED
    """Seed of the test trials; trial i is the first one of seed + i."""
    threads: int = 0
    """CPU threads of the retraining; 0 for as many as there are."""
    retraining_trials: int | None = None
    """Number of trials of the epoch; None for the run's own number, or the paper's."""


class LesionStudy:
    """A run's networks in every state: intact and after each lesion, all tested in the same trials.

    The run is only read.

    Args:
        folder: the run.
        settings: how its networks are lesioned, retrained and tested.
        only: seed of the one network to study; None for all.
        weights: which of the run's weights.

    Attributes:
        settings: as given.
        config: configuration of the run.
        names: names of the states, "intact" first.

    Raises:
        UserError: a lesion that is unknown or that the architecture cannot have, a seed that the run does not have, or
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
        self._lesions = _lesions_of(self.config, settings.profile)
        self._policies = load_policies(folder, weights, only)
        self._layout = Layout(build_network(self.config))
        self._retraining = _make_retraining(self.config, self._layout, settings) if settings.retrain else None
        self._evaluator = Evaluator(self.config.task, self.config.trial, settings.trials, settings.seed)
        self._metrics = measured_metrics(self.config)

    def run(self, on_state: OnState = lambda done, total, name: None) -> pd.DataFrame:
        """Test every state, and return the long table of results (:mod:`bilateral_rl.analysis.results`).

        A network that retraining breaks has NaN for every metric.
        """
        rows: list[tuple[object, ...]] = []
        for done, name in enumerate(self.names):
            on_state(done, len(self.names), name)
            lesion = find_lesion(name, self._lesions)
            for policy in self._policies.values():
                policy.motor_network.set_lesion(lesion)
            rows += self._test(self._policies, name, retrained=False)
            if self._retraining is not None:
                with self._retrained(self._retraining, lesion) as policies:
                    rows += self._test(policies, name, retrained=True)
        on_state(len(self.names), len(self.names), "")
        return pd.DataFrame(rows, columns=list(COLUMNS))

    @contextlib.contextmanager
    def _retrained(self, retraining: Retraining, lesion: Lesion) -> Iterator[dict[int, MotorPolicy | None]]:
        """A context in which the lesioned policies have adapted; None in place of one that went wrong."""
        stored = {seed: _copy(policy) for seed, policy in self._policies.items()}
        rows = retraining.run(self._layout.pack(list(stored.values())), list(stored), lesion)  # (networks, parameters)
        adapted: dict[int, MotorPolicy | None] = {}
        for (seed, policy), row in zip(self._policies.items(), rows, strict=True):
            state = {name: tensor[0] for name, tensor in self._layout.unpack(row[None]).items()}
            policy.motor_network.load_state_dict(state)
            adapted[seed] = policy if row.isfinite().all() else None
        try:
            yield adapted
        finally:
            for seed, policy in self._policies.items():
                policy.motor_network.load_state_dict(stored[seed])

    def _test(
        self, policies: Mapping[int, MotorPolicy | None], lesion: str, retrained: bool
    ) -> list[tuple[object, ...]]:
        """Rows of the table, one a network and metric."""
        config = self.config
        return [
            (config.model, config.task, config.algo, seed, lesion, retrained, metric, value)
            for seed, policy in policies.items()
            for metric, value in self._measure(policy).items()
        ]

    def _measure(self, policy: MotorPolicy | None) -> dict[str, float]:
        if policy is None:
            return {metric.name: float("nan") for metric in self._metrics}
        return measure(self._evaluator.run(policy), self._metrics)


def measured_metrics(config: TrainConfig) -> list[Metric]:
    """The metrics in the results of a run: at the goal radii of every study and at the run's own."""
    return metrics_of(config.task, distinct_radii([*STUDY_RADII, config.trial.threshold]))


def state_names(config: TrainConfig, lesions: Sequence[str] | None) -> list[str]:
    """The names of a study's states: "intact", then ``lesions``, each once, or all that the architecture can have.

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


def _lesions_of(config: TrainConfig, profile: str | None) -> dict[str, Lesion]:
    """The lesions of ``profile``, or of the run's. Raises UserError for an unknown one."""
    profile = profile or config.lesion_profile
    if profile not in LESIONS_OF:
        raise UserError(f"Unknown profile {profile!r}; choose from {', '.join(LESIONS_OF)}.")
    return LESIONS_OF[profile]


def _make_retraining(config: TrainConfig, layout: Layout, settings: LesionSettings) -> Retraining:
    """The epoch after a lesion, by the loss and settings of the run, or by the paper's where it learned by rewards.

    Raises:
        UserError: trials by which nothing can be retrained.
    """
    if config.trial.noisy or config.trial.feedback_delay:
        raise UserError("Retraining knows neither noise nor feedback delay, which this run has; use --no-retrain.")
    supervised, epoch = config.supervised, config.supervised.bptt
    if settings.retraining_trials is not None:
        epoch = dataclasses.replace(epoch, trials=settings.retraining_trials)
    if epoch.trials < epoch.batch_size:
        raise UserError(f"An epoch of {epoch.trials} trials is less than one batch of {epoch.batch_size}.")
    penalty, coefficient = supervised.penalty, supervised.penalty_coefficient
    return Retraining(layout, config.task, config.trial, epoch, penalty, coefficient, settings.threads)


def _copy(policy: MotorPolicy) -> Tensors:
    return {name: tensor.detach().clone() for name, tensor in policy.motor_network.state_dict().items()}
