"""The figures of a study of two arms."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from bilateral_rl.analysis.metric import Role
from bilateral_rl.analysis.metrics import find_metric
from bilateral_rl.analysis.samples import finite
from bilateral_rl.claims.margins import LITTLE
from bilateral_rl.claims.two_arms.evidence import OTHER, HandEvidence
from bilateral_rl.claims.two_arms.hands import OWN_ROLE, advantage, decisive
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.figures.labels import axis_label, task_label
from bilateral_rl.figures.roles import Panel, hand_panel, hands_and_roles, lesioned_arms, own_roles
from bilateral_rl.policies.lesions import INTACT, lesion_words
from bilateral_rl.study.drawing import Drawing
from bilateral_rl.vocabulary import SIDES, Side


def draw_hands(evidence: HandEvidence, models: Sequence[str]) -> Iterator[Drawing]:
    """Draw what the hands do in the claims' task, figure by figure; none of what there are no numbers of."""
    label = task_label(evidence.task)
    there = [model for model in models if evidence.has(model)]
    if not there:
        return
    panels = [_hands(evidence, role, measure, there) for role, measure in _shown(evidence)]
    caption = f"{label}: what each hand does in each role; intact networks that learned, tested with arms exchanged."
    if _has_values(*(panel.values for panel in panels)):
        yield Drawing("hands_and_roles", caption, hands_and_roles(panels, label))
    names = {role: f"{OWN_ROLE[role].replace('_', '-')} hand in {role}" for role, _ in decisive(evidence.criteria)}
    advantages = {}
    for model in there:
        of = {names[role]: advantage(evidence, model, role, name) for role, name in decisive(evidence.criteria)}
        advantages[model] = of | {"interaction": pd.concat(of.values(), axis=1, join="inner").mean(axis=1)}
    caption = (
        f"{label}: how much better each hand is in its own role, in percent of both hands' mean; the band is what "
        "counts as no interaction."
    )
    if _has_values(advantages):
        yield Drawing("roles_interaction", caption, own_roles(advantages, label, 100 * LITTLE))
    lesioned = [model for model in there if MODELS[model].architecture != "unilateral"]
    if lesioned and evidence.has_results(0.0):
        measures = (evidence.criteria.deviation, "final_error")
        arms = [_ipsilesional(evidence, measure, lesioned) for measure in measures]
        caption = (
            f"{label}: reaches of the arm on the side of a deep lesion, without spring, relative to intact (100 %)."
        )
        if _has_values(*(panel.values for panel in arms)):
            yield Drawing("arms_after_lesions", caption, lesioned_arms(arms, label))


def _has_values(*by_model: Mapping[str, Mapping[str, ArrayLike]]) -> bool:
    """Whether there is any number in these values by model and column: empty axes show nothing."""
    return any(len(finite(values)) for of in by_model for columns in of.values() for values in columns.values())


def _shown(evidence: HandEvidence) -> list[tuple[Role, str]]:
    """What decides, and where reaches end: the hand that ends them closer is not the steadier one for that."""
    reach, hold = decisive(evidence.criteria)
    return [reach, ("reach", "final_error"), hold]


def _hands(evidence: HandEvidence, role: Role, measure: str, models: Sequence[str]) -> Panel:
    values = {
        model: {hand: evidence.hand(measure, model, hand, role).values.to_numpy() for hand in SIDES} for model in models
    }
    return hand_panel(find_metric(measure), role, values)


def _ipsilesional(evidence: HandEvidence, measure: str, models: Sequence[str]) -> Panel:
    columns = {model: {_after(side): _relative(evidence, measure, model, side) for side in SIDES} for model in models}
    return Panel(f"{axis_label(find_metric(measure)).split('(')[0].strip()}\n(% of intact)", columns)


def _relative(evidence: HandEvidence, measure: str, model: str, side: Side) -> np.ndarray:
    """A measure of the reaches of the arm on a lesion's side, in percent of the intact network's; (n,)."""
    protocol = evidence.criteria.deep
    after, before = (
        evidence.hand(measure, model, OTHER[side], "reach", spring=0.0, lesion=lesion, protocol=protocol).values
        for lesion in (f"deep_{side}", INTACT)
    )
    table = pd.concat([after, before], axis=1, join="inner")
    return (100 * table.iloc[:, 0] / table.iloc[:, 1]).to_numpy()


def _after(side: Side) -> str:
    return f"after a {lesion_words(f'deep_{side}')} lesion"
