"""The tables on two arms in a report: hands and roles, who is better at what, lesions by arm, and who never learned."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from bilateral_rl.analysis.formats import fixed, mean_sd, number
from bilateral_rl.analysis.intervals import hedges_g, mean_interval
from bilateral_rl.analysis.metric import ROLES, Role
from bilateral_rl.analysis.metrics import find_metric
from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.claims.two_arms.evidence import NOT_LEARNED, UNSTEADY, HandEvidence
from bilateral_rl.claims.two_arms.hands import advantage, decisive
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.envs.tasks import make_task
from bilateral_rl.figures.labels import model_label, task_label, with_unit
from bilateral_rl.policies.lesions import INTACT, lesion_words
from bilateral_rl.study.report_table import ReportTable
from bilateral_rl.vocabulary import SIDES, Side

REACHES = (
    "perpendicular_deviation_until_2cm", "initial_direction_error_until_2cm", "path_length_ratio_until_2cm",
    "perpendicular_deviation", "extent", "goal_completion_3cm", "goal_completion_5cm", "speed_to_goal_5cm",
    "final_error",
)  # fmt: skip
HOLDS = ("hold_rms_error", "hold_drift", "time_in_goal_1cm", "time_in_goal_2cm", "time_in_goal_5cm", "final_error")
SHOWN: dict[Role, tuple[str, ...]] = {"reach": REACHES, "hold": HOLDS}
"""Names of the metrics of each role in tables."""
_SPREAD = "Mean ± standard deviation over the seeds that learned."
_BETTER_NOTE = (
    "Percent of both hands' mean in the same network, with the 95 % interval over the seeds; above 0 as the claims "
    "have it. Interaction: half the sum of both advantages. Global advantage: half of the non-dominant hand's in both "
    "roles, which is no complementary dominance. Its loss makes it exact near the target, so that its reaches end "
    "closer, too: that is no stability. Hedges' g: in standard deviations over the seeds."
)
_LESION_NOTE = (
    "Reaches without spring, mean ± standard deviation over the seeds that learned. The contralesional arm is the one "
    "that the lost side moved."
)
_LEARNED_NOTE = (
    f"A network has learned if it completes {NOT_LEARNED:g} % of its reaches or more within 5 cm, with either hand; "
    f"where there are no reaches, if neither hand's RMS error in holds exceeds {UNSTEADY:g} cm. The others are left "
    "out of every other number."
)


def hand_report_tables(evidence: HandEvidence, tasks: Sequence[str], models: Sequence[str]) -> Iterator[ReportTable]:
    """Make the tables.

    Args:
        evidence: results of the claims' task, and of others.
        tasks: of the study.
        models: of the study, in the order of the catalogue.
    """
    of_task = {task: evidence if task == evidence.task else evidence.in_task(task) for task in tasks}
    yield _learned(of_task, models)
    for task, one in of_task.items():
        for role in ROLES:
            table = _hands(one, task, role, models)
            if table.rows:
                yield table
    if evidence.task in tasks:
        yield from (table for table in (_better(evidence, models), _lesions(evidence, models)) if table.rows)


def _learned(of_task: dict[str, HandEvidence], models: Sequence[str]) -> ReportTable:
    rows = []
    for task, evidence in of_task.items():
        for model in models:
            seeds = evidence.seeds(model)
            if seeds:
                stuck = evidence.not_learned(model)
                named = ", ".join(map(str, stuck)) or "–"
                rows.append([f"{task_label(task)}, {model_label(model)}", f"{len(seeds)}", f"{len(stuck)}", named])
    columns = ["", "networks", "never learned", "which seeds"]
    return ReportTable("learned", "Networks that never learned", columns, rows, _LEARNED_NOTE)


def _hands(evidence: HandEvidence, task: str, role: Role, models: Sequence[str]) -> ReportTable:
    """A row a model and hand."""
    metrics = [find_metric(name) for name in SHOWN[role]]
    rows = []
    if make_task(task).has_roles or role == ("hold" if task == "two_holds" else "reach"):
        for model in models:
            for hand in SIDES:
                samples = [evidence.hand(metric.name, model, hand, role) for metric in metrics]
                if not all(sample.missing for sample in samples):
                    name = f"{model_label(model)}, {hand.replace('_', '-')} hand"
                    rows.append([name, *(mean_sd(sample.values) for sample in samples)])
    title = f"{task_label(task)}: hands that {role}"
    return ReportTable(f"hands_{task}_{role}", title, ["", *map(with_unit, metrics)], rows, _SPREAD)


def _better(evidence: HandEvidence, models: Sequence[str]) -> ReportTable:
    rows = []
    for model in models:
        reach, hold = (advantage(evidence, model, *measure) for measure in decisive(evidence.criteria))
        closer = -advantage(evidence, model, "reach", "final_error")  # of the non-dominant hand
        both = pd.concat([reach, hold], axis=1, join="inner")
        values = [reach, hold, both.mean(axis=1), (both.iloc[:, 1] - both.iloc[:, 0]) / 2, closer]
        if len(both):
            size = hedges_g(both.mean(axis=1), np.zeros(len(both)), paired=True)
            g = f"{fixed(size.value, 2, '+')} ({fixed(size.low, 2)} to {fixed(size.high, 2)})"
            rows.append([model_label(model), *map(_interval, values), g])
    columns = [
        "", "dominant hand straighter in reach", "non-dominant hand steadier in hold", "interaction",
        "global advantage of the non-dominant hand", "its reaches end closer", "Hedges' g of the interaction",
    ]  # fmt: skip
    return ReportTable("roles", "Which hand is better at what (%)", columns, rows, _BETTER_NOTE)


def _lesions(evidence: HandEvidence, models: Sequence[str]) -> ReportTable:
    names = (evidence.criteria.deviation, "final_error", "goal_completion_5cm", "extent")
    metrics = [find_metric(name) for name in names]
    rows = []
    for model in models:
        if MODELS[model].architecture == "unilateral":
            continue
        for lesion in (INTACT, *(f"deep_{side}" for side in SIDES)):
            for hand in SIDES:
                samples = [
                    evidence.hand(
                        name, model, hand, "reach", spring=0.0, lesion=lesion, protocol=evidence.criteria.deep
                    )
                    for name in names
                ]
                if not all(sample.missing for sample in samples):
                    words = f"{model_label(model)}, {lesion_words(lesion)}: {_arm(lesion, hand)}"
                    rows.append([words, *(mean_sd(sample.values) for sample in samples)])
    protocol = Protocol.parse(evidence.criteria.deep).words
    title = f"Arms after deep lesions, {protocol}"
    return ReportTable("arms", title, ["", *map(with_unit, metrics)], rows, _LESION_NOTE)


def _arm(lesion: str, hand: Side) -> str:
    words = f"{hand.replace('_', '-')} hand"
    if lesion == INTACT:
        return words
    return f"{words} ({'contralesional' if lesion == f'deep_{hand}' else 'ipsilesional'})"


def _interval(values: pd.Series) -> str:
    interval = mean_interval(values)
    return f"{number(interval.value, '+')} ({number(interval.low)} to {number(interval.high)})"
