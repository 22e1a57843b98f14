"""The results that the claims ask for: values by seed of networks in a state, and the post-hoc tests of all models."""

from __future__ import annotations

import copy
from dataclasses import dataclass

import pandas as pd

from bilateral_rl.analysis.floor import above_control
from bilateral_rl.analysis.formats import mean_sd
from bilateral_rl.analysis.metric import Metric
from bilateral_rl.analysis.metrics import find_metric, metric_name, preferred_metric
from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.analysis.results import State, by_seed
from bilateral_rl.analysis.samples import finite
from bilateral_rl.analysis.statistics import PairTest, games_howell, tukey_hsd
from bilateral_rl.claims.criteria import Criteria
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.envs.tasks import HoldPosition, RandomReach
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import lesion_words
from bilateral_rl.vocabulary import SIDES, Side

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
    state: State
    measure: Measure
    values: pd.Series
    """Values by seed, in rising order."""
    absence: str = ""
    """Why there are none, if more is known than that there are no results."""

    @property
    def model(self) -> str:
        """Name of the model."""
        return self.state.model

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
        criteria: what they are judged by.

    Attributes:
        completion, speed, hold: the measures of the claims.
        after_lesions: the measures by which networks are judged after a lesion.
        protocol: name of the protocol that followed a lesion.

    Raises:
        UserError: results of several algorithms, or a radius that no goal can have.
    """

    def __init__(self, results: pd.DataFrame, criteria: Criteria) -> None:
        algorithms = sorted(set(results["algo"]))
        if len(algorithms) > 1:
            raise UserError(f"Claims are tested on results of one algorithm, not of {' and '.join(algorithms)}.")
        reach, hold, radii = RandomReach.id, HoldPosition.id, criteria.radii
        speed = "speed_to_goal" if criteria.arrival == "first" else "speed_to_third_step"
        self.completion = Measure(find_metric(preferred_metric(reach, radii[reach])), reach)
        self.speed = Measure(find_metric(metric_name(speed, radii[reach])), reach)
        self.hold = Measure(find_metric(preferred_metric(hold, radii[hold])), hold)
        self._time = Measure(find_metric(metric_name("time_to_goal", radii[reach])), reach)
        of_reach = {"completion": self.completion, "speed": self.speed}
        self.after_lesions = (*(of_reach[name] for name in criteria.measures), self.hold)
        self.protocol, self._alone = criteria.protocol, criteria.alone
        names = {measure.metric.name for measure in (self.completion, self.speed, self.hold, self._time)}
        self._results = results[results["metric"].isin(names)]
        self._values: dict[tuple[str, State], pd.Series] = {}
        self._relearned: dict[tuple[str, State], bool] = {}
        self._post_hoc: dict[tuple[Measure, str, str], tuple[PairTest, PairTest]] = {}

    def without_retraining(self) -> Evidence:
        """Return the same evidence, but of lesioned networks that were not retrained."""
        other = copy.copy(self)
        other.protocol = Protocol("none").name
        return other

    def by_time_to_goal(self) -> Evidence:
        """Return the same evidence, but of the mean time to the goal of a reach in place of all after a lesion."""
        other = copy.copy(self)
        other.after_lesions = (self._time,)
        return other

    def intact(self, measure: Measure, model: str) -> Sample:
        """Return a measure of the networks as they were trained."""
        return self._sample(model, measure, State(measure.task, model))

    def lesioned(self, measure: Measure, model: str, lesion: str) -> Sample:
        """Return a measure of the networks after a lesion."""
        return self._after(f"{model} with {lesion_words(lesion)} lesion", measure, model, lesion)

    def hemisphere(self, measure: Measure, model: str, side: Side) -> Sample:
        """Return what ``side`` does alone: a measure of the networks after a lesion of the other side."""
        (other,) = (name for name in SIDES if name != side)
        name = f"{side.replace('_', '-')} hemisphere of {model}"
        return self._after(name, measure, model, f"{self._alone}_{other}")

    def succeeded(self, sample: Sample) -> Sample:
        """Return the share of reaches that succeed in the state of ``sample``."""
        return self._sample(sample.name, self.completion, sample.state)

    def is_relearned(self, sample: Sample) -> bool:
        """Whether networks do no better in a state than freshly initialized ones that the same was done to.

        Speed is that of successful reaches, of which a fresh network may have a lucky few: the time to the goal decides
        in its place. Without results of fresh networks nobody knows, and the answer is no.
        """
        key = (self._time if sample.measure == self.speed else sample.measure).metric.name, sample.state
        if key not in self._relearned:
            self._relearned[key] = above_control(self._results, *key) is False
        return self._relearned[key]

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
        return Sample(name, state, measure, self._values[key])
