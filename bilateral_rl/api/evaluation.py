"""Tests of a run's networks, intact or lesioned, as tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from bilateral_rl.analysis.modulation import SideModulation, side_modulation
from bilateral_rl.analysis.trials import Evaluator, TrialRecord, summaries
from bilateral_rl.api.checks import check_tests
from bilateral_rl.api.run import Run
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.io.errors import UserError
from bilateral_rl.policies.lesions import INTACT, LESIONS_OF, NO_LESION, Lesion
from bilateral_rl.runs.folder import FINAL
from bilateral_rl.runs.policies import build_network, load_policies


@dataclass(frozen=True)
class Evaluation:
    """What a run's networks did in the same trials."""

    config: TrainConfig
    """Of the run."""
    lesion: str
    """The lesion that they had, or "intact"."""
    records: Mapping[int, TrialRecord]
    """The trials of each network, by its seed."""
    modulations: Mapping[int, SideModulation]
    """What each side supplied, by seed; empty where there are no sides."""

    def by_seed(self) -> pd.DataFrame:
        """Return a row a network and radius of the goal: means over the trials (:meth:`Run.evaluate`)."""
        rows = []
        for seed, record in self.records.items():
            sides = self.modulations[seed].measures() if seed in self.modulations else {}
            for radius, measures in summaries(record, self.config.trial.threshold).items():
                rows.append({"seed": seed, "lesion": self.lesion, "threshold_m": radius, **measures, **sides})
        return pd.DataFrame(rows)

    def by_trial(self) -> pd.DataFrame:
        """Return a row a network and trial, at the run's own radius of the goal (:meth:`Run.evaluate`)."""
        tables = [
            record.table(self.config.trial.threshold).assign(seed=seed, lesion=self.lesion)
            for seed, record in self.records.items()
        ]
        return pd.concat(tables, ignore_index=True)


def evaluate(
    run: Run,
    trials: int,
    seed: int,
    *,
    lesion: str = INTACT,
    deterministic: bool = True,
    weights: str = FINAL,
) -> Evaluation:
    """Test a run's networks (:meth:`Run.evaluate`). Raises UserError for what cannot be tested so."""
    trials, seed = check_tests(trials, seed)
    config = run.config
    found = find_lesion_of(config, lesion)
    evaluator = Evaluator(config.task, config.trial, trials, seed)
    records, modulations = {}, {}
    for number, policy in load_policies(run.folder, weights, run.only).items():
        with policy.motor_network.lesioned(found):
            records[number] = evaluator.run(policy, deterministic)
            modulation = side_modulation(policy.motor_network, records[number])
        if modulation:
            modulations[number] = modulation
    return Evaluation(config, lesion, records, modulations)


def find_lesion_of(config: TrainConfig, name: str) -> Lesion:
    """Return the lesion of a run's profile. Raises UserError for one that its model cannot have."""
    available = (INTACT, *build_network(config).available_lesions())
    if name not in available:
        raise UserError(f"{config.model} cannot have the lesion {name!r}; choose from {', '.join(available)}.")
    return NO_LESION if name == INTACT else LESIONS_OF[config.lesion_profile][name]
