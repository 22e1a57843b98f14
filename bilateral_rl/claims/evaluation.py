"""All claims as data, and their verdicts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import pandas as pd

from bilateral_rl.claims import intact, lesioned, unilateral
from bilateral_rl.claims.claim import Aside, Claim, Component
from bilateral_rl.claims.criteria import Criteria
from bilateral_rl.claims.evidence import Evidence


@dataclass(frozen=True)
class OnModels:
    """How a claim on intact models is computed."""

    statement: str
    components: Callable[[Evidence], list[Component]]

    def evaluate(self, number: str, evidence: Evidence) -> Claim:
        """Return the claim with its verdict."""
        return Claim(number, self.statement, tuple(self.components(evidence)))


@dataclass(frozen=True)
class OnLesions(OnModels):
    """How a claim on lesioned models is computed: after the criteria's protocol, and beside it otherwise."""

    def evaluate(self, number: str, evidence: Evidence) -> Claim:
        """Return the claim with its verdict.

        Beside it stand networks that were not retrained, and, where reaches are judged by the speed of those that
        succeed, the mean time to the goal, in which those that fail count too.
        """
        otherwise: dict[str, Evidence] = {}
        if (without := evidence.without_retraining()).protocol != evidence.protocol:
            otherwise["without retraining"] = without
        if evidence.speed in evidence.after_lesions:
            otherwise["by mean time to goal"] = evidence.by_time_to_goal()
        beside = tuple(Aside(name, tuple(self.components(other))) for name, other in otherwise.items())
        return replace(super().evaluate(number, evidence), beside=beside)


CLAIMS: dict[str, OnModels] = {
    "C1": OnModels("Reach: goal completion is 96.7 % of Uni-DL, 94.6 % of Uni-NDL.", unilateral.completion_of_reaches),
    "C2": OnModels("Reach: speed to goal of Uni-DL is about 17 % better than Uni-NDL's.", unilateral.speed_of_reaches),
    "C3": OnModels("Hold: Uni-NDL stays in the goal about 50 % longer than Uni-DL.", unilateral.time_of_holding),
    "C4": OnLesions(
        "Bi-S, lesioned: the dominant hemisphere is better at reach, the non-dominant at hold; the preferred "
        "hemisphere beats both of Bi-NS, which beat the non-preferred.",
        lesioned.specialization_without_callosum,
    ),
    "C5": OnLesions("Bi-NS: there is little difference between its hemispheres.", lesioned.equal_hemispheres),
    "C6": OnLesions("CC-S and CC-NS: shallow lesions hurt more than deep ones.", lesioned.shallow_worse_than_deep),
    "C7": OnLesions(
        "CC-S, lesioned: the dominant hemisphere is better at reach, the non-dominant at hold.",
        lesioned.specialization_with_callosum,
    ),
    "C8": OnLesions(
        "Callosum lesion and one epoch: reach recovers almost fully; hold drops a lot, about as after a shallow "
        "dominant lesion.",
        lesioned.lesion_of_callosum,
    ),
    "C9": OnModels("Reach: every model completes about 95 % or more.", intact.every_model_completes),
    "C10": OnModels(
        "Reach: CC-NS is strongest in speed; specialized bilateral models do not conclusively beat non-specialized "
        "ones; Bi-S is best at completion.",
        intact.strongest_in_reach,
    ),
    "C11": OnModels(
        "Hold: CC-S is significantly better than every other model; specialized models are at least as good as "
        "non-specialized ones.",
        intact.strongest_in_hold,
    ),
    "C12": OnModels(
        "Hold: every bilateral model is significantly better than Uni-B.", intact.two_hemispheres_hold_better
    ),
    "C13": OnModels(
        "Both tasks: the best specialized bilateral model is at least as good as the preferred unilateral one and "
        "significantly better than the non-preferred one.",
        intact.as_good_as_the_specialist,
    ),
    "C14": OnModels("Both tasks: the best model has a callosum.", intact.best_has_a_callosum),
}
"""The paper's claims (section 7) by number."""


def evaluate_claims(results: pd.DataFrame, criteria: Criteria) -> list[Claim]:
    """Evaluate every claim.

    Args:
        results: long table (:mod:`bilateral_rl.analysis.results`), of one algorithm; a model, task, lesion or protocol
            that is missing leaves the components that need it undecided.
        criteria: what they are judged by.

    Raises:
        UserError: results of several algorithms, several values of one seed, or a radius that no goal can have.
    """
    evidence = Evidence(results, criteria)
    return [claim.evaluate(number, evidence) for number, claim in CLAIMS.items()]
