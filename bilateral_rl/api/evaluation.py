"""Tests of a run's networks, intact or lesioned, under the conditions of their training or others, as tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pandas as pd

from bilateral_rl.analysis.breakdowns import breakdown
from bilateral_rl.analysis.conditions import Conditions, conditions
from bilateral_rl.analysis.hands import hand_table
from bilateral_rl.analysis.metric import Metric
from bilateral_rl.analysis.metrics import metrics_of
from bilateral_rl.analysis.modulation import SideModulation, side_modulations
from bilateral_rl.analysis.trial_records import TrialRecord, summaries
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.api.checks import check_tests, flag
from bilateral_rl.api.run import Run
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.config.tasks import TaskWords
from bilateral_rl.policies.lesions import INTACT
from bilateral_rl.runs.folder import FINAL
from bilateral_rl.runs.lesions import lesion_of
from bilateral_rl.runs.policies import load_policies


@dataclass(frozen=True)
class Evaluation:
    """What a run's networks did in the same trials."""

    config: TrainConfig
    """Of the run, with the task and the trials of the test."""
    under: Conditions
    """Under what the networks were tested."""
    lesion: str
    """The lesion that the networks had, or "intact"."""
    records: Mapping[int, TrialRecord]
    """The trials of each network, by its seed."""
    modulations: Mapping[int, SideModulation]
    """What each side supplied, by seed; empty where there are no sides."""

    def by_seed(self) -> pd.DataFrame:
        """Return a row a network and radius of the goal: means over the trials (:meth:`Run.evaluate`)."""
        rows: list[dict[str, Any]] = []
        for seed, record in self.records.items():
            sides = self.modulations[seed].measures() if seed in self.modulations else {}
            for radius, measures in summaries(record, self.config.trial.threshold).items():
                rows.append({"seed": seed, "threshold_m": radius, **measures, **sides})
        return self._labelled(pd.DataFrame(rows))

    def by_trial(self) -> pd.DataFrame:
        """Return a row a network and trial, of two arms and hand, at the radius of the test (:meth:`Run.evaluate`)."""
        tables = [self._of_trials(record).assign(seed=seed) for seed, record in self.records.items()]
        return self._labelled(pd.concat(tables, ignore_index=True))

    def _of_trials(self, record: TrialRecord) -> pd.DataFrame:
        table = record.table(self.config.trial.threshold)
        if record.n_arms == 1:
            return table
        of_hands = hand_table(record)
        return table.join(of_hands[[name for name in of_hands if name not in table]])

    def taken_apart(self, by: str) -> pd.DataFrame:
        """Return a row a network and part of the trials, at the radius of the test (:meth:`Run.evaluate`)."""
        tables = [breakdown(record, by, self.metrics).assign(seed=seed) for seed, record in self.records.items()]
        table = pd.concat(tables, ignore_index=True)
        return self._labelled(table[["seed", *(name for name in table if name != "seed")]])

    @property
    def metrics(self) -> list[Metric]:
        """The metrics of the task, at the radius of the test, of all trials and hands."""
        found = metrics_of(self.config.make_task(), [self.config.trial.threshold])
        return [metric for metric in found if metric.condition is metric.hand is None]

    def _labelled(self, table: pd.DataFrame) -> pd.DataFrame:
        """Add what holds for every row: lesion, task, and settings that are told as changed."""
        labels = {"lesion": self.lesion, "task": self.under.task, **self.under.changed}
        return table.assign(**{name: [value] * len(table) for name, value in labels.items()})


def evaluate(
    run: Run,
    trials: int,
    seed: int,
    *,
    lesion: str = INTACT,
    task: TaskWords | None = None,
    settings: Mapping[str, Any] | None = None,
    deterministic: bool = True,
    weights: str = FINAL,
) -> Evaluation:
    """Test a run's networks (:meth:`Run.evaluate`); settings are nested dictionaries.

    Raises:
        UserError: what cannot be tested so.
    """
    trials, seed = check_tests(trials, seed)
    config = run.config
    under = conditions(config, task, settings)
    policies = load_policies(run.folder, weights, run.only)
    for policy in policies.values():
        policy.motor_network.set_lesion(lesion_of(run.folder, config, policy.motor_network, lesion))
    evaluator = Evaluator(under.config.make_task(), under.settings, trials, seed)
    deterministic = flag("--deterministic", deterministic)
    records = {number: evaluator.run(policy, deterministic) for number, policy in policies.items()}
    modulations = side_modulations({number: policy.motor_network for number, policy in policies.items()}, records)
    tested = under.config
    return Evaluation(tested, under, lesion, records, modulations)
