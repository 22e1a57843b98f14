"""Builders of components: which estimate and which test decide a statement on samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import pandas as pd

from bilateral_rl.analysis.intervals import Interval, difference_interval, mean_interval, ratio_interval
from bilateral_rl.analysis.samples import Float64, align
from bilateral_rl.analysis.statistics import PairTest, holm, paired_test, welch_test
from bilateral_rl.claims.claim import Component
from bilateral_rl.claims.evidence import Evidence, Sample
from bilateral_rl.claims.margins import SMALLEST_EFFECT
from bilateral_rl.claims.rules import Verdict, is_greater, is_not_conclusively_greater, is_within

Rule = Callable[[Interval, float, float], Verdict]
_NAN = float("nan")
_NOTHING = Interval(_NAN, _NAN, _NAN, 0)


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
        _direction(contrast, float(p), f"{test.name}{suffix}")
        for contrast, test, p in zip(contrasts, tests, adjusted, strict=True)
    ]


def post_hoc(evidence: Evidence, contrasts: Sequence[Contrast], rule: Rule = is_greater) -> list[Component]:
    """Test directions between intact models by Games–Howell over all models, with Tukey's HSD reported beside it."""
    components = []
    for contrast in contrasts:
        pair = contrast.greater.model, contrast.lesser.model
        howell, tukey = evidence.post_hoc(contrast.greater.measure, *pair)
        components.append(_direction(contrast, howell.p, howell.name, tukey.p, rule))
    return components


def not_greater(evidence: Evidence, contrasts: Sequence[Contrast]) -> list[Component]:
    """State that the first sample of each contrast is not conclusively greater, tested as in :func:`post_hoc`."""
    return post_hoc(evidence, contrasts, is_not_conclusively_greater)


def mean_within(sample: Sample, low: float, high: float = float("inf")) -> Component:
    """State that a mean lies between ``low`` and ``high``, in the unit of its metric."""
    text = f"{sample.measure.text}: {sample.name} {_range(low, high)} {sample.measure.metric.unit}"
    if sample.missing:
        return undecided(text, [sample])
    estimate = mean_interval(sample.values)
    verdict = is_within(estimate, low, high)
    return Component(text, sample.measured, "mean", sample.measure.metric.unit, estimate, verdict, note=estimate.note)


def ratio_within(
    first: Sample, second: Sample, low: float, high: float = float("inf"), *, paired: bool = False
) -> Component:
    """State that the ratio of two means, first / second, lies between ``low`` and ``high``."""
    text = f"{first.measure.text}: {first.name} / {second.name} {_range(low, high)}"
    return _share(text, [first, second], Contrast(first, second, paired).values, low, high, paired)


def difference_within(first: Sample, second: Sample, share: float, whole: Sample | None = None) -> Component:
    """State that two samples of the same networks differ by at most ``share`` of ``whole``; None is their own mean."""
    reference = whole.name if whole else "their mean"
    text = f"{first.measure.text}: {first.name} − {second.name} within ±{100 * share:g} % of {reference}"
    samples = [first, second, *([whole] if whole else [])]
    table = pd.concat([sample.values for sample in samples], axis=1, join="inner").to_numpy(dtype=float)
    a, b = table[:, 0], table[:, 1]
    values = a - b, table[:, 2] if whole else (a + b) / 2
    return _share(text, samples, values, -share, share, paired=True, quantity=f"difference / {reference}")


def undecided(text: str, samples: Sequence[Sample]) -> Component:
    """Return a component that cannot be decided, because some of ``samples`` have no values."""
    names = ", ".join(f"{sample.name} in {sample.measure.task}" for sample in samples if sample.missing)
    return Component(text, "", "", "", _NOTHING, "undecided", note=f"no results of {names}")


def _direction(contrast: Contrast, p: float, test: str, tukey_p: float = _NAN, rule: Rule = is_greater) -> Component:
    text = contrast.text if rule is is_greater else f"{contrast.text}, not conclusively"
    pair = [contrast.greater, contrast.lesser]
    if any(sample.missing for sample in pair):
        return undecided(text, pair)
    estimate = difference_interval(*contrast.values, paired=contrast.paired)
    matters = SMALLEST_EFFECT * sum(abs(sample.mean) for sample in pair) / 2
    unit = contrast.greater.measure.metric.unit.replace("%", "points")
    verdict = rule(estimate, p, matters)
    return Component(text, _measured(pair), "difference", unit, estimate, verdict, test, p, tukey_p, estimate.note)


def _share(
    text: str,
    samples: Sequence[Sample],
    values: tuple[Float64, Float64],
    low: float,
    high: float,
    paired: bool,
    quantity: str = "ratio",
) -> Component:
    if any(sample.missing for sample in samples):
        return undecided(text, samples)
    estimate = ratio_interval(*values, paired=paired)
    verdict = is_within(estimate, low, high)
    return Component(text, _measured(samples), quantity, "", estimate, verdict, note=estimate.note)


def _measured(samples: Sequence[Sample]) -> str:
    return ", ".join(sample.measured for sample in samples)


def _range(low: float, high: float) -> str:
    if high == float("inf"):
        return f"at least {low:.4g}"
    return f"at most {high:.4g}" if low == -float("inf") else f"from {low:.4g} to {high:.4g}"
