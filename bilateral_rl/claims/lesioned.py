"""C4 to C8: what hemispheres and the callosum do, seen by lesions (paper sections 6 and 7).

Performance is time in the goal in a hold, and in a reach what the criteria say: completion, speed, or both, each of
which must then bear the claim out. Speed is that of reaches that succeed, of which there may be few after a lesion:
beside it stands how many they are. States of one model are paired by seed, those of different models are not; the
tests of a claim are one family, adjusted after Holm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

from bilateral_rl.analysis.formats import mean_sd
from bilateral_rl.analysis.samples import align, finite_pairs, join_notes
from bilateral_rl.claims.claim import Component
from bilateral_rl.claims.components import Contrast, difference_within, holm_family, ratio_within
from bilateral_rl.claims.evidence import Evidence, Measure, Sample
from bilateral_rl.claims.intact import CALLOSAL
from bilateral_rl.claims.margins import DROPPED, LITTLE, RECOVERED
from bilateral_rl.policies.lesions import INTACT
from bilateral_rl.vocabulary import SIDES, Side


def specialization_without_callosum(evidence: Evidence) -> list[Component]:
    """C4: the hemispheres of Bi-S specialize, and those of Bi-NS lie between them."""
    contrasts = _hemispheres(evidence, "bi_s")
    for measure in evidence.after_lesions:
        preferred, other = _preferred(evidence, measure)
        best = evidence.hemisphere(measure, "bi_s", preferred)
        worst = evidence.hemisphere(measure, "bi_s", other)
        unspecialized = [evidence.hemisphere(measure, "bi_ns", side) for side in SIDES]
        contrasts += [_better(best, sample) for sample in unspecialized]
        contrasts += [_better(sample, worst) for sample in unspecialized]
    return _family(evidence, contrasts)


def equal_hemispheres(evidence: Evidence) -> list[Component]:
    """C5: the sides of Bi-NS differ little in the mean over the seeds; in single networks they may differ more."""
    components = []
    for measure in evidence.after_lesions:
        dominant, non_dominant = (evidence.hemisphere(measure, "bi_ns", side) for side in SIDES)
        component = difference_within(dominant, non_dominant, LITTLE)
        note = join_notes(component.note, _apart(dominant, non_dominant))
        components.append(_explained(evidence, replace(component, note=note), dominant, non_dominant))
    return components


def shallow_worse_than_deep(evidence: Evidence) -> list[Component]:
    """C6: shallow lesions hurt more than deep ones."""
    contrasts = [
        _better(
            evidence.lesioned(measure, model, f"deep_{side}"),
            evidence.lesioned(measure, model, f"shallow_{side}"),
            paired=True,
        )
        for measure, model, side in product(evidence.after_lesions, CALLOSAL, SIDES)
    ]
    return _family(evidence, contrasts)


def specialization_with_callosum(evidence: Evidence) -> list[Component]:
    """C7: the hemispheres of CC-S specialize."""
    return _family(evidence, _hemispheres(evidence, "cc_s"))


def lesion_of_callosum(evidence: Evidence) -> list[Component]:
    """C8: what callosal models can do without callosum; the intact network is that before the lesion, not retrained."""
    components = []
    for model, measure in product(CALLOSAL, evidence.after_lesions):
        intact, cut = evidence.intact(measure, model), evidence.lesioned(measure, model, "callosum")
        if measure != evidence.hold:
            recovery = _better(cut, intact)  # of a time, what is greater stands for what is worse
            component = ratio_within(recovery.greater, recovery.lesser, RECOVERED, paired=True)
            components.append(_explained(evidence, component, cut))
            continue
        shallow = evidence.lesioned(measure, model, "shallow_dominant")
        dropped = ratio_within(cut, intact, -float("inf"), DROPPED, paired=True)
        components.append(_explained(evidence, dropped, cut))
        alike = difference_within(cut, shallow, LITTLE, intact)
        components.append(_explained(evidence, alike, cut, shallow))
    return components


def _preferred(evidence: Evidence, measure: Measure) -> tuple[Side, Side]:
    """Return the side that the paper expects to be better by ``measure``, and the other one."""
    return ("non_dominant", "dominant") if measure == evidence.hold else ("dominant", "non_dominant")


def _hemispheres(evidence: Evidence, model: str) -> list[Contrast]:
    """Contrast the preferred side of each measure with the other."""
    contrasts = []
    for measure in evidence.after_lesions:
        preferred, other = (evidence.hemisphere(measure, model, side) for side in _preferred(evidence, measure))
        contrasts.append(_better(preferred, other, paired=True))
    return contrasts


def _better(better: Sample, worse: Sample, paired: bool = False) -> Contrast:
    """State that one sample is better than another: greater, or less where less is better."""
    if better.measure.metric.better == "lower":
        return Contrast(worse, better, paired)
    return Contrast(better, worse, paired)


def _family(evidence: Evidence, contrasts: Sequence[Contrast]) -> list[Component]:
    return [
        _explained(evidence, component, contrast.greater, contrast.lesser)
        for component, contrast in zip(holm_family(contrasts), contrasts, strict=True)
    ]


def _explained(evidence: Evidence, component: Component, *samples: Sample) -> Component:
    """Add to a component what must be known of the states that it is about."""
    there = [sample for sample in samples if sample.state.lesion != INTACT and not sample.missing]
    relearned = tuple(f"{s.name} in {s.measure.task}" for s in there if evidence.is_relearned(s))
    note = component.note
    if any(sample.measure == evidence.speed for sample in there):
        shares = ", ".join(f"{s.name} {mean_sd(evidence.succeeded(s).values)} %" for s in there)
        note = join_notes(
            note, "speed is that of reaches that succeed, and biased where few do", f"of all reaches succeed: {shares}"
        )
    return replace(component, note=note, relearned=relearned)


def _apart(first: Sample, second: Sample) -> str:
    a, b = finite_pairs(*align(first.values, second.values))
    if not len(a):
        return ""
    distance = float(abs(a - b).mean())
    return f"the sides of one network are {distance:.3g} {first.measure.metric.unit} apart in {first.measure.task}"
