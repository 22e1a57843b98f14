"""B1 to B4: which hand is better at which role, in intact networks.

Hands of one network are paired by seed; the tests of a claim are one family, adjusted after Holm.

The interaction of hand and role sets errors in each hand's own role against those in the other's: the deviation of
reaches and the error of holds, each as a share of both hands' mean in the same network, so that either counts alike.
The dominant hand's own role is to reach, the other's to hold. Their difference is half the sum of what B1 and B2 state.
A hand that is as much better at both adds nothing to it; one that is better at both, but unequally so, would, and is a
global advantage all the same. So the interaction is complementary only if neither hand is worse in its own role.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import pandas as pd

from bilateral_rl.analysis.formats import mean_sd
from bilateral_rl.analysis.intervals import mean_interval
from bilateral_rl.analysis.metric import Role
from bilateral_rl.analysis.results import State
from bilateral_rl.analysis.samples import finite, join_notes
from bilateral_rl.claims.claim import Aside, Component
from bilateral_rl.claims.components import Contrast, difference_within, holm_family
from bilateral_rl.claims.evidence import Sample
from bilateral_rl.claims.margins import LITTLE
from bilateral_rl.claims.two_arms.criteria import HandCriteria, Judged
from bilateral_rl.claims.two_arms.evidence import OTHER, HandEvidence, derived
from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.vocabulary import SIDES, Side

SPECIALIZED = ("bi_s", "cc_s")
"""Models with two hemispheres, each of which has a loss of its own."""
NOT_SPECIALIZED = ("bi_ns", "cc_ns")
"""The same networks, trained by one loss."""
UNILATERAL = tuple(name for name, spec in MODELS.items() if spec.architecture == "unilateral")
OWN_ROLE: dict[Role, Side] = {"reach": "dominant", "hold": "non_dominant"}
"""Which hand a role belongs to, by the claims."""
_PARTS: dict[Judged, str] = {"until_2cm": "until within 2 cm", "whole": "over the whole trial"}
_STRAIGHT = {
    "initial direction error": HandCriteria(straightness="initial_direction_error"),
    "path length ratio": HandCriteria(straightness="path_length_ratio"),
    "maximal perpendicular deviation": HandCriteria(),
}


def straighter_reaches(evidence: HandEvidence) -> list[Component]:
    """B1: the dominant hand reaches straighter."""
    return _better_in_own_role(evidence, "reach", evidence.criteria.deviation)


def reaches_judged_otherwise(evidence: HandEvidence) -> list[Aside]:
    """B1 by the measures of straightness, and parts of the trial, that do not decide."""
    own = evidence.criteria
    asides = []
    for judged, where in _PARTS.items():
        for words, criteria in _STRAIGHT.items():
            name = replace(criteria, judged=judged).deviation
            if name != own.deviation:
                asides.append(Aside(f"by {words} {where}", tuple(_better_in_own_role(evidence, "reach", name))))
    return [*asides, _in_control(evidence, "two_reaches", straighter_reaches)]


def steadier_holds(evidence: HandEvidence) -> list[Component]:
    """B2: the non-dominant hand holds more stably."""
    return _better_in_own_role(evidence, "hold", evidence.criteria.steadiness)


def holds_judged_otherwise(evidence: HandEvidence) -> list[Aside]:
    """B2 by the measures that do not decide; and whether that hand ends its reaches closer, too."""
    others = {
        "RMS error": "hold_rms_error",
        "drift": "hold_drift",
        **{f"steps within {radius} cm": f"time_in_goal_{radius}cm" for radius in (1, 2, 5)},
    }
    asides = [
        Aside(f"by {words}", tuple(_better_in_own_role(evidence, "hold", name)))
        for words, name in others.items()
        if name != evidence.criteria.steadiness
    ]
    closer = Aside(
        "of where reaches end, which would be a global advantage",
        tuple(_better(evidence, "reach", "final_error", "non_dominant")),
    )
    return [*asides, closer, _in_control(evidence, "two_holds", steadier_holds)]


def interaction(evidence: HandEvidence) -> list[Component]:
    """B3: errors are smaller where each hand has its own role, and neither hand is worse in its own."""
    pairs = [in_roles(evidence, model) for model in SPECIALIZED]
    contrasts = [Contrast(swapped, own, paired=True) for own, swapped in pairs]
    return [
        _complementary(evidence, _told(evidence, component, model), model)
        for component, model in zip(holm_family(contrasts), SPECIALIZED, strict=True)
    ]


def no_interaction(evidence: HandEvidence) -> list[Component]:
    """B4: models that are not specialized show none, within a tenth of the mean."""
    return [_absent(evidence, model) for model in NOT_SPECIALIZED]


def no_interaction_of_one_side(evidence: HandEvidence) -> list[Aside]:
    """B4 of the unilateral models there are: one network, with no sides to specialize."""
    there = [model for model in UNILATERAL if evidence.has(model)]
    return [Aside("of unilateral models", tuple(_absent(evidence, model) for model in there))] if there else []


def in_roles(evidence: HandEvidence, model: str) -> tuple[Sample, Sample]:
    """Return errors (% of both hands' mean) of each hand in its own role, and of each in the other's; by seed."""
    own, swapped = [], []
    for role, measure in decisive(evidence.criteria):
        shares = hand_shares(evidence, model, role, measure)
        own.append(shares[OWN_ROLE[role]])
        swapped.append(shares[OTHER[OWN_ROLE[role]]])
    measure_of = derived("Error relative to both hands' mean", "%", evidence.task)
    state = State(evidence.task, model)
    return (
        Sample(f"{model}, each hand in its own role", state, measure_of, _mean_of(own), evidence.absence(model)),
        Sample(f"{model}, roles swapped", state, measure_of, _mean_of(swapped), evidence.absence(model)),
    )


def hand_shares(evidence: HandEvidence, model: str, role: Role, measure: str) -> dict[Side, pd.Series]:
    """Return each hand's error by seed, in percent of both hands' mean in the same network.

    Where more is better, what a hand lacks of the mean counts as if it were an error above it.
    """
    samples = {hand: evidence.hand(measure, model, hand, role) for hand in SIDES}
    table = pd.concat({hand: sample.values for hand, sample in samples.items()}, axis=1, join="inner")
    mean = table.mean(axis=1)
    shares = 100 * table.div(mean.where(mean > 0), axis=0)
    if samples[SIDES[0]].measure.metric.better == "higher":
        shares = 200 - shares
    return {hand: shares[hand] for hand in SIDES}


def advantage(evidence: HandEvidence, model: str, role: Role, measure: str) -> pd.Series:
    """Return by seed how much better the hand that a role belongs to is at it, in percent of both hands' mean."""
    shares, hand = hand_shares(evidence, model, role, measure), OWN_ROLE[role]
    return shares[OTHER[hand]] - shares[hand]


def decisive(criteria: HandCriteria) -> tuple[tuple[Role, str], tuple[Role, str]]:
    """Return each role with the name of the metric by which it is judged."""
    return ("reach", criteria.deviation), ("hold", criteria.steadiness)


def _mean_of(shares: Sequence[pd.Series]) -> pd.Series:
    return pd.concat(shares, axis=1, join="inner").mean(axis=1, skipna=False)


def _absent(evidence: HandEvidence, model: str) -> Component:
    own, swapped = in_roles(evidence, model)
    return _told(evidence, difference_within(swapped, own, LITTLE), model)


def _better_in_own_role(evidence: HandEvidence, role: Role, measure: str) -> list[Component]:
    return _better(evidence, role, measure, OWN_ROLE[role])


def _better(evidence: HandEvidence, role: Role, measure: str, hand: Side) -> list[Component]:
    """State of each specialized model that ``hand`` is better than the other by a measure."""
    contrasts = []
    for model in SPECIALIZED:
        good, bad = (evidence.hand(measure, model, one, role) for one in (hand, OTHER[hand]))
        pair = (good, bad) if good.measure.metric.better == "higher" else (bad, good)
        contrasts.append(Contrast(*pair, paired=True))
    return [
        replace(component, note=join_notes(component.note, _beside(evidence, model, role), evidence.left_out([model])))
        for component, model in zip(holm_family(contrasts), SPECIALIZED, strict=True)
    ]


def _beside(evidence: HandEvidence, model: str, role: Role) -> str:
    """How far reaches get, since an undershoot looks straight."""
    if role != "reach":
        return ""
    extents = {hand: evidence.hand("extent", model, hand, role).values for hand in SIDES}
    if not all(len(finite(values)) for values in extents.values()):
        return ""
    words = ", ".join(f"{hand.replace('_', '-')} {mean_sd(values)} %" for hand, values in extents.items())
    return f"extent of the reaches of {model}: {words}"


def _told(evidence: HandEvidence, component: Component, model: str) -> Component:
    """Add to an interaction what it is made of: how much better each hand is in its own role."""
    parts = []
    for role, measure in decisive(evidence.criteria):
        better = finite(advantage(evidence, model, role, measure))
        if len(better):
            hand = OWN_ROLE[role].replace("_", "-")
            parts.append(f"{hand} hand's advantage in {role} {mean_sd(better, 1, '+')} %")
    words = f"{model}: {', '.join(parts)}" if parts else ""
    return replace(component, note=join_notes(component.note, words, evidence.left_out([model])))


def _complementary(evidence: HandEvidence, component: Component, model: str) -> Component:
    """Support no interaction in which a hand is worse in its own role, by its 95 % interval."""
    worse = [
        OWN_ROLE[role]
        for role, measure in decisive(evidence.criteria)
        if len(values := finite(advantage(evidence, model, role, measure))) and mean_interval(values).high < 0
    ]
    if not worse or component.verdict != "supported":
        return component
    better = OTHER[worse[0]].replace("_", "-")
    note = f"{model}: the {better} hand is better in both roles, which is a global advantage"
    return replace(component, verdict="not supported", note=join_notes(component.note, note))


def _in_control(
    evidence: HandEvidence, task: str, components: Callable[[HandEvidence], list[Component]]
) -> Aside:  # fmt: skip
    return Aside(f"in {task}", tuple(components(evidence.in_task(task))))
