"""C4 to C8: what hemispheres and the callosum do, seen by lesions (paper sections 6 and 7).

Performance is goal completion in a reach and time in the goal in a hold. Speed would not do: only reaches that succeed
have one, and after a lesion few may. States of one model are paired by seed, those of different models are not; the
tests of a claim are one family, adjusted after Holm.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

from bilateral_rl.analysis.samples import align, finite_pairs, join_notes
from bilateral_rl.claims.claim import Component
from bilateral_rl.claims.components import Contrast, difference_within, holm_family, ratio_within
from bilateral_rl.claims.evidence import Evidence, Measure, Sample
from bilateral_rl.claims.intact import CALLOSAL
from bilateral_rl.claims.margins import DROPPED, LITTLE, RECOVERED
from bilateral_rl.vocabulary import SIDES, Side


def specialization_without_callosum(evidence: Evidence) -> list[Component]:
    """C4: the hemispheres of Bi-S specialize, and those of Bi-NS lie between them."""
    contrasts = _hemispheres(evidence, "bi_s")
    for measure, preferred, other in _preferred_sides(evidence):
        best = evidence.hemisphere(measure, "bi_s", preferred)
        worst = evidence.hemisphere(measure, "bi_s", other)
        unspecialized = [evidence.hemisphere(measure, "bi_ns", side) for side in SIDES]
        contrasts += [Contrast(best, sample) for sample in unspecialized]
        contrasts += [Contrast(sample, worst) for sample in unspecialized]
    return holm_family(contrasts)


def equal_hemispheres(evidence: Evidence) -> list[Component]:
    """C5: the sides of Bi-NS differ little in the mean over the seeds; in single networks they may differ more."""
    components = []
    for measure in (evidence.completion, evidence.hold):
        dominant, non_dominant = (evidence.hemisphere(measure, "bi_ns", side) for side in SIDES)
        component = difference_within(dominant, non_dominant, LITTLE)
        note = join_notes(component.note, _apart(dominant, non_dominant))
        components.append(replace(component, note=note))
    return components


def shallow_worse_than_deep(evidence: Evidence) -> list[Component]:
    """C6: shallow lesions hurt more than deep ones."""
    measures = (evidence.completion, evidence.hold)
    return holm_family(
        [
            Contrast(
                evidence.lesioned(measure, model, f"deep_{side}"),
                evidence.lesioned(measure, model, f"shallow_{side}"),
                paired=True,
            )
            for measure, model, side in product(measures, CALLOSAL, SIDES)
        ]
    )


def specialization_with_callosum(evidence: Evidence) -> list[Component]:
    """C7: the hemispheres of CC-S specialize."""
    return holm_family(_hemispheres(evidence, "cc_s"))


def lesion_of_callosum(evidence: Evidence) -> list[Component]:
    """C8: what callosal models can do without callosum; the intact network is that before the lesion, not retrained."""
    components = []
    for model in CALLOSAL:
        reach, hold = (evidence.intact(measure, model) for measure in (evidence.completion, evidence.hold))
        cut_reach = evidence.lesioned(evidence.completion, model, "callosum")
        cut_hold = evidence.lesioned(evidence.hold, model, "callosum")
        shallow = evidence.lesioned(evidence.hold, model, "shallow_dominant")
        components += [
            ratio_within(cut_reach, reach, RECOVERED, paired=True),
            ratio_within(cut_hold, hold, -float("inf"), DROPPED, paired=True),
            difference_within(cut_hold, shallow, LITTLE, hold),
        ]
    return components


def _preferred_sides(evidence: Evidence) -> tuple[tuple[Measure, Side, Side], ...]:
    """Return each task's measure, the side that the paper expects to be better at it, and the other one."""
    return (evidence.completion, "dominant", "non_dominant"), (evidence.hold, "non_dominant", "dominant")


def _hemispheres(evidence: Evidence, model: str) -> list[Contrast]:
    """Contrast the preferred side of each task with the other."""
    return [
        Contrast(
            evidence.hemisphere(measure, model, preferred),
            evidence.hemisphere(measure, model, other),
            paired=True,
        )
        for measure, preferred, other in _preferred_sides(evidence)
    ]


def _apart(first: Sample, second: Sample) -> str:
    a, b = finite_pairs(*align(first.values, second.values))
    if not len(a):
        return ""
    distance = float(abs(a - b).mean())
    return f"the sides of one network are {distance:.3g} {first.measure.metric.unit} apart in {first.measure.task}"
