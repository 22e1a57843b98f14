"""B5 and B6: what the callosum and each hemisphere do for two hands, seen by lesions."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd

from bilateral_rl.analysis.formats import mean_sd
from bilateral_rl.analysis.results import State
from bilateral_rl.analysis.samples import join_notes
from bilateral_rl.claims.claim import Aside, Component
from bilateral_rl.claims.components import Contrast, holm_family
from bilateral_rl.claims.evidence import Sample
from bilateral_rl.claims.intact import CALLOSAL
from bilateral_rl.claims.two_arms.evidence import NONE, OTHER, HandEvidence, derived
from bilateral_rl.claims.two_arms.hands import NOT_SPECIALIZED, SPECIALIZED
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.policies.lesions import INTACT
from bilateral_rl.vocabulary import SIDES, Side

DEFICITS: dict[Side, str] = {"dominant": "straightness", "non_dominant": "final position"}
"""What each hemisphere does for the arm of its own side, by B6: the deficit that its loss leaves there."""
_FREE = 0.0


def callosum_ties_the_hands(evidence: HandEvidence) -> list[Component]:
    """B5: without callosum, networks lose more of what they could where a spring ties the hands.

    The intact network that is compared with went through the same retraining in the same trials: one that was trained
    with the spring has to adapt to its absence, and without that the loss of the callosum would look smaller there.
    """
    return _of_callosum(evidence, evidence.criteria.callosum)


def callosum_judged_otherwise(evidence: HandEvidence) -> list[Aside]:
    """B5 relative to networks that were not retrained, and of networks that were not retrained after the cut."""
    protocol = evidence.criteria.callosum
    if protocol == NONE:
        return []
    return [
        Aside("relative to intact networks that were not retrained", tuple(_of_callosum(evidence, protocol, NONE))),
        Aside("without retraining", tuple(_of_callosum(evidence, NONE))),
    ]


def lost_side_shows(evidence: HandEvidence) -> list[Component]:
    """B6: the arm on the side of the lesion shows what the lost hemisphere did for it, and that more than the rest.

    Any damage worsens everything: a deficit is the lost side's if it is greater after this lesion than after the other.
    """
    return [*_ipsilesional(evidence, SPECIALIZED, _FREE), *_dissociation(evidence)]


def lesions_judged_otherwise(evidence: HandEvidence) -> list[Aside]:
    """The deficits alone; the other arm; models that are not specialized; with the spring."""
    asides = [
        Aside("as deficits alone, of whatever cause", tuple(_ipsilesional(evidence, SPECIALIZED, _FREE))),
        Aside("of the contralesional arm, a sanity check", tuple(_contralesional(evidence))),
        Aside(
            "as deficits alone, of models that are not specialized",
            tuple(_ipsilesional(evidence, NOT_SPECIALIZED, _FREE)),
        ),
    ]
    if evidence.criteria.spring:
        asides.append(
            Aside(
                "as deficits alone, with the spring",
                tuple(_ipsilesional(evidence, SPECIALIZED, evidence.criteria.spring)),
            )
        )
    return [aside for aside in asides if aside.components]


def _of_callosum(evidence: HandEvidence, protocol: str, of_intact: str | None = None) -> list[Component]:
    tied = evidence.criteria.tied
    contrasts = [
        Contrast(
            _relative_loss(evidence, model, tied, protocol, of_intact),
            _relative_loss(evidence, model, _FREE, protocol, of_intact),
            paired=True,
        )
        for model in CALLOSAL
    ]
    components = []
    for component, model in zip(holm_family(contrasts), CALLOSAL, strict=True):
        relearned = tuple(
            f"{model} without callosum at {k:g} N/m"
            for k in (tied, _FREE)
            if evidence.is_relearned(model, spring=k, lesion="callosum", protocol=protocol)
        )
        note = join_notes(component.note, evidence.left_out([model]))
        components.append(replace(component, note=note, relearned=relearned))
    return components


def _relative_loss(evidence: HandEvidence, model: str, spring: float, protocol: str, of_intact: str | None) -> Sample:
    """The combined loss without callosum, in percent of the intact network's in the same trials."""
    cut = evidence.loss(model, spring=spring, lesion="callosum", protocol=protocol)
    intact = evidence.loss(model, spring=spring, lesion=INTACT, protocol=of_intact or protocol)
    table = pd.concat([cut, intact], axis=1, join="inner")
    state = State(evidence.task, model, "callosum", protocol)
    measure = derived("Combined loss without callosum, relative to intact", "%", evidence.task)
    values = 100 * table.iloc[:, 0] / table.iloc[:, 1]
    return Sample(f"{model} at {spring:g} N/m", state, measure, values, evidence.absence(model))


def _acting(evidence: HandEvidence, models: tuple[str, ...]) -> list[str]:
    """The models in which a hemisphere acts on the arm of its own side, by a path or over the callosum."""
    return [model for model in models if evidence.criteria.has_path or MODELS[model].architecture == "callosal"]


def _measure_of(evidence: HandEvidence, side: Side) -> str:
    return evidence.criteria.deviation if DEFICITS[side] == "straightness" else "final_error"


def _ipsilesional(evidence: HandEvidence, models: tuple[str, ...], spring: float) -> list[Component]:
    """After a lesion of each hemisphere: the arm that is on its own side, against the intact network's.

    A hemisphere moves the opposite arm, so that the arm of its own side is the other hemisphere's.
    """
    there = _acting(evidence, models)
    contrasts, notes = [], []
    for model in there:
        for side in SIDES:
            what = model, side, OTHER[side], _measure_of(evidence, side), spring
            after, before = (_reaching(evidence, *what, lesioned=lesioned) for lesioned in (True, False))
            contrasts.append(Contrast(after, before, paired=True))
            extents = [
                _reaching(evidence, *what[:3], "extent", spring, lesioned=lesioned) for lesioned in (False, True)
            ]
            notes.append(join_notes(_extents(*extents), evidence.left_out([model])))
    return [
        replace(component, note=join_notes(component.note, note))
        for component, note in zip(holm_family(contrasts), notes, strict=True)
    ]


def _extents(before: Sample, after: Sample) -> str:
    """How far reaches get, since an undershoot looks straight."""
    if before.missing or after.missing:
        return ""
    return f"extent of the reaches of the {after.name}: {mean_sd(after.values)} %, {mean_sd(before.values)} % intact"


def _reaching(
    evidence: HandEvidence, model: str, side: Side, hand: Side, measure: str, spring: float, *, lesioned: bool
) -> Sample:
    """A hand's reaches after a deep lesion of ``side``, or of the intact network treated alike."""
    lesion, protocol = f"deep_{side}" if lesioned else INTACT, evidence.criteria.deep
    return evidence.hand(measure, model, hand, "reach", spring=spring, lesion=lesion, protocol=protocol)


def _contralesional(evidence: HandEvidence) -> list[Component]:
    """The arm that the lost hemisphere moved completes fewer reaches."""
    contrasts = []
    for model in SPECIALIZED:
        for side in SIDES:
            what = model, side, side, "goal_completion_5cm", _FREE
            after, before = (_reaching(evidence, *what, lesioned=lesioned) for lesioned in (True, False))
            contrasts.append(Contrast(before, after, paired=True))
    return holm_family(contrasts)


def _dissociation(evidence: HandEvidence) -> list[Component]:
    """Each deficit of ipsilesional arms, relative to intact, is greater after the lesion that is said to cause it."""
    contrasts = []
    for model in _acting(evidence, SPECIALIZED):
        for side in SIDES:
            measure = _measure_of(evidence, side)
            own, other = (_relative(evidence, model, lost, measure) for lost in (side, OTHER[side]))
            contrasts.append(Contrast(own, other, paired=True))
    return holm_family(contrasts)


def _relative(evidence: HandEvidence, model: str, side: Side, measure: str) -> Sample:
    """A measure of the ipsilesional arm's reaches after a lesion of ``side``, in percent of the intact network's."""
    what = model, side, OTHER[side], measure, _FREE
    after, before = (_reaching(evidence, *what, lesioned=lesioned) for lesioned in (True, False))
    table = pd.concat([after.values, before.values], axis=1, join="inner")
    label = f"{after.measure.metric.label}, relative to intact"
    values = 100 * table.iloc[:, 0] / table.iloc[:, 1]
    return Sample(after.name, after.state, derived(label, "%", evidence.task), values, after.absence)
