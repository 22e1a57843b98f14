"""All claims on two arms as data, and their verdicts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from bilateral_rl.claims.claim import Aside, Claim, Component
from bilateral_rl.claims.two_arms import hands, lesioned
from bilateral_rl.claims.two_arms.evidence import HandEvidence


def _nothing(evidence: HandEvidence) -> list[Aside]:
    return []


@dataclass(frozen=True)
class OnHands:
    """How a claim on two hands is computed."""

    statement: str
    components: Callable[[HandEvidence], list[Component]]
    beside: Callable[[HandEvidence], list[Aside]] = _nothing

    def evaluate(self, number: str, evidence: HandEvidence) -> Claim:
        """Return the claim with its verdict."""
        beside = [aside for aside in self.beside(evidence) if any(one.measured for one in aside.components)]
        return Claim(number, self.statement, tuple(self.components(evidence)), tuple(beside))


CLAIMS: dict[str, OnHands] = {
    "B1": OnHands(
        "Reach and hold, specialized models: the dominant hand reaches straighter than the non-dominant one "
        "(Woytowicz et al. 2018).",
        hands.straighter_reaches,
        hands.reaches_judged_otherwise,
    ),
    "B2": OnHands(
        "Reach and hold, specialized models: the non-dominant hand holds more stably than the dominant one "
        "(Woytowicz et al. 2018).",
        hands.steadier_holds,
        hands.holds_judged_otherwise,
    ),
    "B3": OnHands(
        "Specialized models show an interaction of hand and role, B1 and B2 together: errors are smaller where each "
        "hand has its own role, and neither is worse in it (complementary dominance).",
        hands.interaction,
    ),
    "B4": OnHands(
        "Models that are not specialized show no such interaction: it lies within ±10 % of the mean (prediction).",
        hands.no_interaction,
        hands.no_interaction_of_one_side,
    ),
    "B5": OnHands(
        "Cutting the callosum, with one epoch of retraining, harms more where a spring ties the hands than where none "
        "does, relative to intact (prediction).",
        lesioned.callosum_ties_the_hands,
        lesioned.callosum_judged_otherwise,
    ),
    "B6": OnHands(
        "After a deep lesion the ipsilesional arm shows the lost side's deficit: after a dominant lesion its "
        "trajectories suffer, after a non-dominant one its final position, each more than after the other lesion; "
        "without spring (Schaefer et al. 2007 and 2009).",
        lesioned.lost_side_shows,
        lesioned.lesions_judged_otherwise,
    ),
}
"""The claims on two arms by number."""


def evaluate_hand_claims(evidence: HandEvidence) -> list[Claim]:
    """Evaluate every claim; what is missing leaves the components that need it undecided.

    Raises:
        UserError: several values of one seed.
    """
    return [claim.evaluate(number, evidence) for number, claim in CLAIMS.items()]
