"""What is measured of the networks of a run, in every table of results of a study."""

from __future__ import annotations

import math

from bilateral_rl.analysis.goals import STUDY_RADII, distinct_radii
from bilateral_rl.analysis.hand_metrics import hand_metric_names, measure_hands
from bilateral_rl.analysis.metric import Metric
from bilateral_rl.analysis.metrics import measure, metrics_of
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.config.schema import TrainConfig


class Measures:
    """The metrics of a run's task; of two arms over both hands, and besides those of each hand in each role.

    Args:
        config: of the run.
    """

    def __init__(self, config: TrainConfig) -> None:
        self._metrics = measured_metrics(config)
        self._two_arms = config.make_task().n_arms == 2

    def of(self, record: TrialRecord) -> dict[str, float]:
        """Return every value by its name."""
        values = measure(record, self._metrics)
        return values | measure_hands(record) if self._two_arms else values

    def none(self) -> dict[str, float]:
        """Return the same for networks that cannot be measured: NaN."""
        names = [metric.name for metric in self._metrics]
        return dict.fromkeys([*names, *(hand_metric_names() if self._two_arms else ())], math.nan)


def measured_metrics(config: TrainConfig) -> list[Metric]:
    """The metrics in the results of a run: at the goal radii of every study and at the run's own."""
    return metrics_of(config.make_task(), distinct_radii([*STUDY_RADII, config.trial.threshold]))
