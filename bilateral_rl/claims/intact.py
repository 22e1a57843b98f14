"""C9 to C14: the intact models against each other (paper section 7).

Models are compared by Games–Howell over all of them; the paper's Tukey HSD stands beside it. C13 and C14 judge reaching
by speed to goal, since every model completes nearly all reaches (C9).
"""

from __future__ import annotations

from collections.abc import Sequence

from bilateral_rl.claims.claim import Component
from bilateral_rl.claims.components import Contrast, mean_within, not_greater, post_hoc, ratio_within, undecided
from bilateral_rl.claims.evidence import Evidence, Measure, Sample
from bilateral_rl.claims.margins import COMPLETES, NOT_WORSE
from bilateral_rl.config.catalogue import MODELS

SPECIALIZED = (("bi_s", "bi_ns"), ("cc_s", "cc_ns"))
"""Each specialized model with two hemispheres, and the same network trained without specialization."""

CALLOSAL = ("cc_s", "cc_ns")
"""The models with a callosum."""


def every_model_completes(evidence: Evidence) -> list[Component]:
    """C9: every model completes nearly all reaches."""
    return [mean_within(evidence.intact(evidence.completion, model), COMPLETES) for model in MODELS]


def strongest_in_reach(evidence: Evidence) -> list[Component]:
    """C10: which models are strongest in reach.

    That specialized models do not conclusively beat the others is a statement about speed, and for the callosal pair
    about completion too: for the other pair the claim itself has bi_s best at completion.
    """
    pairs = [_contrast(evidence, evidence.speed, *pair) for pair in SPECIALIZED]
    pairs.append(_contrast(evidence, evidence.completion, "cc_s", "cc_ns"))
    fastest = _against_all(evidence, evidence.speed, "cc_ns")
    most_complete = _against_all(evidence, evidence.completion, "bi_s")
    return [*post_hoc(evidence, fastest), *not_greater(evidence, pairs), *post_hoc(evidence, most_complete)]


def strongest_in_hold(evidence: Evidence) -> list[Component]:
    """C11: the specialized callosal model holds best; specialized models hold at least as well as the others."""
    hold = evidence.hold
    return [
        *post_hoc(evidence, _against_all(evidence, hold, "cc_s")),
        *(ratio_within(evidence.intact(hold, s), evidence.intact(hold, ns), NOT_WORSE) for s, ns in SPECIALIZED),
    ]


def two_hemispheres_hold_better(evidence: Evidence) -> list[Component]:
    """C12: every bilateral model holds better than the unilateral one with both losses."""
    bilateral = [model for pair in SPECIALIZED for model in reversed(pair)]
    return post_hoc(evidence, [_contrast(evidence, evidence.hold, model, "uni_b") for model in bilateral])


def as_good_as_the_specialist(evidence: Evidence) -> list[Component]:
    """C13: the best specialized bilateral model against the unilateral specialists of each task."""
    components = []
    for measure, preferred, other in (
        (evidence.speed, "uni_dl", "uni_ndl"),
        (evidence.hold, "uni_ndl", "uni_dl"),
    ):
        candidates = [evidence.intact(measure, model) for model, _ in SPECIALIZED]
        best = _best(candidates)
        if best is None:
            components.append(
                undecided(f"{measure.text}: best of {_names(candidates)} against {preferred}", candidates)
            )
            continue
        components.append(ratio_within(best, evidence.intact(measure, preferred), NOT_WORSE))
        components += post_hoc(evidence, [Contrast(best, evidence.intact(measure, other))])
    return components


def best_has_a_callosum(evidence: Evidence) -> list[Component]:
    """C14: the best model of each task has a callosum."""
    components = []
    for measure in (evidence.speed, evidence.hold):
        callosal = [evidence.intact(measure, model) for model in MODELS if model in CALLOSAL]
        others = [evidence.intact(measure, model) for model in MODELS if model not in CALLOSAL]
        best, rival = _best(callosal), _best(others)
        if best is None or rival is None:
            text = f"{measure.text}: best of {_names(callosal)} > best of {_names(others)}"
            components.append(undecided(text, [*callosal, *others]))
        else:
            components += post_hoc(evidence, [Contrast(best, rival)])
    return components


def _contrast(evidence: Evidence, measure: Measure, greater: str, lesser: str) -> Contrast:
    return Contrast(evidence.intact(measure, greater), evidence.intact(measure, lesser))


def _against_all(evidence: Evidence, measure: Measure, model: str) -> list[Contrast]:
    return [_contrast(evidence, measure, model, other) for other in MODELS if other != model]


def _best(samples: Sequence[Sample]) -> Sample | None:
    """Return the sample with the greatest mean; None if one has no results, because then nobody knows."""
    return None if any(sample.missing for sample in samples) else max(samples, key=lambda sample: sample.mean)


def _names(samples: Sequence[Sample]) -> str:
    return ", ".join(sample.name for sample in samples)
