"""What a finished training comes to: the columns of ``learning.py`` that are read out of its run folder."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pandas as pd

from bilateral_rl.analysis.metrics import find_metric, preferred_metric
from bilateral_rl.analysis.modulation import side_modulation
from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.analysis.results import FRESH, TRAINED
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.envs.settings import TrialSettings
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import load_policy
from bilateral_rl.study.lesioning import LesionSettings, LesionStudy
from bilateral_rl.vocabulary import SIDES, TEST_SEED, TEST_TRIALS, Side

RADIUS = 0.05
"""Radius of the goal (m)."""
LEARNED = 90.0
"""Performance (%) of which the table says how many steps and minutes it took."""
CAPABLE = 70.0
"""Performance (%) from which on falls count."""
RETRAINED = Protocol("everything")
"""What follows the lesions of the table."""
OTHER: dict[Side, Side] = {"dominant": "non_dominant", "non_dominant": "dominant"}


def measures_of(folder: RunFolder) -> dict[str, float]:
    """Every measure of a finished run of one seed."""
    config = folder.config()
    policy = load_policy(folder)
    record = Evaluator(config.make_task(), config.trial, TEST_TRIALS, TEST_SEED).run(policy)
    along = pd.read_csv(folder.path / "evaluations.csv")
    measures = {"result": result_of(record, config.task), **progress(along, config.task, config.trial)}
    measures["minutes_to_90"] = minutes_at(
        pd.read_csv(folder.path / "monitor.csv", comment="#"), measures["steps_to_90"]
    )
    network = policy.motor_network
    if modulation := side_modulation(network, record):
        measures |= {f"share_{side}": percent for side, percent in modulation.percent.items()}
        measures |= {f"weight_{side}": weight for side, weight in network.combination_weights().items()}
        measures |= sides_alone(folder, config)
    return measures


def result_of(record: TrialRecord, task: str) -> float:
    """Completed reaches (%), or steps within the goal in a hold."""
    return find_metric(preferred_metric(task, RADIUS)).value(record)


# --- along the way ----------------------------------------------------------------------------------------------------


def progress(evaluations: pd.DataFrame, task: str, trial: TrialSettings) -> dict[str, float]:
    """Steps until the performance was learned, and its largest fall, from a run's ``evaluations.csv``.

    Performance is the share of completed reaches, or of a hold's steps within the goal (%).
    """
    if task == "hold_position":
        performance = 100 / trial.trial_length * evaluations["time_in_goal_steps"]
    else:
        performance = evaluations["goal_completion_percent"]
    learned = evaluations.loc[performance >= LEARNED, "timesteps"]
    return {
        "largest_fall": largest_fall(performance.tolist()),
        "steps_to_90": float(learned.iloc[0]) if len(learned) else math.nan,
    }


def largest_fall(performance: Sequence[float]) -> float:
    """Largest difference between the best performance so far and the present one, once it was ``CAPABLE``."""
    best, fall = -math.inf, 0.0
    for value in performance:
        best = max(best, value)
        if best >= CAPABLE:
            fall = max(fall, best - value)
    return fall


def minutes_at(monitor: pd.DataFrame, steps: float) -> float:
    """Minutes from the first step until that many were done, from a run's ``monitor.csv``; NaN for NaN."""
    ended = monitor.loc[monitor["l"].cumsum() >= steps, "t"]
    return float(ended.iloc[0]) / 60 if len(ended) else math.nan


# --- the two sides ----------------------------------------------------------------------------------------------------


def sides_alone(folder: RunFolder, config: TrainConfig) -> dict[str, float]:
    """The result with the one side or the other, after a deep lesion of its fellow and one epoch of everything.

    ``alone_<side>`` is the run's network, ``alone_<side>_fresh`` its control, a network that had learned nothing.
    """
    lesions = {f"deep_{OTHER[side]}": side for side in SIDES}
    settings = LesionSettings(lesions=tuple(lesions), protocols=(RETRAINED,), threads=1)
    table = LesionStudy(folder, settings).run()
    table = table[table["metric"] == preferred_metric(config.make_task(), RADIUS)]
    names = {TRAINED: "alone_{}", FRESH: "alone_{}_fresh"}
    return {
        names[row.network].format(lesions[row.lesion]): row.value
        for row in table[table["lesion"].isin(lesions)].itertuples()
    }
