"""What a report on two arms shows beside the claims."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from bilateral_rl.analysis.metric import Metric
from bilateral_rl.analysis.metrics import find_metric
from bilateral_rl.claims.two_arms.evidence import TASK, HandEvidence
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.study.drawing import Drawing, draw_learning
from bilateral_rl.study.exhibits import Exhibits, Runs
from bilateral_rl.study.outcome import StudyResults
from bilateral_rl.study.trainings import Table
from bilateral_rl.study.two_arms.drawing import draw_hands
from bilateral_rl.study.two_arms.judging import criteria_of, results_by_spring
from bilateral_rl.study.two_arms.readings import HandReading
from bilateral_rl.study.two_arms.report_tables import HOLDS, REACHES, hand_report_tables


def exhibits_of_hands(reading: HandReading, shown: Sequence[Table], read: StudyResults, runs: Runs) -> Exhibits:
    """Make what a report shows of the first reading.

    Args:
        reading: the first one.
        shown: its tables of results.
        read: reads them.
        runs: the runs that are done, by task and model.
    """
    evidence = HandEvidence(results_by_spring(shown, read), criteria_of(reading, shown), TASK)
    tasks = list(dict.fromkeys(table.training.config.task for table in shown))
    present = {table.training.config.model for table in shown}
    models = [model for model in MODELS if model in present]
    tables = list(hand_report_tables(evidence, tasks, models))
    drawings = _drawings(evidence, models, runs)
    return Exhibits(tables, drawings, _metrics())


def _metrics() -> list[Metric]:
    return [find_metric(name) for name in dict.fromkeys((*REACHES, *HOLDS))]


def _drawings(evidence: HandEvidence, models: Sequence[str], runs: Runs) -> Iterator[Drawing]:
    yield from draw_hands(evidence, models)
    for task, of_task in runs.items():
        if of_task:
            yield draw_learning(task, of_task)
