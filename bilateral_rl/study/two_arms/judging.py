"""The claims on two arms as a reading judges them, from the tables of results that it asks for."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import pandas as pd

from bilateral_rl.analysis.samples import join_notes
from bilateral_rl.claims import Judgement
from bilateral_rl.claims.two_arms.criteria import HandCriteria
from bilateral_rl.claims.two_arms.evaluation import evaluate_hand_claims
from bilateral_rl.claims.two_arms.evidence import TASK, HandEvidence
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.study.outcome import StudyResults
from bilateral_rl.study.trainings import Table
from bilateral_rl.study.two_arms.readings import HandReading


def judge_hands(reading: HandReading, tables: Iterable[Table], read: StudyResults) -> Judgement:
    """Judge the claims on two arms.

    Args:
        reading: the reading.
        tables: those that it asks for.
        read: reads them.

    Raises:
        UserError: damaged or stale results.
    """
    there = list(tables)
    trained = dict.fromkeys(table.training.config.model for table in there)
    evidence = HandEvidence(results_by_spring(there, read), criteria_of(reading, there), models=tuple(trained))
    claims = evaluate_hand_claims(evidence)
    note = join_notes(evidence.share_left_out(), evidence.left_out(list(MODELS)))
    return Judgement(reading.name, claims, reading.anchor, reading.choices, reading.why, reading.source, note)


def results_by_spring(tables: Sequence[Table], read: StudyResults) -> dict[float, pd.DataFrame]:
    """Return the results of tables by the stiffness of the spring in their tests (N/m)."""
    springs = dict.fromkeys(table.spring for table in tables if table.spring is not None)
    return {spring: read.of(table for table in tables if table.spring == spring) for spring in springs}


def criteria_of(reading: HandReading, tables: Iterable[Table]) -> HandCriteria:
    """Return what a reading judges by, given how the networks of its tables were trained on the claims' task."""
    configs = [table.training.config for table in tables if table.training.config.task == TASK]
    of_sides = [config for config in configs if config.spec.architecture != "unilateral"]
    return reading.criteria((of_sides or configs)[0]) if configs else HandCriteria()
