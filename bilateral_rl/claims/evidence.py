"""The results that the claims ask for: values by seed of a model in a state, and the post-hoc tests of all models."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from bilateral_rl.analysis.comparison import values_by_seed
from bilateral_rl.analysis.formats import mean_sd
from bilateral_rl.analysis.metrics import Metric, find_metric, preferred_metric, threshold_name
from bilateral_rl.analysis.samples import finite
from bilateral_rl.analysis.statistics import PairTest, games_howell, tukey_hsd
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.envs.tasks import HoldPosition, RandomReach
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import INTACT, lesion_words
from bilateral_rl.vocabulary import Side

OTHER: dict[Side, Side] = {"dominant": "non_dominant", "non_dominant": "dominant"}
_NUMBER = {model: number for number, model in enumerate(MODELS)}


@dataclass(frozen=True)
class ClaimSettings:
    """What the paper leaves open."""

    reach_radius: float = 0.05
    """Of the goal in random_reach (m)."""
    hold_radius: float = 0.05
    """Of the goal in hold_position (m)."""


@dataclass(frozen=True)
class Measure:
    """A metric in a task."""

    metric: Metric
    task: str

    @property
    def text(self) -> str:
        """As components of claims name it."""
        return f"{self.metric.label} ({self.task})"


@dataclass(frozen=True)
class Sample:
    """One measure of one model in one state, over the seeds."""

    name: str
    """Of the model and its state, as people read it."""
    model: str
    measure: Measure
    values: pd.Series
    """By seed, in rising order."""

    @property
    def missing(self) -> bool:
        """Whether there is not a single number."""
        return len(finite(self.values)) == 0

    @property
    def mean(self) -> float:
        """Over the seeds."""
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
        settings: which goals.

    Attributes:
        completion, speed, hold: the measures of the claims.

    Raises:
        UserError: results of several algorithms, or a radius that no goal can have.
    """

    def __init__(self, results: pd.DataFrame, settings: ClaimSettings) -> None:
        algorithms = sorted(set(results["algo"]))
        if len(algorithms) > 1:
            raise UserError(f"Claims are tested on results of one algorithm, not of {' and '.join(algorithms)}.")
        reach, hold = RandomReach.id, HoldPosition.id
        self.completion = Measure(find_metric(preferred_metric(reach, settings.reach_radius)), reach)
        self.speed = Measure(find_metric(f"speed_to_goal_{threshold_name(settings.reach_radius)}"), reach)
        self.hold = Measure(find_metric(preferred_metric(hold, settings.hold_radius)), hold)
        self._results = results
        self._values: dict[tuple[str, str, str, str, bool], pd.Series] = {}
        self._post_hoc: dict[tuple[Measure, str, str], tuple[PairTest, PairTest]] = {}

    def intact(self, measure: Measure, model: str) -> Sample:
        """The network as it was trained."""
        return self._sample(model, measure, model, INTACT, retrained=False)

    def lesioned(self, measure: Measure, model: str, lesion: str, retrained: bool) -> Sample:
        """The network after a lesion."""
        return self._sample(f"{model} with {lesion_words(lesion)} lesion", measure, model, lesion, retrained)

    def hemisphere(self, measure: Measure, model: str, side: Side, retrained: bool) -> Sample:
        """What ``side`` does alone: the network after a deep lesion of the other side."""
        return self._sample(
            f"{side.replace('_', '-')} hemisphere of {model}", measure, model, f"deep_{OTHER[side]}", retrained
        )

    def post_hoc(self, measure: Measure, first: str, second: str) -> tuple[PairTest, PairTest]:
        """Games–Howell and Tukey's HSD of two intact models, in the family of the models there are."""
        key = measure, first, second
        if key not in self._post_hoc:
            groups = [self.intact(measure, model).values for model in MODELS]
            pair = _NUMBER[first], _NUMBER[second]
            self._post_hoc[key] = games_howell(groups, [pair])[pair], tukey_hsd(groups, [pair])[pair]
        return self._post_hoc[key]

    def _sample(self, name: str, measure: Measure, model: str, lesion: str, retrained: bool) -> Sample:
        key = measure.metric.name, measure.task, model, lesion, retrained
        if key not in self._values:
            self._values[key] = values_by_seed(self._results, *key)
        return Sample(name, model, measure, self._values[key])
