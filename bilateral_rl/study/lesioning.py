"""Lesion studies: a run's networks intact and after each lesion, by each protocol (paper section 6)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import NamedTuple

import pandas as pd
import torch
from pydantic.dataclasses import dataclass

from bilateral_rl.analysis.goals import STUDY_RADII, distinct_radii
from bilateral_rl.analysis.metric import Metric
from bilateral_rl.analysis.metrics import measure, metrics_of
from bilateral_rl.analysis.protocols import DEFAULT_PROTOCOLS, Protocol
from bilateral_rl.analysis.results import COLUMNS, FRESH, TRAINED, treatment
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.config.bounds import check_fit, check_trial
from bilateral_rl.config.hyperparameters import Flag
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.envs.quantities import STRICT, NotNegative
from bilateral_rl.io.errors import UserError
from bilateral_rl.io.tensors import Tensors
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.policies.lesions import INTACT, LESIONS_OF, Lesion, find_lesion
from bilateral_rl.runs.folder import FINAL, RunFolder
from bilateral_rl.runs.policies import build_network, load_policies
from bilateral_rl.training.fresh_networks import fresh_network
from bilateral_rl.training.moments import Moments, trained_moments
from bilateral_rl.training.retraining import Retraining
from bilateral_rl.vocabulary import TEST_SEED, TEST_TRIALS

OnState = Callable[[int, int, str], None]
"""Called with how many states of how many are done, and the name of the next one."""


@dataclass(frozen=True, config=STRICT)
class LesionSettings:
    """How the networks of a run are lesioned, retrained and tested."""

    lesions: tuple[str, ...] | None = None
    """Names of the lesions; None for all that the architecture can have. The intact network always comes first."""
    protocols: tuple[Protocol, ...] = DEFAULT_PROTOCOLS
    """What follows each lesion; each state is tested once per protocol."""
    control: Flag = True
    """Whether freshly initialized networks of the same model, seeds, lesions and trials go through the same."""
    profile: str | None = None
    """Whose combined lesions: "paper" or "released"; None for the run's profile."""
    trials: int = TEST_TRIALS
    """Number of trials of each test."""
    seed: int = TEST_SEED
    """Seed of the test trials; trial i is the first one of seed + i."""
    threads: int = 0
    """CPU threads of the retraining; 0 for as many as there are."""
    device: str = "cpu"
    """Where networks are retrained."""
    retraining_trials: int | None = None
    """Number of trials of an epoch of retraining; None for the run's own number, or the usual one by BPTT."""
    spring: NotNegative | None = None
    """Stiffness of the spring between two hands in retraining and tests (N/m); None for that of the training."""


class _Case(NamedTuple):
    """A network after a lesion."""

    lesion: str
    network: str
    seed: int


_USUAL = LesionSettings()
_MOST_STACKED = 1_000
"""Networks that are retrained at once on a GPU, which takes 1.8 MB for each in batches of 64."""


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
        UserError: a lesion that is unknown or that the architecture cannot have, a seed that the run does not have, no
            protocol, or one that its networks cannot follow, or a spring that cannot be.
    """

    def __init__(
        self,
        folder: RunFolder,
        settings: LesionSettings = _USUAL,
        only: int | None = None,
        weights: str = FINAL,
    ) -> None:
        if not settings.protocols:
            raise UserError("A lesion study needs a protocol, if only that without retraining.")
        self.settings, self.config = settings, with_spring(folder.config(), settings.spring)
        self.names = state_names(self.config, settings.lesions)
        self._lesions = _lesions_of(self.config, settings.profile)
        self._policies = load_policies(folder, weights, only)
        self._layout = Layout(build_network(self.config))
        self._networks = self._all_networks()
        self._protocols = {protocol: self._retraining_by(protocol) for protocol in settings.protocols}
        self._moments = None
        if any(protocol.optimizer == "continued" for protocol in settings.protocols):
            self._moments = trained_moments(folder, list(self._policies), weights)
        self._evaluator = Evaluator(self.config.make_task(), self.config.trial, settings.trials, settings.seed)
        self._metrics = measured_metrics(self.config)

    def run(self, on_state: OnState = lambda done, total, name: None) -> pd.DataFrame:
        """Test every state, and return the long table of results (:mod:`bilateral_rl.analysis.results`).

        A network that retraining breaks has NaN for every metric.
        """
        rows: list[tuple[object, ...]] = []
        for done in range(0, len(self.names), self._at_once):
            names = self.names[done : done + self._at_once]
            on_state(done, len(self.names), names[0])
            rows += self._run(names)
        on_state(len(self.names), len(self.names), "")
        return pd.DataFrame(rows, columns=list(COLUMNS))

    @property
    def _at_once(self) -> int:
        """How many lesions are retrained in one stack: a CPU gains nothing by it, a GPU has room for many networks."""
        if self.settings.device == "cpu":
            return 1
        return max(1, _MOST_STACKED // sum(map(len, self._networks.values())))

    def _run(self, names: Sequence[str]) -> list[tuple[object, ...]]:
        """The rows of these lesions, lesion by lesion."""
        rows: dict[str, list[tuple[object, ...]]] = {name: [] for name in names}
        for protocol, retraining in self._protocols.items():
            cases = [
                _Case(name, network, seed) for name in names for network in self._networks for seed in self._policies
            ]
            after = self._retrained(retraining, cases) if retraining else map(self._state, cases)
            for case, state in zip(cases, after, strict=True):
                used = retraining.used_by(case.network) if retraining else protocol
                rows[case.lesion] += self._test(case, state, treatment(protocol, case.network, used))
        return [row for of_lesion in rows.values() for row in of_lesion]

    def _state(self, case: _Case) -> Tensors:
        return self._networks[case.network][case.seed]

    def _all_networks(self) -> dict[str, dict[int, Tensors]]:
        """The networks' parameters by seed: the trained ones, and their control if there is to be one."""
        networks = {TRAINED: {seed: _copy(policy) for seed, policy in self._policies.items()}}
        if self.settings.control:
            networks[FRESH] = {seed: fresh_network(self.config, seed) for seed in self._policies}
        return networks

    def _retraining_by(self, protocol: Protocol) -> Retraining | None:
        if protocol.retrain == "none":
            return None
        settings = self.settings
        return Retraining(self.config, protocol, settings.retraining_trials, settings.threads, settings.device)

    def _retrained(self, retraining: Retraining, cases: Sequence[_Case]) -> list[Tensors | None]:
        """The networks after they have adapted; None in place of one that went wrong."""
        moments = self._moments_of(cases) if retraining.used.optimizer == "continued" else None
        weights = self._layout.pack([self._state(case) for case in cases])
        lesions = [find_lesion(case.lesion, self._lesions) for case in cases]
        rows = retraining.run(weights, [case.seed for case in cases], lesions, moments)
        return [
            {name: tensor[0] for name, tensor in self._layout.unpack(row[None]).items()}
            if row.isfinite().all()
            else None
            for row in rows
        ]

    def _moments_of(self, cases: Sequence[_Case]) -> Moments:
        """What the optimizer of each case's network knows; nothing of fresh ones."""
        assert self._moments is not None
        seeds, fresh = list(self._policies), torch.tensor([case.network == FRESH for case in cases])
        own = [seeds.index(case.seed) for case in cases]
        first, second = (
            part[own].masked_fill(fresh[:, None], 0.0) for part in (self._moments.first, self._moments.second)
        )
        steps = [0 if is_fresh else self._moments.steps[i] for is_fresh, i in zip(fresh.tolist(), own, strict=True)]
        return Moments(first, second, steps)

    def _test(self, case: _Case, state: Tensors | None, treated: tuple[object, ...]) -> list[tuple[object, ...]]:
        """Rows of the table, one a metric; ``treated`` stands in the columns from network to trials."""
        config = self.config
        lesion = find_lesion(case.lesion, self._lesions)
        return [
            (config.model, config.task, config.algo, case.seed, case.lesion, *treated, metric, value)
            for metric, value in self._measure(self._policies[case.seed], state, lesion).items()
        ]

    def _measure(self, policy: MotorPolicy, state: Tensors | None, lesion: Lesion) -> dict[str, float]:
        if state is None:
            return {metric.name: float("nan") for metric in self._metrics}
        policy.motor_network.load_state_dict(state)
        with policy.motor_network.lesioned(lesion):
            return measure(self._evaluator.run(policy), self._metrics)


def measured_metrics(config: TrainConfig) -> list[Metric]:
    """The metrics in the results of a run: at the goal radii of every study and at the run's own."""
    return metrics_of(config.make_task(), distinct_radii([*STUDY_RADII, config.trial.threshold]))


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
            raise UserError(
                f"{config.model} is a {network.architecture} network and cannot have the lesion {name!r}; choose from "
                f"{', '.join([INTACT, *available])}."
            )
    return [INTACT, *(name for name in dict.fromkeys(lesions) if name != INTACT)]


def with_spring(config: TrainConfig, stiffness: float | None) -> TrainConfig:
    """The configuration with another spring between the hands.

    Raises:
        UserError: there is but one hand, or a spring that is far out of use or makes the hands swing.
    """
    if stiffness is None:
        return config
    if config.make_task().n_arms == 1:
        raise UserError(f"{config.task} is a task of one arm and has no spring between two hands; leave spring out.")
    two_arms = config.trial.two_arms
    spring = dataclasses.replace(two_arms.spring, stiffness=stiffness)
    trial = dataclasses.replace(config.trial, two_arms=dataclasses.replace(two_arms, spring=spring))
    changed = dataclasses.replace(config, trial=trial)
    check_trial(changed)
    check_fit(changed)
    return changed


def _lesions_of(config: TrainConfig, profile: str | None) -> dict[str, Lesion]:
    """The lesions of ``profile``, or of the run's. Raises UserError for an unknown one."""
    profile = profile or config.lesion_profile
    if profile not in LESIONS_OF:
        raise UserError(f"Unknown profile {profile!r}; choose from {', '.join(LESIONS_OF)}.")
    return LESIONS_OF[profile]


def _copy(policy: MotorPolicy) -> Tensors:
    return {name: tensor.detach().clone() for name, tensor in policy.motor_network.state_dict().items()}
