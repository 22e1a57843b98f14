"""The results that the claims ask for: values by seed of networks in a state, and the post-hoc tests of all models."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from bilateral_rl.analysis.formats import mean_sd
from bilateral_rl.analysis.metrics import Metric, find_metric, metric_name, preferred_metric
from bilateral_rl.analysis.results import State, by_seed
from bilateral_rl.analysis.samples import finite
from bilateral_rl.analysis.specialization import ALONE
from bilateral_rl.analysis.statistics import PairTest, games_howell, tukey_hsd
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.envs.tasks import HoldPosition, RandomReach
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import lesion_words
from bilateral_rl.vocabulary import Side

_NUMBER = {model: number for number, model in enumerate(MODELS)}


@dataclass(frozen=True)
class Measure:
    """A metric in a task."""

    metric: Metric
    task: str

    @property
    def text(self) -> str:
        """The measure as components of claims name it."""
        return f"{self.metric.label} ({self.task})"


@dataclass(frozen=True)
class Sample:
    """One measure of one model in one state, over the seeds."""

    name: str
    """The model and its state, as people read it."""
    model: str
    measure: Measure
    values: pd.Series
    """Values by seed, in rising order."""

    @property
    def missing(self) -> bool:
        """Whether there is not a single number."""
        return len(finite(self.values)) == 0

    @property
    def mean(self) -> float:
        """Mean over the seeds."""
        return float(finite(self.values).mean())

    @property
    def measured(self) -> str:
        """Mean ± standard deviation and the number of seeds, in words."""
        numbers = finite(self.values)
        return f"{self.name} {mean_sd(numbers)} {self.measure.metric.unit} (n = {len(numbers)})"


class Evidence:
    """Results as the claims ask for them.

    Args:
        results: long table (:mod:`bilateral_rl.analysis.results`), of one algorithm.
        radii: radius of the goal by task (m).

    Attributes:
        completion, speed, hold: the measures of the claims.
        protocol: name of the protocol that lesioned networks followed.

    Raises:
        UserError: results of several algorithms, or a radius that no goal can have.
    """

    def __init__(self, results: pd.DataFrame, radii: Mapping[str, float]) -> None:
        algorithms = sorted(set(results["algo"]))
        if len(algorithms) > 1:
            raise UserError(f"Claims are tested on results of one algorithm, not of {' and '.join(algorithms)}.")
        reach, hold = RandomReach.id, HoldPosition.id
        self.completion = Measure(find_metric(preferred_metric(reach, radii[reach])), reach)
        self.speed = Measure(find_metric(metric_name("speed_to_goal", radii[reach])), reach)
        self.hold = Measure(find_metric(preferred_metric(hold, radii[hold])), hold)
        self.protocol = "output"
        self._results = results
        self._values: dict[tuple[str, State], pd.Series] = {}
        self._post_hoc: dict[tuple[Measure, str, str], tuple[PairTest, PairTest]] = {}

    def without_retraining(self) -> Evidence:
        """Return the same evidence, but of lesioned networks that were not retrained."""
        other = copy.copy(self)
        other.protocol = "none"
        return other

    def intact(self, measure: Measure, model: str) -> Sample:
        """Return a measure of the networks as they were trained."""
        return self._sample(model, measure, State(measure.task, model))

    def lesioned(self, measure: Measure, model: str, lesion: str) -> Sample:
        """Return a measure of the networks after a lesion."""
        return self._after(f"{model} with {lesion_words(lesion)} lesion", measure, model, lesion)

    def hemisphere(self, measure: Measure, model: str, side: Side) -> Sample:
        """Return what ``side`` does alone: a measure of the networks after a deep lesion of the other side."""
        return self._after(f"{side.replace('_', '-')} hemisphere of {model}", measure, model, ALONE[side])

    def post_hoc(self, measure: Measure, first: str, second: str) -> tuple[PairTest, PairTest]:
        """Return Games–Howell and Tukey's HSD of two intact models, in the family of the models there are."""
        key = measure, first, second
        if key not in self._post_hoc:
            groups = [self.intact(measure, model).values for model in MODELS]
            pair = _NUMBER[first], _NUMBER[second]
            self._post_hoc[key] = games_howell(groups, [pair])[pair], tukey_hsd(groups, [pair])[pair]
        return self._post_hoc[key]

    def _after(self, name: str, measure: Measure, model: str, lesion: str) -> Sample:
        return self._sample(name, measure, State(measure.task, model, lesion, self.protocol))

    def _sample(self, name: str, measure: Measure, state: State) -> Sample:
        key = measure.metric.name, state
        if key not in self._values:
            self._values[key] = by_seed(self._results, *key)
        return Sample(name, state.model, measure, self._values[key])
