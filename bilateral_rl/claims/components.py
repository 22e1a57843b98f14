"""Builders of components: which estimate and which test decide a statement on samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import pandas as pd

from bilateral_rl.analysis.equivalence import EACH_SIDE, equivalence_test
from bilateral_rl.analysis.intervals import Interval, difference_interval, mean_interval, ratio_interval
from bilateral_rl.analysis.samples import Float64, align, join_notes
from bilateral_rl.analysis.statistics import PairTest, holm, paired_test, welch_test
from bilateral_rl.claims import designs, effects
from bilateral_rl.claims.claim import NOTHING, Component
from bilateral_rl.claims.evidence import Evidence, Sample
from bilateral_rl.claims.margins import PAPER_SEEDS, SMALLEST_EFFECT
from bilateral_rl.claims.rules import Verdict, is_equivalent, is_greater, is_not_conclusively_greater, is_within
from bilateral_rl.config.catalogue import MODELS

Rule = Callable[[Interval, float, float], Verdict]
_NAN = float("nan")


@dataclass(frozen=True)
class Contrast:
    """Two samples of one measure, the first of which should be greater."""

    greater: Sample
    lesser: Sample
    paired: bool = False
    """Whether both samples are of the same networks, so that each seed is compared with itself."""

    @property
    def text(self) -> str:
        """The statement in words."""
        return f"{self.greater.measure.text}: {self.greater.name} > {self.lesser.name}"

    @property
    def values(self) -> tuple[Float64, Float64]:
        """Values of both samples; if paired, (n,) each of the seeds that both have."""
        if self.paired:
            return align(self.greater.values, self.lesser.values)
        return self.greater.values.to_numpy(dtype=float), self.lesser.values.to_numpy(dtype=float)

    def test(self) -> PairTest:
        """Test this contrast alone."""
        return paired_test(*self.values) if self.paired else welch_test(*self.values)


def holm_family(contrasts: Sequence[Contrast]) -> list[Component]:
    """Test directions, each by a paired or by Welch's t test, with p-values adjusted for all of them after Holm."""
    tests = [contrast.test() for contrast in contrasts]
    adjusted = holm([test.p for test in tests])
    suffix = ", Holm" if len(tests) > 1 else ""
    return [
        _direction(contrast, float(p), f"{test.name}{suffix}", comparisons=len(tests))
        for contrast, test, p in zip(contrasts, tests, adjusted, strict=True)
    ]


def post_hoc(evidence: Evidence, contrasts: Sequence[Contrast], rule: Rule = is_greater) -> list[Component]:
    """Test directions between intact models by Games–Howell over all models, with Tukey's HSD reported beside it."""
    components = []
    for contrast in contrasts:
        pair = contrast.greater.model, contrast.lesser.model
        howell, tukey = evidence.post_hoc(contrast.greater.measure, *pair)
        components.append(_direction(contrast, howell.p, howell.name, tukey.p, rule, groups=len(MODELS)))
    return components


def not_greater(evidence: Evidence, contrasts: Sequence[Contrast]) -> list[Component]:
    """State that the first sample of each contrast is not conclusively greater, tested as in :func:`post_hoc`."""
    return post_hoc(evidence, contrasts, is_not_conclusively_greater)


def mean_within(sample: Sample, low: float, high: float = float("inf")) -> Component:
    """State that a mean lies between ``low`` and ``high``, in the unit of its metric."""
    unit = sample.measure.metric.unit
    text = f"{sample.measure.text}: {sample.name} {_range(low, high)} {unit}"
    if sample.missing:
        return undecided(text, [sample])
    estimate = mean_interval(sample.values)
    most = min(high, 100.0) if unit == "%" else high  # a share ends there, so that a plan must, too
    return Component(
        text, sample.measured, "mean", unit, estimate, is_within(estimate, low, high), note=estimate.note,
        effect=effects.inside(estimate, low, high, low),
        design=designs.of_mean(sample.values.to_numpy(dtype=float), low, most),
    )  # fmt: skip


def ratio_within(
    first: Sample, second: Sample, low: float, high: float = float("inf"), *, paired: bool = False
) -> Component:
    """State that the ratio of two means, first / second, lies between ``low`` and ``high``."""
    text = f"{first.measure.text}: {first.name} / {second.name} {_range(low, high)}"
    samples = [first, second]
    if any(sample.missing for sample in samples):
        return undecided(text, samples)
    values = Contrast(first, second, paired).values
    estimate = ratio_interval(*values, paired=paired)
    return Component(
        text, _measured(samples), "ratio", "", estimate, is_within(estimate, low, high), note=estimate.note,
        effect=effects.inside(estimate, low, high),
        design=designs.of_ratio(*values, low, high, paired),
    )  # fmt: skip


def difference_within(first: Sample, second: Sample, share: float, whole: Sample | None = None) -> Component:
    """State that two samples of the same networks differ by at most ``share`` of ``whole``; None is their own mean.

    Decided by two one-sided paired tests, of difference ± share · whole against 0.
    """
    reference = whole.name if whole else "their mean"
    text = f"{first.measure.text}: {first.name} − {second.name} within ±{100 * share:g} % of {reference}"
    samples = [first, second, *([whole] if whole else [])]
    if any(sample.missing for sample in samples):
        return undecided(text, samples)
    table = pd.concat([sample.values for sample in samples], axis=1, join="inner").to_numpy(dtype=float)
    a, b = table[:, 0], table[:, 1]
    values = a - b, table[:, 2] if whole else (a + b) / 2
    estimate = ratio_interval(*values, paired=True)
    test = equivalence_test(*values, -share, share, paired=True)
    return Component(
        text, _measured(samples), f"difference / {reference}", "", estimate,
        is_equivalent(estimate, test.p, -share, share), f"{test.name} at {EACH_SIDE:g} each", test.p,
        note=estimate.note,
        effect=effects.inside(estimate, -share, share),
        design=designs.of_ratio(*values, -share, share, paired=True),
    )  # fmt: skip


def undecided(text: str, samples: Sequence[Sample]) -> Component:
    """Return a component that cannot be decided, because some of ``samples`` have no values."""
    missing = [sample for sample in samples if sample.missing]
    names = ", ".join(f"{sample.name} in {sample.measure.task}" for sample in missing if not sample.absence)
    note = join_notes(*(sample.absence for sample in missing), f"no results of {names}" if names else "")
    return Component(text, "", "", "", NOTHING, "undecided", note=note)


def _direction(
    contrast: Contrast, p: float, test: str, tukey_p: float = _NAN, rule: Rule = is_greater,
    *, comparisons: int = 1, groups: int = 0,
) -> Component:  # fmt: skip
    claimed = rule is is_greater
    text = contrast.text if claimed else f"{contrast.text}, not conclusively"
    pair = [contrast.greater, contrast.lesser]
    if any(sample.missing for sample in pair):
        return undecided(text, pair)
    estimate = difference_interval(*contrast.values, paired=contrast.paired)
    mean = sum(abs(sample.mean) for sample in pair) / 2
    unit = contrast.greater.measure.metric.unit.replace("%", "points")
    return Component(
        text, _measured(pair), "difference", unit, estimate, rule(estimate, p, SMALLEST_EFFECT * mean), test, p,
        tukey_p, estimate.note,
        effect=effects.from_line(estimate, mean, 1 if claimed else -1),
        design=designs.of_direction(
            *contrast.values, mean, contrast.paired,
            comparisons=comparisons, groups=groups, least=2 if claimed else PAPER_SEEDS,
        ),
    )  # fmt: skip


def _measured(samples: Sequence[Sample]) -> str:
    return ", ".join(sample.measured for sample in samples)


def _range(low: float, high: float) -> str:
    if high == float("inf"):
        return f"at least {low:.4g}"
    return f"at most {high:.4g}" if low == -float("inf") else f"from {low:.4g} to {high:.4g}"
